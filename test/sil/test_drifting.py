# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A force and its sensors recorded by two clocks, one of which runs slow or fast: tones, of which each clock gives its own times."""

from __future__ import annotations

import numpy as np
import pytest
from one_mass import STEP, model
from samples import sample
from scipy.signal import StateSpace, lsim

import penode_gen
from penode_sil.diagnosis.extend import applied
from penode_sil.diagnosis.plant import plant
from penode_sil.diagnosis.search import naming
from penode_sil.diagnosis.study import driven
from penode_sil.recordings.measured import load

MASS, STIFFNESS, DAMPING, SECONDS, FINE = 2.0, 1800.0, 20.0, 12.0, 4
SENSORS = """x_mass = { value = "x", unit = "m", noise = 1e-5 }
a_mass = { value = "der(v)", unit = "m/s^2", noise = 2e-2 }"""


def answer(folder, slow, late, seed):
    """What innovations find in a recording whose force has the times of a clock that runs slow by a share, and is `late` [s]."""
    t = np.arange(int(SECONDS / STEP) * FINE) * STEP / FINE
    rng = np.random.default_rng(seed)
    tones, phases = rng.uniform(0.4, 8.0, (40, 1)), rng.uniform(0.0, 2.0 * np.pi, (40, 1))

    def force(time):
        return 4.0 * np.sum(np.sin(2.0 * np.pi * tones * time + phases), axis=0)

    acts, written = force(t - late), force(t[::FINE] / (1.0 - slow))  # it records the force at that time
    rates = [[0.0, 1.0], [-STIFFNESS / MASS, -DAMPING / MASS]]
    x, v = lsim(StateSpace(rates, [[0.0], [1.0 / MASS]], np.eye(2), np.zeros((2, 1))), acts, t)[1].T
    a = (acts - STIFFNESS * x - DAMPING * v) / MASS
    seen = np.column_stack([x, a])[::FINE] + rng.standard_normal((len(written), 2)) * [1e-5, 2e-2]
    (folder / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.03, SENSORS))
    table = np.column_stack([t[::FINE], written, seen])
    np.savetxt(folder / "r.csv", table, "%.9g", ",", header="time [s],push [N],x_mass [m],a_mass [m/s^2]", comments="")
    known = penode_gen.load(folder / "rig.toml")
    experiments = [driven.experiment(m, known) for m in load([folder / "r.csv"], known)]
    places = plant.places(known)
    fastest = plant.linearise(known, places, np.array([known.start]), experiments[0].u[:1]).fastest
    return known, naming.answer(known, places, experiments, fastest, "default", lambda text: None)


@pytest.mark.parametrize("slow", sample([2e-3, -2e-3], 2e-3))
def test_a_clock_that_drifts_is_named(tmp_path, slow, show):
    """Its size to 0.2 %: what is late by a hundredth of a sample throughout adds 1.5 * 2e-5 s / 12 s to the slope through zero, 0.13 % of
    it. The model file has no law for a drift."""
    known, found = answer(tmp_path, slow, 0.0, 1)
    show([(c.kind, c.where, {k: (v.value, v.ci95) for k, v in c.parameters.items()}) for c in found.causes])
    (cause,) = found.causes
    assert (cause.kind, cause.where) == ("input_drift", "push")
    assert cause.parameters["drift"].value == pytest.approx(slow, rel=2e-3)
    made = applied.apply(known, found.found.bench, found.run, found.found.terms, set())
    assert [n for n in made.left if "a recording has to be corrected" in n]


def test_a_delay_is_no_drift(tmp_path):
    _, found = answer(tmp_path, 0.0, 0.012, 2)
    assert [(c.kind, c.where) for c in found.causes] == [("input_delay", "push")]
