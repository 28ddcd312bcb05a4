# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The printed C: the same bytes every time, 120 columns, no warning, nothing half-written, exact literals."""

from __future__ import annotations

import itertools
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import models
import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings, strategies as st

import penode_gen
from penode_gen.algebra import expressions
from penode_gen.algebra.causalise import causalise
from penode_gen.emission import c_text, files, model_c
from penode_gen.sets import packing

ROOT = Path(__file__).resolve().parents[2]
NQVM = sorted((ROOT / "gen" / "nqvm").glob("*.toml"))
STRICT = (
    "-std=c99 -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion -Wmissing-prototypes -Wstrict-prototypes "
    "-Wfloat-equal -Wcast-qual -Wcast-align -Wundef -Wswitch-enum -Wvla -Wredundant-decls -Wwrite-strings -Werror -fsyntax-only "
    f"-ffp-contract=off -I{ROOT}/inc -I{ROOT}/port/gnu"
).split()
REALS = ([], ["-DPEN_REAL_DOUBLE", "-Wno-double-promotion"])
COMPILERS = [c for c in ("gcc", "clang-19") if shutil.which(c)]
METHODS, INPUTS, OUTSIDE, SUBSTEPS = ("euler", "heun", "rk4", "ros1", "ros2"), ("held", "linear"), ("extrapolate", "clamp", "fade"), (1, 3)


TOOLCHAINS = list(itertools.product(COMPILERS, REALS))


def complaints(folder: Path, name: str, toolchains: Sequence[tuple[str, list[str]]] = TOOLCHAINS) -> list[str]:
    """What the compilers say about the C of a model."""
    sources = sorted(map(str, folder.glob("*.c")))
    found = []
    for compiler, real in toolchains:
        result = subprocess.run([compiler, *STRICT, *real, f"-I{folder}", *sources], capture_output=True, text=True)
        found += [f"{compiler} {real}: {result.stderr[:2000]}"] if result.returncode or result.stderr else []
    return found


def every_second(things: Sequence, turn: int) -> list:
    """Half of them, the other half in the next turn; all of them for `make python-long`."""
    return list(things) if "PENODE_LONG" in os.environ else list(things)[turn % 2 :: 2]


def in_turn(k: int) -> list[tuple[str, list[str]]]:
    """One of the toolchains for model k, the next for the next one; all of them for `make python-long`."""
    return TOOLCHAINS if "PENODE_LONG" in os.environ else [TOOLCHAINS[k % len(TOOLCHAINS)]]


# -- bytes ------------------------------------------------------------------------------------------------------------


def test_the_same_bytes_in_every_process_and_folder(tmp_path):
    """Hash seeds and folders differ, bytes do not; no path but the model file's own name is printed."""
    script = "import sys, penode_gen\nfor k in (1, 3): penode_gen.generate(penode_gen.load(sys.argv[k]), sys.argv[k + 1])"
    results = []
    for seed in ("1", "4711"):
        folder = tmp_path / f"folder_of_seed_{seed}"
        folder.mkdir()
        model = models.rich(folder, "ros2", outside="fade", substeps=3)
        environment = os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": str(ROOT / "gen")}
        words = map(str, (model, folder / "rich", NQVM[0], folder / "nqvm"))
        subprocess.run([sys.executable, "-c", script, *words], check=True, env=environment)
        files = sorted(p for p in folder.rglob("*.[ch]"))
        assert len(files) == 10
        results.append({p.relative_to(folder): p.read_bytes() for p in files})
    assert results[0] == results[1]
    for text in results[0].values():
        assert b"folder_of_seed" not in text and str(ROOT).encode() not in text and b"\r" not in text


def test_provenance_names_all_files(tmp_path):
    """The digest changes with the model file and with a weight, and not with time or place."""
    first = penode_gen.load(models.rich(tmp_path)).digest
    assert penode_gen.load(models.rich(tmp_path)).digest == first
    net = tmp_path / "n2.json"
    net.write_text(net.read_text().replace('"min": [0.5]', '"min": [0.625]'))
    assert penode_gen.load(next(tmp_path.glob("rich*.toml"))).digest != first


def rendered(folder: Path) -> dict[str, dict[str, str]]:
    """The C of the committed models and of the rich model in many variants."""
    found = {path.stem: penode_gen.render(penode_gen.load(path)) for path in NQVM}
    for method, outside, activation in (("ros2", "fade", "tanh"), ("ros1", "clamp", "relu"), ("heun", "extrapolate", "sigmoid")):
        found[method] = penode_gen.render(penode_gen.load(models.rich(folder, method, outside=outside, substeps=3, activation=activation)))
    return found


