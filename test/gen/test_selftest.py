# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The self-tests: their answers are those of the C, to the bit, for every kind of model; and every broken build is reported."""

from __future__ import annotations

import ctypes
import itertools
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import models
import numpy as np
import pytest

import penode_gen
from penode_gen.emission import selftest
from penode_gen.emission.model_c import Emitter
from penode_gen.twins import translate
from penode_gen.twins.evaluate import Evaluator
from penode_sil.targets import MACHINES, Sil

ROOT = Path(__file__).resolve().parents[2]
NQVM = ROOT / "gen" / "nqvm" / "c"
REALS = {np.float32: [], np.float64: ["-DPEN_REAL_DOUBLE"]}
FLUSH, ROUNDING, REAL, CONTRACTED, ANSWER, SET = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20
METHODS, INPUTS, OUTSIDE = (
    ("euler", "heun", "rk4", "ros1", "ros2"),
    ("held", "linear", "parabola", "cubic"),
    ("extrapolate", "clamp", "fade"),
)
ACTIVATIONS = ("tanh", "relu", "sigmoid", "softplus", "step", "identity")

# Every method with every interpolation, the rest spread over them.
RICH = [
    (method, input, OUTSIDE[i % 3], ACTIVATIONS[i % 6], (1, 3)[i % 7 % 2])
    for i, (method, input) in enumerate(itertools.product(METHODS, INPUTS))
]


RUNTIME = [path for path in sorted((ROOT / "src").glob("*.c")) if not path.stem.startswith("pen_xcp")]  # which no self-test calls


@cache
def runtime(*options: str, but: str = "") -> Path:
    """The runtime's objects as one, made once; but for one file."""
    made = Path(tempfile.mkdtemp()) / "runtime.o"
    subprocess.run(["gcc", *options, "-r", "-nostdlib", "-o", made, *(path for path in RUNTIME if path.name != but)], check=True)
    return made


def build(folder: Path, *flags: str, model: Path = NQVM, name: str = "nqvm", changed: Path | None = None) -> ctypes.CDLL:
    """A model's C, its self-test and the runtime as a library; -O0 compiles fastest, and -ffp-contract=off comes first. `changed`: a
    file that takes the place of one of src/, or a folder that takes that of all sources."""
    source = changed if changed and changed.is_dir() else ROOT
    options = ["-std=c99", "-O0", "-ffp-contract=off", *flags, f"-I{source}/inc", f"-I{ROOT}/port/gnu", "-fPIC"]
    if source == ROOT:
        others = [runtime(*options, but=changed.name), changed] if changed else [runtime(*options)]
    else:
        others = [source / "src" / path.name for path in RUNTIME]
    files = [model / f"{name}{end}.c" for end in ("", "_params", "_selftest")]
    library = folder / f"{name}{len(list(folder.glob('*.so')))}.so"
    subprocess.run(["gcc", *options, f"-I{model}", "-shared", "-o", library, *files, *others], check=True)
    return ctypes.CDLL(str(library))


def type_word(real: type) -> int:
    """PEN_SELFTEST_TYPE"""
    info = np.finfo(real)
    return (info.nmant + 1) << 16 | info.maxexp << 4 | np.dtype(real).itemsize


def found(library: ctypes.CDLL, name: str = "nqvm", real: type = np.float32) -> int:
    """What NAME_selftest() reports, on an instance with room for any model of these tests."""
    lent = (ctypes.c_uint64 * 20000)()
    return getattr(library, f"{name}_selftest_of")(lent, ctypes.c_uint32(type_word(real)))


def first_difference(model: penode_gen.Model, real: type) -> str:
    """Where evaluator and C part: sample, states, outputs."""
    machine, instance = Evaluator(Emitter(model).context(), real), Sil(model, real).instance()
    draw = np.random.default_rng(1)
    for k in range(200):
        u = draw.uniform(-0.3, 0.3, len(model.inputs)).astype(real)
        x, y, status = instance.step(u)
        machine.step(u)
        if x.tobytes() != machine.x.tobytes() or y.tobytes() != machine.y.tobytes():
            return f"sample {k}, status {status:#x}: C {x} {y}, evaluated {machine.x} {machine.y}"
    return "none on another input"


