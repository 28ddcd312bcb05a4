# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The committed networks of the nQVM against the force laws they stand for, computed by onnx.reference."""

from __future__ import annotations

import math
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import numpy_helper
from onnx.reference import ReferenceEvaluator

from penode_gen.reading.network_files import read_network

NQVM = Path(__file__).resolve().parents[2] / "gen" / "nqvm"
Law = Callable[[float], float]


def spring(s: float) -> float:
    """(c1 (s + s_u))^2 - (c1 s_u)^2 with c1 = 500, s_u = 0.03, multiplied out."""
    return 250_000.0 * s * s + 15_000.0 * s


def friction(f_brk: float, f_c: float) -> Law:
    """Stribeck, Coulomb and viscous friction as the textbooks write it, with v_brk = 0.02 m/s and 150 N s/m."""
    v_st, v_coul = 0.02 / math.sqrt(2.0), 0.002

    def law(v: float) -> float:
        stribeck = math.sqrt(2.0 * math.e) * (f_brk - f_c) * math.exp(-((v / v_st) ** 2)) * v / v_st
        return stribeck + f_c * math.tanh(v / v_coul) + 150.0 * v

    return law


CASES = {"spring": (spring, 0.08), "damper": (friction(45.0, 35.0), 1.5), "damper_altered": (friction(90.0, 70.0), 1.5)}


def forces(name: str, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Output [N] of the committed file in its own arithmetic, float32, at x [m or m/s]."""
    evaluator = ReferenceEvaluator(onnx.load(NQVM / "networks" / f"{name}.onnx"))
    return evaluator.run(None, {evaluator.input_names[0]: x.astype(np.float32)[:, np.newaxis]})[0][:, 0].astype(float)


def in_double(made: onnx.ModelProto) -> onnx.ModelProto:
    """The model with its float constants and ends as double."""
    tensors = [numpy_helper.from_array(numpy_helper.to_array(t).astype(float), t.name) for t in made.graph.initializer]
    del made.graph.initializer[:]
    made.graph.initializer.extend(tensors)
    for end in (*made.graph.input, *made.graph.output):
        end.type.tensor_type.elem_type = onnx.TensorProto.DOUBLE
    return made


def places(limit: float) -> NDArray[np.float64]:
    """Even over the range, then fine around zero: the friction turns within 2 mm/s, so 1e-5 m/s apart there."""
    return np.concatenate([np.linspace(-limit, limit, 30_001), np.linspace(-0.02, 0.02, 4_001) * limit / 1.5])


@pytest.mark.parametrize("name", CASES)
def test_network_stands_for_its_law(name: str) -> None:
    law, limit = CASES[name]
    x = places(limit).astype(np.float32).astype(float)  # what goes into the network is a float
    expected = np.array([law(v) for v in x])
    error = forces(name, x) - expected
    span = np.ptp(expected)
    # required are 1 % and 3 % of the span, and 0.5 N; the bounds are what was aimed at, the fit is five times better
    assert np.sqrt(np.mean(error[:30_001] ** 2)) <= 0.002 * span
    assert np.abs(error).max() <= 0.007 * span
    assert abs(forces(name, np.zeros(1))[0]) <= 0.05


@pytest.mark.parametrize("name", ["damper", "damper_altered"])
def test_damper_never_gives_energy_back(name: str) -> None:
    # at 50 um/s the laws give 0.9 N and 1.8 N, more than the largest error of the fit
    v = places(1.5)
    v = v[np.abs(v) >= 5e-5]
    assert (forces(name, v) * v > 0.0).all()


def test_altered_friction_is_about_twice_the_friction() -> None:
    # without the viscous part, away from the turn of the law: F_C = 70 N against 35 N; both fits are within 0.6 N there
    v = np.array([-1.0, -0.3, -0.1, 0.1, 0.3, 1.0])
    plain, altered = (np.abs(forces(name, v) - 150.0 * v) for name in ("damper", "damper_altered"))
    np.testing.assert_allclose(plain, 35.0, atol=0.6)
    np.testing.assert_allclose(altered, 70.0, atol=0.6)


@pytest.mark.parametrize("name", CASES)
def test_reader_gives_the_same_network(name: str) -> None:
    net, limit = read_network(NQVM / "networks" / f"{name}.onnx"), CASES[name][1]
    assert net.n_parameters == 593
    assert net.is_piecewise_linear
    sizes = [(1, 16), (16, 16), (16, 16), (16, 1)]
    acts = ["relu", "relu", "relu", "identity"]
    dense = tuple(("dense", act, *size) for act, size in zip(acts, sizes, strict=True))
    assert net.architecture == (("affine", "centre", 1), *dense, ("affine", "rescale", 1))
    assert (net.input_min.tolist(), net.input_max.tolist()) == ([-limit], [limit])
    x = np.linspace(-limit, limit, 2001)[:, np.newaxis]
    # The same file with its numbers in double. On a path lie some 60 roundings; the sums of absolute values, layer by
    # layer, stay below 1500 (in units of the scale, at most 2800 N): 60 * 1.1e-16 * 1500 * 2800 N.
    wide = ReferenceEvaluator(in_double(onnx.load(NQVM / "networks" / f"{name}.onnx")))
    expected = wide.run(None, {wide.input_names[0]: x})[0]
    np.testing.assert_allclose(net.evaluate(x), expected, rtol=0, atol=3e-8)


def test_fitting_twice_gives_the_same_bytes(tmp_path: Path) -> None:
    # few iterations: what could differ (order of sums, random numbers, the file format) shows in the first
    for folder in ("a", "b"):
        command = [sys.executable, NQVM / "train.py", "--iterations", "3", "--out", tmp_path / folder]
        subprocess.run(command, check=True, capture_output=True, timeout=300)
    for name in CASES:
        assert (tmp_path / "a" / f"{name}.onnx").read_bytes() == (tmp_path / "b" / f"{name}.onnx").read_bytes()
        assert (tmp_path / "a" / f"{name}.onnx").read_bytes() != (NQVM / "networks" / f"{name}.onnx").read_bytes()
