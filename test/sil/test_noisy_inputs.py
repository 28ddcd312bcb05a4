# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise in the record of an input, for which the model file states none, beside the same noise that drove the plant: a mass on a spring
whose foot is moved, integrated exactly from row to row by this file."""

from __future__ import annotations

import numpy as np
import pytest
from footed import NOISE, STEP, model, moved, tones, write

import penode_gen
from penode_sil.diagnosis import engine
from penode_sil.diagnosis.study.input_noise import with_noise_of_inputs
from penode_sil.recordings.measured import load

RIG = model(", tolerance = 0.03")


def recorded(path, measured: float, drove: float, seed: int, n: int = 8000):
    """A recording in which the foot has noise of `measured` [m] in its record and of `drove` [m] in truth."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) * STEP
    foot = tones(t, rng) + drove * rng.standard_normal(n)
    y = moved(t, foot) + rng.standard_normal((n, 2)) * NOISE
    return write(path, t, foot + measured * rng.standard_normal(n), y)


@pytest.mark.parametrize(
    "measured, drove, taken", [(4e-4, 0.0, True), (0.0, 4e-4, False), (0.0, 0.0, False), (1e-5, 0.0, True), (0.0, 1e-5, False)]
)
def test_noise_of_an_input_is_distinguished_from_a_signal_by_the_sensors(tmp_path, measured, drove, taken):
    """The last two are 0.2 % of what the foot does."""
    (tmp_path / "model.toml").write_text(RIG)
    rig = penode_gen.load(tmp_path / "model.toml")
    found, notes = with_noise_of_inputs(rig, load([recorded(tmp_path / "r.csv", measured, drove, 3)], rig), "default")
    assert (found is not rig) == bool(notes) == taken
    if taken:
        assert found.inputs[0].noise == pytest.approx(measured, rel=0.05) and f"foot {found.inputs[0].noise:.3g} m;" in notes[0]


def test_nothing_is_wrong_with_a_model_whose_input_was_recorded_with_noise(tmp_path):
    (tmp_path / "model.toml").write_text(RIG)
    rig = penode_gen.load(tmp_path / "model.toml")
    train, held = (load([recorded(tmp_path / f"r{seed}.csv", 1e-4, 0.0, seed, 3000)], rig) for seed in (3, 4))
    found = engine.diagnose(rig, train, held)
    assert found.verdict == "no_discrepancy" and not found.causes
    assert any("noise in recorded inputs" in n for n in found.notes)