def test_lines_fit(tmp_path):
    """120 columns, no blanks at the end, no tabs, one newline at the end."""
    for name, made in rendered(tmp_path).items():
        for file, text in made.items():
            long = [f"{name} {file}:{i}: {line}" for i, line in enumerate(text.split("\n"), 1) if len(line) > 120]
            assert not long
            assert not re.search(r"[ \t]$|\t", text, re.MULTILINE) and text.endswith("\n") and not text.endswith("\n\n")


@pytest.mark.parametrize(
    "line",
    [
        "    const pen_real_t a = " + " + ".join(f"(word{i} * word{i})" for i in range(12)) + "; /* a remark that goes above */",
        "    f(" + ", ".join(f"argument_{i}" for i in range(20)) + ");",
        "/* " + "word " * 40 + "*/",
        "/** " + "word " * 40 + "*/",
        "#define A_CONSTANT 1.0F /* " + "word " * 30 + "*/",
        "    " + ", ".join(["-0.123456789F"] * 12) + ",",
        "x = " + "a" * 150 + ";",  # cannot be broken
    ],
)
def test_folded_lines_read_the_same(line):
    """Only white space changes, and the place of a remark; comments stay comments."""
    folded = c_text.fold(line)
    assert all(len(part) <= 120 for part in folded.split("\n")) or "a" * 150 in line

    def words(text: str, comment: bool) -> list[str]:
        remarks = "".join(re.findall(r"/\*.*?\*/", text, re.DOTALL))
        return (
            re.sub(r"/\*\*?|\*/|^ \* ", " ", remarks, flags=re.MULTILINE).split()
            if comment
            else re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL).split()
        )

    assert words(folded, True) == words(line, True) and words(folded, False) == words(line, False)


# -- compilers --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("method", METHODS)
def test_no_warnings(tmp_path, method):
    """All policies, inputs and substeps, of one method or the next. Of one method each takes its turn in float and double, by every
    compiler that is installed; the next method begins with the next of these."""
    assert COMPILERS
    folders = []
    turn = METHODS.index(method)
    curved = [("parabola", "clamp", 1), ("parabola", "fade", 3), ("cubic", "clamp", 3)]
    for input, outside, substeps in [*every_second([*itertools.product(INPUTS, OUTSIDE, SUBSTEPS)], turn), *curved]:
        model = penode_gen.load(models.rich(tmp_path, method, input=input, outside=outside, substeps=substeps))
        folders.append(tmp_path / f"{input}_{outside}_{substeps}")
        penode_gen.generate(model, folders[-1])
    with ThreadPoolExecutor(2) as pool:
        assert not [
            c for found in pool.map(lambda k: complaints(folders[k], "rich", in_turn(turn + k)), range(len(folders))) for c in found
        ]


SPARSE = {
    "constant rate": ("der(T)*t = 1", "T"),
    "input only": ("der(T)*t = u", "u"),
    "state only": ("der(T)*t = -T", "2*T + 1"),
    "tunable": ("der(T)*t = k*T", "k"),
    "constant output": ("der(T)*t = T", "0.5"),
    "network of state": ("der(T)*t = n(T)", "T"),
    "network of input": ("der(T)*t = n(u)", "u*T"),
    "network of a parameter": ("der(T)*t = n(k)*T", "T"),
    "network of a constant": ("der(T)*t = n(c)*n(1)*T", "T"),
    "kinks": ("der(T)*t = abs(max(T, u)) + min(T, 0)", "sign(T)"),
    "branches": ("der(T)*t = where(T < u, T*u, T - u)", "where(T < u, T, u)"),
    "curved": ("der(T)*t = exp(T*u) + tanh(T)*softplus(u)*sigmoid(T)", "T^2*u"),
    "names": ("der(T)*t = x*p*u*h + status", "x + y + fx + node + rates + t1"),
}


