# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A damper that has lost oil, found in a mass on a spring whose damper works behind a gas of this file's own form."""

from __future__ import annotations

import json

import numpy as np
import pytest
from samples import sample

import penode_gen
from penode_sil.diagnosis.catalogue.form import Moved, Part
from penode_sil.diagnosis.plant import plant
from penode_sil.diagnosis.search import naming
from penode_sil.diagnosis.study import driven
from penode_sil.recordings.measured import load

RIG = """
[model]
name = "rig"
sample_time = "2 ms"
[parameters]
m = { value = 20, unit = "kg", tolerance = 0.03 }
k = { value = 5000, unit = "N/m", tolerance = 0.03 }
d = { value = 300, unit = "N*s/m", tolerance = 0.03 }
[inputs]
push = { unit = "N" }
[bodies]
mass = { mass = "m", position = "z", velocity = "v" }
[elements]
spring = { between = ["mass", "ground"], law = "linear_spring", stiffness = "k" }
damper = { between = ["mass", "ground"], law = "linear_damper", damping = "d" }
actuator = { between = ["mass", "ground"], law = "expression", force = "-push" }
[outputs]
z = { value = "z", unit = "m" }
[sensors]
z = { value = "z", unit = "m", noise = 2e-6 }
a = { value = "der(v)", unit = "m/s^2", noise = 0.01 }
"""


def rig(folder, gas: float, seed: int):
    """Model and recording of 8 s: the damper's piston meets gas of `gas` [m] to either side, whose spring is p/(gas - |p|)."""
    n, fine, h = 4000, 10, 2e-3
    rng = np.random.default_rng(seed)
    waves = [(w, rng.uniform(0, 2 * np.pi)) for w in 2 * np.pi * rng.uniform(0.7, 6.0, 24)]
    t = np.arange(n * fine) * h / fine
    push = (22.0 * sum(np.sin(w * t + p) for w, p in waves)).tolist()
    z = v = pressed = 0.0
    rows = []
    for i in range(n * fine):
        pull = 20.0 * pressed / (gas - abs(pressed)) if gas else 300.0 * v
        a = (push[i] - 5000.0 * z - pull) / 20.0
        if i % fine == 0:
            rows.append((t[i], push[i], z + 2e-6 * rng.standard_normal(), a + 0.01 * rng.standard_normal()))
        v += h / fine * a
        z += h / fine * v
        if gas:  # the piston moves as the force lets it, the gas takes the rest; implicit, for the gas becomes ever stiffer
            low, high = -gas, gas
            for _ in range(24):
                middle = 0.5 * (low + high)
                short = middle - pressed + h / fine * (20.0 * middle / (gas - abs(middle) + 1e-12) / 300.0 - v) > 0.0
                low, high = (low, middle) if short else (middle, high)
            pressed = 0.5 * (low + high)
    (folder / "model.toml").write_text(RIG)
    np.savetxt(folder / "train.csv", rows, delimiter=",", header="time [s],push [N],z [m],a [m/s^2]", comments="", fmt="%.9g")
    model = penode_gen.load(folder / "model.toml")
    return model, [driven.experiment(r, model) for r in load([folder / "train.csv"], model)]


@pytest.mark.parametrize("gas", sample((0.0, 1.5e-3), 0.0))  # with a gas, make test asks the command below
def test_a_damper_that_has_lost_oil_is_found(tmp_path, gas, show):
    model, experiments = rig(tmp_path, gas, 5)
    places = plant.places(model)
    fastest = plant.linearise(model, places, np.array([model.start]), experiments[0].u[:1]).fastest
    found = naming.answer(model, places, experiments, fastest, "default", lambda text: None)
    show([(c.kind, c.where, {k: v.value for k, v in c.parameters.items()}) for c in found.causes])
    assert [(c.kind, c.where) for c in found.causes] == ([("aerated_damper", "damper")] if gas else [])


@pytest.mark.long
def test_the_command_names_it_too(tmp_path, penode):
    """Four plays in series with the damper fit this motion better than its law, and follow it worse."""
    held = tmp_path / "held"
    held.mkdir()
    rig(held, 1.5e-3, 6)
    rig(tmp_path, 1.5e-3, 5)
    penode("diagnose", tmp_path / "model.toml", "--data", tmp_path / "train.csv", "--holdout", held / "train.csv", "-o", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [(c["kind"], c["where"]) for c in found["causes"]] == [("aerated_damper", "damper")]


def test_its_force_along_a_motion_is_that_of_the_law():
    """Euler steps of a twentieth of a sample differ by about half a step's change of the force: 1/20 sample of 5 rad/s is 2.5e-4 rad, times
    the stiffening of 3."""
    t = np.arange(2000) * 2e-3
    s = 0.01 * np.sin(5.0 * t)
    part = Part("aerated_damper", ("damping", "N*s/m"), {"pocket": (0.002, "m"), "rate": (0.04, "m/s")})
    along = part.along(Moved(s, 0.05 * np.cos(5.0 * t), t))
    pressed, expected = 0.0, []
    for i in range(len(t) - 1):
        for j in range(20):
            rate = 0.05 * np.cos(5.0 * (t[i] + j * 1e-4))
            slide = 0.04 * (pressed / 0.002) ** 3
            if j == 0:
                expected.append(slide - rate)
            pressed += 1e-4 * (rate - slide)
    assert np.max(np.abs(along[5:-5] - np.array(expected)[5:-4])) < 2e-3 * np.max(np.abs(expected))
