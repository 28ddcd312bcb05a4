# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise in the record of an input, for which the model file states none, beside the same noise that drove the plant: a mass on a spring
whose foot is moved, integrated exactly from row to row by this file."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

import penode_gen
from penode_sil.diagnosis import engine
from penode_sil.diagnosis.study.input_noise import with_noise_of_inputs
from penode_sil.recordings.measured import load

RIG = """
[model]
name = "rig"
sample_time = "2 ms"
[parameters]
m = { value = 20, unit = "kg", tolerance = 0.03 }
k = { value = 20000, unit = "N/m", tolerance = 0.03 }
d = { value = 120, unit = "N*s/m", tolerance = 0.03 }
[inputs]
foot = { unit = "m" }
[bodies]
mass = { mass = "m", position = "z", velocity = "v" }
[elements]
spring = { between = ["mass", "foot"], law = "linear_spring", stiffness = "k" }
damper = { between = ["mass", "ground"], law = "linear_damper", damping = "d" }
[outputs]
z = { value = "z", unit = "m" }
[sensors]
z = { value = "z", unit = "m", noise = 2e-6 }
a = { value = "der(v)", unit = "m/s^2", noise = 0.02 }
"""
M, K, D, STEP = 20.0, 2e4, 120.0, 2e-3


def recorded(path, measured: float, drove: float, seed: int, n: int = 8000):
    """A recording in which the foot has noise of `measured` [m] in its record and of `drove` [m] in truth."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * STEP
    foot = 1.5e-3 * sum(np.sin(2 * np.pi * rng.uniform(0.7, 9.0) * t + rng.uniform(0, 2 * np.pi)) for _ in range(16))
    foot = foot + drove * rng.standard_normal(n)
    plant = signal.StateSpace([[0, 1], [-K / M, -D / M]], [[0], [K / M]], [[1, 0], [-K / M, -D / M]], [[0], [K / M]])
    y = signal.lsim(plant, foot, t)[1] + rng.standard_normal((n, 2)) * (2e-6, 0.02)
    rows = np.column_stack([t, foot + measured * rng.standard_normal(n), y])
    np.savetxt(path, rows, delimiter=",", header="time [s],foot [m],z [m],a [m/s^2]", comments="", fmt="%.9g")
    return path


@pytest.mark.parametrize(
    "measured, drove, taken", [(4e-4, 0.0, True), (0.0, 4e-4, False), (0.0, 0.0, False), (1e-5, 0.0, True), (0.0, 1e-5, False)]
)
def test_noise_of_an_input_is_distinguished_from_a_signal_by_the_sensors(tmp_path, measured, drove, taken):
    """The last two are 0.2 % of what the foot does."""
    (tmp_path / "model.toml").write_text(RIG)
    model = penode_gen.load(tmp_path / "model.toml")
    found, notes = with_noise_of_inputs(model, load([recorded(tmp_path / "r.csv", measured, drove, 3)], model), "default")
    assert (found is not model) == bool(notes) == taken
    if taken:
        assert found.inputs[0].noise == pytest.approx(measured, rel=0.05) and f"foot {found.inputs[0].noise:.3g} m;" in notes[0]


def test_nothing_is_wrong_with_a_model_whose_input_was_recorded_with_noise(tmp_path):
    (tmp_path / "model.toml").write_text(RIG)
    model = penode_gen.load(tmp_path / "model.toml")
    train, held = (load([recorded(tmp_path / f"r{seed}.csv", 1e-4, 0.0, seed, 3000)], model) for seed in (3, 4))
    found = engine.diagnose(model, train, held)
    assert found.verdict == "no_discrepancy" and not found.causes
    assert any("noise in recorded inputs" in n for n in found.notes)
