# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What is written where nothing has a name."""

from __future__ import annotations

import numpy as np
from curves import curve, integrate
from one_mass import STEP, model

import penode_gen
from penode_sil.diagnosis import diagnose
from penode_sil.recordings.measured import load

MASS, STIFFNESS, DAMPING, NOISE, SAMPLES = 2.0, 800.0, 12.0, 2e-5, 3000
STIFFER = 1.018  # of a stiffness known to 2 %
SENSORS = f'way = {{ value = "x", unit = "mm", noise = {1e3 * NOISE} }}'


def record(path, seed):
    """A mass on a stiffer spring, and beside what pushes it a machine that hums: 1 N at 13 Hz, which no file knows."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(SAMPLES, STEP)
    push = np.fft.irfft(np.where((f > 0.3) & (f < 8.0), np.exp(2j * np.pi * rng.random(f.size)), 0.0), SAMPLES)
    push = 30.0 * push / np.std(push) * np.minimum(np.arange(SAMPLES) * STEP, 1.0)
    drive, phase = curve(push, STEP), rng.uniform(0.0, 2.0 * np.pi)

    def rates(time, x):
        hum = np.sin(2.0 * np.pi * 13.0 * time + phase)
        return [x[1], (drive(time) + hum - STIFFER * STIFFNESS * x[0] - DAMPING * x[1]) / MASS]

    x, _ = integrate(rates, [0.0, 0.0], STEP, SAMPLES)
    rows = [np.arange(SAMPLES) * STEP, push, 1e3 * (x[0] + NOISE * rng.standard_normal(SAMPLES))]
    np.savetxt(path, np.stack(rows, axis=1), delimiter=",", header="time [s],push [N],way [mm]", comments="", fmt="%.9g")
    return path


def test_values_within_tolerances_are_written_where_they_predict_better(tmp_path):
    """A hum has no name in the catalogue; the stiffness is within its tolerance, and is no cause either."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.02, SENSORS))
    nominal = penode_gen.load(tmp_path / "rig.toml")
    train, holdout = (load([record(tmp_path / f"{n}.csv", n)], nominal) for n in (1, 2))
    found = diagnose(nominal, train, holdout, tmp_path / "out")
    written = penode_gen.load(tmp_path / "out" / "model_extended.toml")
    names = {p.name: p.value / nominal.parameters[p.name].value for p in written.parameters.values() if p.name in nominal.parameters}
    assert found.verdict == "unexplained" and any("fit best within their tolerances" in n for n in found.notes)
    assert found.gain["way"].after_rmse < 0.5 * found.gain["way"].before_rmse
    assert any(abs(x / STIFFER - 1.0) < 0.002 for x in names.values()), names
