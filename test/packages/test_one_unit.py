# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""All models in one translation unit, with the amalgamated runtime in it as well: no two names clash, no compiler warns."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from build import CC, ROOT, VERSION, Fails, run

STRICT = ["-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wmissing-prototypes", "-Wredundant-decls", "-Wundef"]
COMPILERS = {"gcc": CC, "clang": ["clang-19", *CC[1:]], "arm": [ROOT / "port/cortex-m/cc", "mps2-an386", *CC[1:], "-Os"]}


def one_unit(work: Path, folder: Path, options: list[str], runtime: list[str], compiler: str) -> str:
    """Compile one source that includes all models of a folder, after sources of the runtime; what the compiler says."""
    models = sorted(path.name for path in folder.glob("*.c") if path.name != "penode.c")
    assert len(models) > 2
    unit = work / "unit.c"
    unit.write_text("".join(f'#include "{name}"\n' for name in [*runtime, *models]), encoding="utf-8")
    return run([*COMPILERS[compiler], *STRICT, f"-I{folder}", *options, "-c", unit, "-o", work / "unit.o"])


@pytest.fixture
def one(tree: Path, tmp_path: Path) -> Path:
    """The amalgamated package, to be changed."""
    return Path(shutil.copytree(tree / f"penode-{VERSION}-amalgamated", tmp_path / "one"))


@pytest.mark.parametrize("compiler", COMPILERS)
def test_models_and_runtime(compiler: str, one: Path, tmp_path: Path):
    assert one_unit(tmp_path, one, [], ["penode.c"], compiler) == ""


@pytest.mark.parametrize("compiler", COMPILERS)
def test_models_alone(compiler: str, tree: Path, tmp_path: Path):
    folder = tree / f"penode-{VERSION}"
    options = [f"-I{folder / name}" for name in ("inc", "port/gnu")]
    assert one_unit(tmp_path, folder / "models" / "nqvm", options, [], compiler) == ""


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")


@pytest.mark.parametrize(
    ("file", "old", "new", "said"),
    [
        ("nqvm_euler.c", "nqvm_euler_rates(", "nqvm_rates(", "nqvm_rates"),  # a function of two models
        ("nqvm_euler.c", "NQVM_EULER_M_B_INVERSE ((pen_real_t)(1.0", "NQVM_M_B_INVERSE ((pen_real_t)(2.0", "NQVM_M_B_INVERSE"),
        ("penode.c", "#undef HALF", "", "HALF"),  # a macro of two sources
        ("penode.c", "view_from(", "pivot_row(", "pivot_row"),  # a function of two sources
    ],
)
def test_clash_is_noticed(file: str, old: str, new: str, said: str, one: Path, tmp_path: Path):
    change(one / file, old, new)
    with pytest.raises(Fails, match=f"(re-?defin|conflicting types|previous).*{said}|{said}.*redefin"):
        one_unit(tmp_path, one, [], ["penode.c"], "gcc")


def test_program_keeps_its_own_contraction(one: Path, tmp_path: Path):
    """Pragmas for the arithmetic apply to the runtime and the models only, not a program that includes their headers."""
    said = run(["gcc", "-E", f"-I{one}", "-include", "nqvm.h", "-x", "c", "/dev/null"], cwd=tmp_path)
    assert "pen_real_t" in said and "optimize" not in said and "FP_CONTRACT" not in said


def fused(one: Path, file: str) -> int:
    """How many products and sums the compiler joins with its own defaults, on a core that can."""
    core = ["-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard", "-ffreestanding"]
    return run(["arm-none-eabi-gcc", *core, "-O2", f"-I{one}", "-S", one / file, "-o", "-"]).count("vfm")


def test_no_contraction_without_a_flag(one: Path):
    assert [fused(one, file) for file in ("penode.c", "nqvm.c", "nqvm_folded.c")] == [0, 0, 0]
    for file in ("penode.c", "nqvm.c"):
        change(one / file, "#define PENODE_EXACT\n", "")
        assert fused(one, file) > 0, "the test cannot see it"