def check(model: penode_gen.Model, folder: Path, reals: Sequence[type] = tuple(REALS)) -> None:
    """Known answers and C must agree, in float and in double."""
    out = folder / f"{model.path.stem}_c"
    penode_gen.generate(model, out)
    for real in reals:
        result = found(build(out, *REALS[real], model=out, name=model.name), model.name, real)
        assert result == 0, f"{real.__name__}: {result:#x}, {first_difference(model, real)}"


# -- the answers are those of the C -----------------------------------------------------------------------------------


@pytest.fixture
def short(monkeypatch):
    """40 samples instead of 200: long enough for a cubic, for both kinds of level, and for every branch of the evaluator."""
    monkeypatch.setattr(selftest, "LEVELS", 5)


def test_rich_models(tmp_path, short):
    """Each method with each interpolation: equations, laws, a network of two inputs, inside and outside of its envelope.
    Float and double in turn: each method and each interpolation in both; all in both with PENODE_LONG=1."""
    types = tuple(REALS)
    for i, (method, input, outside, activation, substeps) in enumerate(RICH):
        reals = types if "PENODE_LONG" in os.environ else [types[(i + i // len(INPUTS)) % 2]]
        check(penode_gen.load(models.rich(tmp_path, method, 5e-3, input, outside, substeps, activation, -0.3, 0.3)), tmp_path, reals)


def bare(folder: Path, sizes: list[int], activation: str, outside: str, more: str = "", low: float = -1.0) -> penode_gen.Model:
    """A network and nothing else."""
    folder.mkdir()
    models.network_file(folder / "net.json", sizes, [activation] * (len(sizes) - 2) + ["identity"], sum(sizes), low)
    names = [f"x{i}" for i in range(sizes[0])]
    text = models.BARE.format(
        outside=outside,
        inputs="\n".join(f'{n} = {{ unit = "1", min = -1, max = 1.5 }}' for n in names),
        units=["1"] * sizes[0],
        names=", ".join(names),
    )
    (folder / "bare.toml").write_text(text.replace("fade_width", f"{more}\nfade_width"))
    return penode_gen.load(folder / "bare.toml")


SHAPES = [
    ([1, 16, 16, 1], "relu", "clamp", ""),
    ([1, 16, 16, 16, 1], "relu", "fade", ""),
    ([3, 21, 10, 1], "relu", "fade", ""),
    ([1, 10, 20, 1], "tanh", "extrapolate", ""),
    ([2, 37, 4, 1], "softplus", "clamp", ""),
    ([1, 5, 1], "relu", "extrapolate", ""),
    ([1, 16, 16, 1], "relu", "extrapolate", "pieces = 64"),
    ([1, 9, 7, 1], "relu", "clamp", "pieces = 48"),
    ([1, 16, 16, 1], "relu", "clamp", 'pieces = 4\nmore_pieces = "layers"'),
    ([1, 21, 1], "relu", "clamp", 'pieces = 64\nmore_pieces = "layers"'),
]


def test_networks_of_every_shape(tmp_path, short):
    """Blocks of 16, 4 and 1 rows, one and more inputs, folded or not, also where the pieces are too many."""
    for i, (sizes, activation, outside, more) in enumerate(SHAPES):
        check(bare(tmp_path / str(i), sizes, activation, outside, more), tmp_path)


@pytest.mark.parametrize("compiler", ["gcc", "clang-19"])
def test_committed_models(tmp_path, compiler):
    """At every optimisation, in float and in double."""
    files = [*RUNTIME, *sorted(NQVM.glob("*.c"))]
    for level, (real, flags) in zip(("-O1", "-O2", "-O3"), itertools.cycle(REALS.items()), strict=False):
        options = ["-std=c99", level, *flags, "-ffp-contract=off", f"-I{ROOT}/inc", f"-I{ROOT}/port/gnu", f"-I{NQVM}", "-shared", "-fPIC"]
        subprocess.run([compiler, *options, "-o", tmp_path / f"{level}.so", *files], check=True)
        library = ctypes.CDLL(str(tmp_path / f"{level}.so"))
        assert [found(library, name, real) for name in ("nqvm", "nqvm_euler", "nqvm_folded")] == [0, 0, 0], (level, real)


def test_input_stays_in_its_range_and_reaches_the_envelope(monkeypatch):
    """Of the committed model: at least three quarters of the evaluations inside, and the damper sees most of its envelope."""
    monkeypatch.setattr(selftest, "LEVELS", 25)
    model = penode_gen.load(ROOT / "gen" / "nqvm" / "nqvm.toml")
    context = Emitter(model).context()
    chosen = selftest.model_context(context)["levels"]
    low, step = (float(chosen[0][k].removesuffix("F")) for k in ("low", "step"))
    assert low >= -0.3 and low + 255 * step <= 0.3
    machine, number, rates = Evaluator(context, np.float32), 1, []
    start = machine.x
    for level in range(selftest.LEVELS):
        machine.x = machine.x if level % 2 else start
        number = selftest.next_number(number)
        for _ in range(selftest.HOLD):
            assert machine.step(np.array([low + step * (number >> 24)]))
            rates.append(float(machine.x[2] - machine.x[3]))
    assert machine.outside <= 0.25 * machine.calls
    damper = model.sets["default"].networks["damper_net"]
    assert max(rates) - min(rates) > 0.75 * float(damper.input_max[0] - damper.input_min[0])


def test_levels_are_exact_and_inside():
    """Every level is a float and inside of the range, wherever that lies."""
    for low, high, share in [
        (-0.3, 0.3, 1.0),
        (0.0, 1e-3, 1.0),
        (273.0, 400.0, 0.125),
        (-1e6, 5.0, 1.0),
        (99.0, 99.001, 1.0),
        (-64.0, 64.0, 2.0**-11),
        (5.0, 5.0, 1.0),
        (0.0, 1e-37, 1.0),
    ]:
        v = selftest.Levels.within(low, high, share)
        values = [v.low + v.step * k for k in (0, 1, 127, 255)]
        assert all(low <= x <= high and float(np.float32(x)) == x for x in values), (low, high, values)


def test_runtime_answers_are_the_evaluated_ones():
    source = (ROOT / "src" / "pen_selftest.c").read_text()
    assert [int(x, 16) for x in re.findall(r"#define ANSWER (0x[0-9a-f]{8})U", source)] == [
        selftest.runtime_answer(r) for r in (np.float64, np.float32)
    ]


def test_a_line_that_the_evaluator_does_not_know_is_refused():
    """Never a wrong answer: what is printed differently one day stops the generator."""
    for line in ("while (x < y) {", "x = y % z;", "const float x = y;", "x = sinf(y);", "x = y", "x = (float)y;", "if (x) {", "x++;"):
        with pytest.raises(translate.Untranslated, match=re.escape(line)):
            translate.function("f", ["v_x", "v_y", "v_z"], [line], {}, np.float32)
    assert translate.expression("(pen_real_t)(1.0 / 3.0)", {}, np.float32) == np.float32(1.0 / 3.0)  # divided as doubles
    assert translate.expression("(pen_real_t)0.1 * (pen_real_t)0.2 - -(pen_real_t)3", {}, np.float32) == np.float32(0.1) * np.float32(
        0.2
    ) + np.float32(3)


# -- broken builds ----------------------------------------------------------------------------------------------------


def copy(folder: Path) -> tuple[Path, Path]:
    """Sources and model, without what prevents contraction."""
    for part in ("inc", "src"):
        shutil.copytree(ROOT / part, folder / "copy" / part)
    shutil.copytree(NQVM, folder / "copy" / "model")
    for path in (folder / "copy").rglob("*.[ch]"):
        path.write_text(re.sub(r"(?m)^ *# *pragma +(STDC +FP_CONTRACT|GCC +optimize).*$", "", path.read_text()))
    return folder / "copy", folder / "copy" / "model"


# (file, text, other text, what is reported): one weight, one constant, an order, a rounding, a table
FAULTS = {
    "a weight": ("model/nqvm_params.c", "    0.12F", None, SET),
    "a constant of the model": ("model/nqvm.c", "((pen_real_t)10000.0)", "((pen_real_t)10001.0)", ANSWER),
    "the last bit of a constant": ("model/nqvm.c", "(1.0 / 350.0)", "(1.0 / 350.00002)", ANSWER),
    "the order of a sum of the model": (
        "model/nqvm.c",
        "-(F_damper + F_damper_nn + F_spring + F_spring_nn)",
        "-(F_damper + F_spring + F_damper_nn + F_spring_nn)",
        ANSWER,
    ),
    "the order of a kernel": (
        "inc/penode/pen_net16.h",
        "for (size_t i = 0U; i < 16U; i += 2U)",
        "for (size_t i = 14U; i < 16U; i -= 2U)",
        ANSWER,
    ),
    "a layer's last row": (
        "src/pen_net.c",
        "    pen_real_t a = w[0];\n\n    for (size_t i = 0U; i < n_in; i++) {",
        "    pen_real_t a = w[0];\n\n    for (size_t i = n_in - 1U; i < n_in; i--) {",
        ANSWER,
    ),
    "a coefficient": ("src/pen_math.c", "0.16666521F", "0.1666658F", ANSWER),
    "the order of a linear solve": ("src/pen_solve.c", "sum * inverse[k - 1U]", "sum / a[((k - 1U) * n) + (k - 1U)]", ANSWER),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_changed_build_is_reported(tmp_path, fault):
    source, model = copy(tmp_path)
    file, text, other, flags = FAULTS[fault]
    path, before = source / file, (source / file).read_text()
    if other is None:  # the first weight of a layer, its last digit
        text = re.search(r"\b0\.\d{6,}F", before)[0]
        other = text[:-2] + str((int(text[-2]) + 5) % 10) + "F"
    assert text in before
    path.write_text(before.replace(text, other, 1))
    changed = {"src": path, "inc": source, "model": None}[path.relative_to(source).parts[0]]
    assert found(build(tmp_path, "-O2", model=model, changed=changed)) == flags


@pytest.mark.parametrize("real", REALS, ids=["float", "double"])
def test_another_real_type_is_reported(tmp_path, real):
    """Caller of one type, library and model of the other: nothing is written to the caller's smaller or larger instance."""
    other = REALS[np.float64 if real is np.float32 else np.float32]
    program = tmp_path / "caller.c"
    program.write_text("""
        #include <stdio.h>
        #include <string.h>
        #include "nqvm.h"
        static struct { nqvm_t model; unsigned char behind[64]; } lent;
        int main(void)
        {
            const unsigned char *byte = (const unsigned char *)&lent;
            memset(&lent, 0x5a, sizeof lent);
            printf("%u %u", (unsigned)pen_selftest(), (unsigned)nqvm_selftest(&lent.model));
            for (size_t i = 0; i < sizeof lent; i++) { if (byte[i] != 0x5a) { printf(" written"); break; } }
            return 0;
        }
    """)
    options = ["-std=c99", "-ffp-contract=off", f"-I{ROOT}/inc", f"-I{ROOT}/port/gnu", f"-I{NQVM}"]
    files = [*RUNTIME, *(NQVM / f"nqvm{end}.c" for end in ("", "_params", "_selftest"))]
    subprocess.run(["gcc", *options, *REALS[real], "-c", program, "-o", tmp_path / "caller.o"], check=True)

    def said(*library: str | Path) -> str:
        subprocess.run(["gcc", *options, "-o", tmp_path / "run", tmp_path / "caller.o", *library], check=True)
        return subprocess.run([tmp_path / "run"], capture_output=True, text=True, check=True).stdout

    assert said(*other, *files) == f"{REAL} {REAL}"
    for path in files[:-3]:  # the runtime alone is of the other type
        subprocess.run(["gcc", *options, *other, "-c", path, "-o", tmp_path / f"{path.stem}.o"], check=True)
    runtime = [tmp_path / f"{path.stem}.o" for path in files[:-3]]
    assert said(*REALS[real], *files[-3:], *runtime) == f"{REAL} {REAL}"
    assert said(*REALS[real], *files) == "0 0 written"


MAIN = """
#include "board.h"
#include "nqvm.h"
static nqvm_t model;
int main(void)
{
    board_print_number(pen_selftest());
    board_print(" ");
    board_print_number(nqvm_selftest(&model));
    return 0;
}
"""


def objects(folder: Path, machine: str, flags: list[str], source: Path = ROOT, model: Path = NQVM) -> dict[str, Path]:
    """A program that prints the flags of runtime and model, compiled for an emulated core in gcc's own dialect: object by name."""
    folder.mkdir()
    (folder / "main.c").write_text(MAIN)
    files = [
        folder / "main.c",
        *(source / "src" / path.name for path in RUNTIME),
        *(model / f"nqvm{end}.c" for end in ("", "_params", "_selftest")),
    ]
    command = [
        ROOT / "port" / "cortex-m" / "cc",
        MACHINES[machine],
        "-std=gnu17",
        "-O2",
        "-iquote",
        source / "inc",
        f"-I{model}",
        *flags,
        "-c",
    ]
    subprocess.run([*command, *files], check=True, cwd=folder)
    return {path.stem: folder / f"{path.stem}.o" for path in files}


def on_target(folder: Path, machine: str, made: dict[str, Path]) -> list[int]:
    """Flags of runtime and model on an emulated core."""
    port = ROOT / "port" / "cortex-m"
    subprocess.run([port / "cc", MACHINES[machine], "-o", folder / "main.elf", *made.values()], check=True)
    command = [port / "run", MACHINES[machine], folder / "main.elf"]
    out = subprocess.run(command, capture_output=True, text=True, check=True, env=os.environ | {"SHIFT": "none"})
    return [int(x) for x in out.stdout.split()]


def test_contraction_is_reported(tmp_path):
    """On a core that has the instruction: of everything, and of one file alone."""
    source, model = copy(tmp_path)
    off = objects(tmp_path / "off", "m4f", [], source, model)
    fast = objects(tmp_path / "fast", "m4f", ["-ffp-contract=fast"], source, model)
    assert on_target(tmp_path, "m4f", off) == [0, 0]
    assert on_target(tmp_path, "m4f", fast) == [CONTRACTED | ANSWER] * 2
    assert on_target(tmp_path, "m4f", off | {"nqvm": fast["nqvm"]}) == [0, ANSWER]
    assert on_target(tmp_path, "m4f", off | {"nqvm_selftest": fast["nqvm_selftest"]}) == [0, CONTRACTED]
    assert on_target(tmp_path, "m4f", off | {"pen_math": fast["pen_math"]})[0] == ANSWER


def test_double_of_software_is_reported(tmp_path):
    """libgcc's for Arm does not round as IEEE 754 says, the hardware of a Cortex-M55 does (penode/pen_math.h)."""
    for machine, flags in (("m4f", ROUNDING), ("m55", 0)):
        made = objects(tmp_path / machine, machine, ["-DPEN_REAL_DOUBLE"])
        assert [f & ~ANSWER for f in on_target(tmp_path, machine, made)] == [flags] * 2
