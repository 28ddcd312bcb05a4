# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""sin, cos, sqrt, log and atan: parsed, differentiated, checked for units, included where used, the same bits in NumPy."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np
import pytest
import sympy as sp
from test_selftest import check

import penode_gen
from penode_gen import units
from penode_gen.algebra import expressions as ex, functions
from penode_gen.emission.batch_c import render_batch
from penode_gen.emission.model_c import render
from penode_gen.twins.kernels import Kernels

ROOT = Path(__file__).resolve().parents[2]
MODEL = """
[model]
name = "swing"
sample_time = "2 ms"
[parameters]
w = {{ value = 40, unit = "1/s^2", tunable = true }}
[inputs]
push = {{ unit = "rad/s^2", min = -9, max = 9 }}
[states]
phi = {{ unit = "rad", start = 0.3 }}
omega = {{ unit = "rad/s" }}
[equations]
turn = "der(phi) = omega"
swing = "der(omega) = push - w*{swing}"
[outputs]
phi = {{ value = "phi", unit = "rad" }}
[sets.default]
w = "40 1/s^2"
"""


def model(folder: Path, swing: str) -> penode_gen.Model:
    (folder / "swing.toml").write_text(MODEL.format(swing=swing))
    return penode_gen.load(folder / "swing.toml")


@pytest.mark.parametrize("method", ["rk4", "ros2"])
def test_known_answers_are_those_of_the_c(tmp_path, method):
    """All five at once, in float and in double."""
    text = (ROOT / "test" / "sil" / "models" / "functions.toml").read_text()
    path = tmp_path / "functions.toml"
    path.write_text(
        text.replace('method = "ros2"', f'method = "{method}"')
        .replace(
            'height = { value = "length*(1 - cos(phi))", unit = "m" }',
            'height = { value = "length*(1 - cos(phi))", unit = "m" }\nturn = { value = "atan(omega/drag)", unit = "rad" }\n'
            'pressure = { value = "log(level/one)", unit = "1" }',
        )
        .replace('\npressure = { value = "log(level/one)", unit = "1", noise = 0.001 }', "")
    )
    check(penode_gen.load(path), tmp_path)


def test_header_is_included_only_where_a_function_is_called(tmp_path):
    include = '#include "penode/pen_elementary.h"'
    with_ = model(tmp_path, "sin(phi)")
    assert include in render(with_, False)["swing.c"] and "pen_lanes_elementary.h" in render_batch(with_).text
    without = model(tmp_path, "tanh(phi)")
    assert include not in render(without, False)["swing.c"] and "pen_lanes_elementary.h" not in render_batch(without).text


@pytest.mark.parametrize("name", functions.FUNCTIONS)
def test_derivatives_are_those_of_differences(name):
    """Central differences of 60 digits: their error is h^2 times a third derivative, some 1e-20."""
    x = ex.symbol("x")
    f = ex.parse(f"{name}(1 + x^2)", ["x"], {})
    h = sp.Rational(1, 10**10)

    def whole(v: sp.Expr) -> sp.Expr:
        return f.subs(x, v).evalf(60)

    for at in (sp.Rational(3, 10), sp.Rational(7, 4)):
        assert abs(sp.diff(f, x).subs(x, at).evalf(40) - (whole(at + h) - whole(at - h)) / (2 * h)) < 1e-17


def test_units():
    dims = {"x": "m", "A": "m^2", "phi": "deg", "t": "s"}

    def of(text: str):
        return units.dimension_of(ex.parse(text, list(dims), {}), lambda s: units.dimension(dims[s.name]))

    assert of("sqrt(A)") == units.dimension("m") and of("sqrt(x/9.81)*0 + sqrt(x)") == units.dimension("m") ** 0.5
    assert of("sin(phi)") == of("atan(x/sqrt(A))") == of("log(A/x^2)") == units.NONE
    for text in ("sin(x)", "log(t)", "atan(A)", "cos(x/t)"):
        with pytest.raises(units.UnitError, match="divide it by a parameter of that unit"):
            of(text)
    with pytest.raises(units.UnitError, match="combines"):
        of("sqrt(A) + t")


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("sqrt(-2)", "square root of -2"),
        ("log(0)", "logarithm of 0"),
        ("log(1 - 3)", "logarithm of -2"),
        ("sin()", "takes 1"),
        ("atan(x, 2)", "takes 1"),
    ],
)
def test_what_has_no_value_is_refused(text, what):
    with pytest.raises(ex.ExpressionError, match=what):
        ex.parse(text, ["x"], {})


@pytest.mark.parametrize("real", [np.float32, np.float64])
def test_numpy_has_the_bits_of_the_c(tmp_path, real):
    library = tmp_path / "elementary.so"
    sources = [ROOT / "src" / f"pen_{name}.c" for name in ("trig", "atan", "log", "root")]
    options = ["-std=c99", "-O1", f"-I{ROOT}/inc", f"-I{ROOT}/port/gnu", *(["-DPEN_REAL_DOUBLE"] if real is np.float64 else [])]
    subprocess.run(["gcc", *options, "-shared", "-fPIC", "-o", library, *sources], check=True)
    c, kernels, draw = ctypes.CDLL(str(library)), Kernels(real), np.random.default_rng(1)
    word, kind = (np.uint32, ctypes.c_float) if real is np.float32 else (np.uint64, ctypes.c_double)
    x = draw.integers(0, np.iinfo(word).max, 4000, word, endpoint=True).view(real)
    x = np.concatenate([x, draw.uniform(-9000, 9000, 4000).astype(real), np.array([0, -0.0, 1, 8192, np.inf, -np.inf, np.nan], real)])
    for name in functions.FUNCTIONS:
        function = getattr(c, f"pen_{name}")
        function.restype, function.argtypes = kind, [kind]
        expected = np.array([function(kind(v)) for v in x.tolist()], real)
        with np.errstate(all="ignore"):
            found = getattr(kernels, f"pen_{name}")(x)
        same = (found.view(word) == expected.view(word)) | (np.isnan(found) & np.isnan(expected))
        assert found.dtype == real and same.all(), (name, x[~same][:3])