@pytest.mark.parametrize("method", METHODS)
def test_no_warnings_where_little_is_used(tmp_path, method):
    """Models that need only some of state, input, parameters and networks leave nothing unused; any name is fine. Each in one method or
    the next."""
    models.network_file(tmp_path / "n.json", [1, 4, 1], ["tanh", "identity"], 2)
    folders = []
    curved = [*itertools.product(("constant rate", "input only", "state only"), ["parabola", "cubic"])]
    turn = METHODS.index(method)
    straight = [(n, INPUTS[(i // 2 + turn // 2) % 2]) for i, n in enumerate(SPARSE)]  # two methods on with the other input
    for name, input in every_second([*straight, *curved], turn):
        equation, output = SPARSE[name]
        own = (
            "".join(f'{n} = {{ unit = "1" }}\n' for n in ("x", "y", "p", "fx", "node", "rates", "status", "h", "t1"))
            if name == "names"
            else ""
        )
        equations = "".join(f'e{i} = "{n} = {i}*T"\n' for i, n in enumerate(re.findall(r"^\w+", own, re.MULTILINE)))
        path = tmp_path / "sparse.toml"
        path.write_text(f"""
[model]
name = "sparse"
sample_time = "1 ms"
method = "{method}"
input = "{input}"
[parameters]
t = {{ value = 1, unit = "s" }}
k = {{ value = 3, unit = "1", tunable = true }}
c = {{ value = 2, unit = "1" }}
[inputs]
u = {{ unit = "1" }}
[states]
T = {{ unit = "1" }}
[variables]
{own}
[equations]
only = "{equation}"
{equations}
[networks]
n = {{ inputs = ["1"], output = "1" }}
[outputs]
out = {{ value = "{output}", unit = "1" }}
[sets.default]
n = "n.json"
""")
        folders.append(tmp_path / f"{name} {input}".replace(" ", "_"))
        penode_gen.generate(penode_gen.load(path), folders[-1])
    with ThreadPoolExecutor(2) as pool:
        assert not [
            c for found in pool.map(lambda f: complaints(f, "sparse", [(compiler, []) for compiler in COMPILERS]), folders) for c in found
        ]


def test_another_abi_is_refused_at_compile_time(tmp_path, monkeypatch):
    """A model printed for another runtime does not compile, and says why."""
    monkeypatch.setattr(packing, "ABI", packing.ABI + 1)
    penode_gen.generate(penode_gen.load(models.rich(tmp_path)), tmp_path / "c")
    said = complaints(tmp_path / "c", "rich")
    assert len(said) == 2 * len(COMPILERS)
    assert all(f"rich was generated for runtime ABI {packing.ABI}: generate it again" in text for text in said)


# -- files ------------------------------------------------------------------------------------------------------------


def test_all_files_or_none(tmp_path, monkeypatch):
    model = penode_gen.load(models.rich(tmp_path))
    out = tmp_path / "out"
    out.mkdir()
    (out / "rich.h").write_text("old")

    (out / "rich_params.c").mkdir()  # one of them cannot be written
    with pytest.raises(OSError, match=r"rich_params\.c"):
        penode_gen.generate(model, out)
    (out / "rich_params.c").rmdir()

    count = itertools.count()

    def full(*args: object) -> None:
        if next(count) == 2:
            raise OSError(28, "No space left on device", "rich_params.c")

    with monkeypatch.context() as patch, pytest.raises(OSError, match="No space left"):
        patch.setattr(files.os, "chmod", full)
        penode_gen.generate(model, out)
    assert [p.name for p in out.iterdir()] == ["rich.h"] and (out / "rich.h").read_text() == "old"

    with pytest.raises(OSError):
        penode_gen.generate(model, tmp_path / "n2.json" / "below a file")
    assert [p.name for p in penode_gen.generate(model, out)] == [
        "rich.h",
        "rich.c",
        "rich_sets.h",
        "rich_params.c",
        "rich_selftest.c",
        "rich_layout.json",
    ]
    assert sorted(p.name for p in out.iterdir()) == sorted(
        ["rich.c", "rich.h", "rich_sets.h", "rich_params.c", "rich_selftest.c", "rich_layout.json"]
    )
    assert all(p.stat().st_mode & 0o777 == 0o644 for p in out.iterdir())


@pytest.mark.parametrize("where", ["n2.json/c", "taken", "no/such/folder", "blocked"])
def test_command_names_the_place_that_it_cannot_write(tmp_path, monkeypatch, capsys, where):
    from penode_sil import cli

    path = models.rich(tmp_path)
    (tmp_path / "taken").write_text("")
    (tmp_path / "blocked" / "rich.c").mkdir(parents=True)
    monkeypatch.setattr(sys, "argv", ["penode", "generate", str(path), "-o", str(tmp_path / where)])
    with pytest.raises(SystemExit) as caught:
        cli.main()
    output = capsys.readouterr()
    assert caught.value.code == 2 and output.out == "" and len(output.err.splitlines()) == 1
    assert output.err.startswith(f"penode: {tmp_path}") and "; " in output.err
    assert [p.name for p in (tmp_path / "blocked").iterdir()] == ["rich.c"]


# -- numbers ----------------------------------------------------------------------------------------------------------

LITERAL = re.compile(r"(\(pen_real_t\))?(-?\d+(\.\d+|\.\d+e-?\d+|e-?\d+))(F?)")


def value_of(text: str) -> float:
    """What C makes of a literal, in double: an F rounds to float, a cast leaves the double."""
    cast, digits, _, suffix = LITERAL.fullmatch(text).groups()
    assert bool(cast) != bool(suffix)
    return float(np.float32(digits)) if suffix else float(digits)


@settings(derandomize=True, deadline=None, database=None, max_examples=500)
@given(
    st.one_of(
        st.floats(allow_nan=False, allow_infinity=False),
        st.floats(width=32, allow_nan=False, allow_infinity=False),
        st.integers(-(10**9), 10**9),
    )
)
def test_literals_are_exact(value):
    """The double comes back to the bit (a zero may lose its sign), and F stands only where a float holds it all."""
    for text in (c_text.literal(value), c_text.real(value)):
        assert value_of(text) == float(value)
    with np.errstate(over="ignore"):
        assert c_text.literal(value).endswith("F") == (float(np.float32(value)) == float(value))


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_no_literal_for_what_is_no_number(value):
    with pytest.raises(ValueError, match="has no C literal"):
        c_text.literal(value)
    with pytest.raises(ValueError, match="has no C literal"):
        c_text.literals([0.5, value])


def test_literals_of_an_array_are_those_of_its_numbers():
    """Drawn bits of both types, with powers of ten (where the notation changes), zeros and their neighbours."""
    rng = np.random.default_rng(1)
    powers = np.array([0.0, *(10.0**k for k in range(-9, 10))])
    singles = powers.astype(np.float32)
    near = np.concatenate(
        [
            f(p, edge).astype(float)
            for p in (powers, singles)
            for f, edge in ((np.nextafter, p.dtype.type(0)), (np.nextafter, p.dtype.type(np.inf)), (np.fmax, p))
        ]
    )
    with np.errstate(invalid="ignore"):
        bits = rng.integers(0, 2**32, 2000, np.uint32).view(np.float32).astype(float)
    drawn = np.concatenate([bits, rng.integers(0, 2**63, 1000).view(float), rng.standard_normal(500)])
    values = np.concatenate([near, -near, drawn[np.isfinite(drawn)]])
    assert c_text.literals(values) == [c_text.literal(v) for v in values]


def test_weights_arrive_in_c_as_they_were(tmp_path):
    """All values of all sets read back from the text; the checksum printed is theirs."""
    model = penode_gen.load(NQVM[0])
    text = penode_gen.render(model)[f"{model.name}_params.c"]
    for name in model.sets:
        body = re.search(rf"value_{name}\[.*?\] = \{{(.*?)\}};", text, re.DOTALL)[1]
        printed = [value_of(v.strip()) for v in re.sub(r"/\*.*?\*/", "", body, flags=re.DOTALL).split(",") if v.strip()]
        assert np.array_equal(np.array(printed), penode_gen.set_values(model, name, np.float64))
        assert f"CHECKSUM_{name.upper()} 0x{penode_gen.set_head(model, name)[3]:08x}U" in text


def test_every_expression_is_evaluated_correctly(tmp_path):
    """The printer's text, read back by Python as C would read it, is the expression: precedence, signs, divisions."""
    a, b, c = (sp.Symbol(n, real=True) for n in "abc")
    cases = [
        a - (b - c),
        a - (b + c),
        -(a + b),
        -a * b,
        a / (b * c),
        a / b / c,
        a / (b / c),
        1 / a,
        a**-2,
        (a + b) ** 2,
        -(a**2),
        (-a) ** 3,
        2 * a / 3,
        sp.Rational(1, 3) * a,
        a * (b + c) / (a - b),
        -a / b,
        -(a - b) / c,
        a - b * c + 1,
        sp.Max(a, b, c),
        sp.Min(a, -b),
        expressions.Absolute(a - b),
        sp.Piecewise((a, a < b), (b, True)) * c - 1,
        sp.Piecewise((a, b < 0), (sp.Piecewise((b, a >= 1), (c, True)), True)),
        a * sp.Float("1e-9"),
        a - sp.Float(-2.5),
        -sp.exp(-a) * sp.tanh(-b),
        (a / b) ** 3,
        a / (2 * b),
        3 / (a + 1) ** 2,
    ]
    scope = {
        "pen_max": max,
        "pen_min": min,
        "pen_port_abs": abs,
        "pen_exp": np.exp,
        "pen_tanh": np.tanh,
        "pen_where": lambda c, x, y: x if c else y,
    }
    draw = np.random.default_rng(1)
    for expr in cases:
        text = c_text.Printer(lambda s: s.name)(expr)
        python = text.replace("(pen_real_t)", "")
        for values in draw.normal(size=(5, 3)):
            names = dict(zip("abc", values, strict=True))
            expected = float(expr.subs({a: names["a"], b: names["b"], c: names["c"]}))
            np.testing.assert_allclose(eval(python, scope, names), expected, rtol=1e-12, atol=1e-12)  # a few roundings, some cancellation


def test_steps_come_in_the_order_in_which_they_are_needed(tmp_path):
    """No step reads what a later one computes."""
    causal = causalise(penode_gen.load(models.rich(tmp_path)))
    known = {*causal.states, *causal.inputs, *causal.input_rates, *(sp.Symbol(n, real=True) for n in causal.model.parameters)}
    for step in causal.steps:
        assert step.reads <= known
        known.add(step.target)
    assert set().union(*(r.free_symbols for r in causal.rates)) <= known


# -- all files or none, one version -----------------------------------------------------------------------------------


@pytest.mark.parametrize("failing", [0, 1, 2, 3])
@pytest.mark.parametrize("earlier", [True, False])
def test_a_file_that_cannot_be_replaced_leaves_all_as_they_were(tmp_path, monkeypatch, failing, earlier):
    model = penode_gen.load(NQVM[0])
    names = list(model_c.render(model))
    if earlier:
        for name in names:
            (tmp_path / name).write_text(f"earlier {name}")
    replace, calls = os.replace, itertools.count()

    def fail(source, target):
        if next(calls) == failing:
            raise OSError("disk")
        replace(source, target)

    monkeypatch.setattr(os, "replace", fail)
    with pytest.raises(OSError, match="disk"):
        penode_gen.generate(model, tmp_path)
    kept = {path.name: path.read_text() for path in tmp_path.iterdir()}
    assert kept == ({name: f"earlier {name}" for name in names} if earlier else {})


def test_one_version_and_one_abi_everywhere():
    header = (ROOT / "inc" / "penode" / "pen_real.h").read_text()
    assert re.search(r'#define PEN_VERSION +"(.*)"', header)[1] == penode_gen.VERSION
    assert int(re.search(r"#define PEN_ABI +(\d+)", header)[1]) == packing.ABI


def test_names_that_look_like_those_of_the_generated_code(tmp_path):
    """Elements called net, net_1, net_in, net_slope: a network of two inputs among them."""
    text = (
        models.RICH.format(method="rk4", h=1e-3, input="held", outside="extrapolate", substeps=1, foot_damper="")
        .replace(
            "net = { between",
            'net_1 = { between = ["mass", "ground"], law = "network", network = "n1" }\n'
            'net_in = { between = ["mass", "ground"], law = "linear_spring", stiffness = "k" }\n'
            'net_slope = { between = ["mass", "ground"], law = "linear_damper", damping = "3 N*s/m" }\n'
            "net = { between",
        )
        .replace('output = "N" }\n', 'output = "N" }\nn1 = { inputs = ["m"], output = "N" }\n', 1)
        .replace('n2 = "n2.json"', 'n2 = "n2.json"\nn1 = "n1.json"')
    )
    models.network_file(tmp_path / "n2.json", [2, 5, 1], ["tanh", "identity"], 5)
    models.network_file(tmp_path / "n1.json", [1, 5, 1], ["relu", "identity"], 6)
    (tmp_path / "names.toml").write_text(text)
    made = penode_gen.load(tmp_path / "names.toml")
    folder = tmp_path / "c"
    penode_gen.generate(made, folder)
    assert complaints(folder, "rich") == []


@pytest.mark.parametrize("more", ["refuse", "layers"])
def test_no_warnings_when_folded(tmp_path, more):
    """Every method of the quarter vehicle, folded."""
    base = ROOT / "gen" / "nqvm" / "nqvm.toml"
    for method in METHODS:
        path = tmp_path / f"{method}.toml"
        path.write_text(
            f'[model]\nextends = "{os.path.relpath(base, tmp_path)}"\nname = "{method}"\n'
            f'method = "{method}"\npieces = 96\nmore_pieces = "{more}"\n'
        )
        penode_gen.generate(penode_gen.load(path), tmp_path / method)
        assert complaints(tmp_path / method, method) == []
