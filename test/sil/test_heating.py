# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A damper whose oil thins as its work warms it, in a mass on a spring that is shaken in two bursts with a pause to cool down between."""

from __future__ import annotations

import math

import numpy as np
import pytest
from one_mass import STEP, model

import penode_gen
from penode_sil.diagnosis.plant import plant
from penode_sil.diagnosis.search import naming
from penode_sil.diagnosis.study import driven
from penode_sil.recordings.measured import load

MASS, STIFFNESS, DAMPING, SECONDS, FINE = 20.0, 5000.0, 300.0, 16.0, 10
SENSORS = """x_mass = { value = "x", unit = "m", noise = 2e-6 }
a_mass = { value = "der(v)", unit = "m/s^2", noise = 1e-2 }"""


def rig(folder, thins, seed):
    """A model, a recording, and the share of the damping that is lost at its end. Of the damping, exp(-thins) remains with each kelvin; 8 J
    warm the damper by 1 K, and 2 s cool it to half."""
    n, h = int(SECONDS / STEP) * FINE, STEP / FINE
    rng = np.random.default_rng(seed)
    t = np.arange(n) * h
    waves = sum(np.sin(w * t + p) for w, p in zip(2 * np.pi * rng.uniform(0.7, 6.0, 24), rng.uniform(0, 2 * np.pi, 24), strict=True))
    push = (waves * np.where(np.abs(t - 0.5 * SECONDS) < 0.2 * SECONDS, 12.0, 50.0)).tolist()
    x = v = warm = 0.0
    rows = []
    for i in range(n):
        damping = DAMPING * math.exp(-thins * warm)
        a = (push[i] - STIFFNESS * x - damping * v) / MASS
        if i % FINE == 0:
            rows.append((t[i], push[i], x, a))
        warm += h * (damping * v * v / 8.0 - warm * math.log(2.0) / 2.0)
        v += h * a
        x += h * v
    rows = np.array(rows) + rng.standard_normal((len(rows), 4)) * [0.0, 0.0, 2e-6, 1e-2]
    (folder / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.03, SENSORS))
    np.savetxt(folder / "r.csv", rows, "%.9g", ",", header="time [s],push [N],x_mass [m],a_mass [m/s^2]", comments="")
    known = penode_gen.load(folder / "rig.toml")
    return known, [driven.experiment(m, known) for m in load([folder / "r.csv"], known)], 1.0 - math.exp(-thins * warm)


def test_a_damper_that_its_work_warms_is_found(tmp_path, show):
    """Its size to 3 %: fitted to the share that is lost, weighted by power, the law is off by 0.018 of the damping in rms, and by 0.016 of
    the 0.65 at the end."""
    known, experiments, lost = rig(tmp_path, 0.06, 5)
    places = plant.places(known)
    fastest = plant.linearise(known, places, np.array([known.start]), experiments[0].u[:1]).fastest
    found = naming.answer(known, places, experiments, fastest, "default", lambda text: None)
    show([(c.kind, c.where, {k: (v.value, v.ci95) for k, v in c.parameters.items()}) for c in found.causes])
    (cause,) = found.causes
    assert (cause.kind, cause.where) == ("damper_fading", "damper")
    assert [p.law for t in found.terms if t.form.kind == cause.kind for p in t.form.parts] == ["heating_damper"]
    assert cause.parameters["loss"].value == pytest.approx(lost, rel=0.03)
