# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The C of a monitor, with and without named causes: no warning, MISRA, nothing from outside."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest
from samples import sample

import penode_gen
from penode_sil.targets import MACHINES, PORT

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
TEXT = (HERE / "models" / "monitored.toml").read_text().replace("../../../gen", str(ROOT / "gen"))
CAUSE = "[monitor.causes]\nrubbing = { friction = 30 }"
VARIANTS = {
    "one cause": "",
    "of state and input": "[monitor.causes]\nrubbing = { friction = 30, transition = 0.01 }\ntyre = { c_t = -3e4 }",
    "none": "[monitor.causes]",
}


@pytest.fixture(params=sample(list(VARIANTS), "of state and input"))
def folder(tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    """With all C of a variant."""
    assert CAUSE in TEXT
    (tmp_path / "model.toml").write_text(TEXT.replace(CAUSE, VARIANTS[request.param] or CAUSE))
    penode_gen.generate(penode_gen.load(tmp_path / "model.toml"), tmp_path)
    return tmp_path


@pytest.mark.parametrize("double", [False, True])
def test_the_c_gives_no_warning(folder: Path, double: bool) -> None:
    """As that of a filter: test_filter_file.py."""
    options = ["-std=c99", "-fsyntax-only", "-Werror", f"-I{ROOT / 'inc'}", f"-I{ROOT / 'port/gnu'}"]
    options += ["-DPEN_REAL_DOUBLE"] if double else []
    silent = [f"-Wno-{w}" for w in ("padded", "documentation", "declaration-after-statement", "unsafe-buffer-usage", "double-promotion")]
    strict = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wshadow", "-Wfloat-equal", "-Wundef", "-O2"]
    for source in ("monitored_monitor.c", "monitored_ekf.c"):
        subprocess.run(["clang-19", "-Weverything", *silent, *options, str(folder / source)], check=True)
        subprocess.run(["gcc", *strict, *options, str(folder / source)], check=True)


def test_the_c_keeps_misra(folder: Path) -> None:
    headers = [*(folder / f"monitored{part}.h" for part in ("", "_ekf", "_monitor"))]
    headers += [Path("inc/penode", path.name) for path in sorted((ROOT / "inc/penode").glob("*.h"))]
    headers.append(Path("port/template/pen_port_target.h"))
    entry = folder / "every_entry.c"
    made = subprocess.run(["test/misra/every_entry", *map(str, headers)], cwd=ROOT, capture_output=True, text=True, check=True)
    entry.write_text(made.stdout)
    sources = [str(entry), *(str(folder / f"monitored{part}.c") for part in ("", "_ekf", "_monitor", "_selftest"))]
    done = subprocess.run(
        ["test/misra/check", "clean", *sources], cwd=ROOT, capture_output=True, text=True, env=os.environ | {"OPTIONS": f"-I{folder}"}
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("machine", ["m4f", "m3"])
def test_the_c_needs_nothing_from_outside(folder: Path, machine: str) -> None:
    """Neither libc nor heap, with the option with which gcc may try memcpy; soft float where there is no FPU."""
    found: set[str] = set()
    for level in ("-O2", "-Os", "-O3"):
        for source in (folder / "monitored_monitor.c", ROOT / "src" / "pen_monitor.c"):
            out = folder / "monitor.o"
            options = ["-std=c99", level, "-ftree-loop-distribute-patterns", f"-I{folder}"]
            subprocess.run([PORT / "cc", MACHINES[machine], *options, "-c", "-o", out, source], check=True)
            listed = subprocess.run(["arm-none-eabi-nm", "-u", out], capture_output=True, text=True, check=True).stdout
            found |= {line.split()[-1] for line in listed.splitlines()}
    soft = {name for name in found if name.startswith(("__aeabi_f", "__aeabi_ui2f", "__aeabi_i2f"))}
    assert {name for name in found - (soft if machine == "m3" else set()) if not name.startswith(("pen_", "monitored_"))} == set()
