# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Actuators that are not linear: a dead zone, a saturation, a limit of the rate, against what they do by definition."""

import numpy as np
import pytest

import penode_gen
from penode_sil.batch import Batch
from penode_sil.targets import Sil

STEP = 1e-3
DRIVE = """
[model]
name = "bent"
sample_time = "1 ms"
input = "linear"
[parameters]
play = { value = 0.2, unit = "V" }
most = { value = 1.5, unit = "V" }
[inputs]
valve = { unit = "V" }
[actuators]
opened = { input = "valve", law = "dead_zone", width = "play" }
held_back = { input = "opened", law = "saturation", limit = "most" }
spool = { input = "held_back", law = "slew_limit", rate = "4 V/s", time = "2 ms" }
[parameters.k]
value = 30.0
unit = "N/V"
[bodies]
slide = { mass = "2 kg" }
[elements]
drive = { between = ["slide", "ground"], law = "expression", force = "-k*spool" }
[outputs]
opened = { value = "opened", unit = "V" }
held_back = { value = "held_back", unit = "V" }
spool = { value = "spool", unit = "V" }
[sensors]
acceleration = { value = "der(v_slide)", unit = "m/s^2" }
"""


def test_each_does_what_it_says(tmp_path):
    """Dead zone and saturation are exact. Behind the limit of the rate a ramp of 4 V/s is followed 2 ms late, a lag of 2 ms whose
    Runge-Kutta steps err by (h/T)^5/120 = 3e-4 of what changes in a step, 4 mV: 1e-5 V is ten times that; a plateau is reached to
    exp(-300)."""
    path = tmp_path / "bent.toml"
    path.write_text(DRIVE)
    model = penode_gen.load(path)
    t = np.arange(4000) * STEP
    u = np.interp(t, [0.0, 1.0, 1.0 + STEP, 2.5, 2.5 + STEP, 4.0], [0.0, 0.1, 2.0, 2.0, -0.5, -0.5])
    run = Sil(model, np.float64).run(u[:, None])
    opened = np.sign(u) * np.maximum(np.abs(u) - 0.2, 0.0)
    assert np.max(np.abs(run.y[:, 0] - opened)) < 1e-15
    assert np.max(np.abs(run.y[:, 1] - np.clip(opened, -1.5, 1.5))) < 1e-15
    spool = run.y[:, 2]
    assert np.max(np.abs(np.diff(spool))) <= 4.0 * STEP * (1.0 + 1e-12)
    rising = (t > 1.02) & (t < 1.3)
    assert np.max(np.abs(np.diff(spool[rising]) - 4.0 * STEP)) < 1e-12
    assert abs(spool[2400] - 1.5) < 1e-5 and abs(spool[-1] + 0.3) < 1e-5 and np.max(np.abs(spool[:1000])) == 0.0
    assert np.array_equal(Batch(model).run(u[:, None]).z[0], run.z)


def refused(folder, text, what):
    path = folder / "bad.toml"
    path.write_text(text)
    with pytest.raises(penode_gen.ModelError) as error:
        penode_gen.load(path)
    assert any(what in line and line.startswith(f"{path}:") for line in error.value.problems), error.value.problems


@pytest.mark.parametrize(
    "old, new, what",
    [
        ('law = "dead_zone", width = "play"', 'law = "dead_zone"', "'width' is missing"),
        ('law = "dead_zone", width = "play"', 'law = "dead_zone", width = "-1 V"', "actuators.opened.width: is below zero"),
        ('law = "dead_zone", width = "play"', 'law = "dead_zone", width = "1 m"', "V"),
        ('law = "saturation", limit = "most"', 'law = "saturation", limit = "0 V"', "actuators.held_back.limit: is not above zero"),
        ('limit = "most"', 'limit = "most", start = "1 V"', "the law 'saturation' has no start"),
        ('rate = "4 V/s", time = "2 ms"', 'rate = "4 V/s"', "'time' is missing"),
        ('rate = "4 V/s"', 'rate = "4 V"', "V/s"),
    ],
)
def test_what_is_refused_and_how_to_mend_it(tmp_path, old, new, what):
    refused(tmp_path, DRIVE.replace(old, new), what)


def test_an_element_does_not_act_on_what_has_no_rate(tmp_path):
    ram = DRIVE.replace('valve = { unit = "V" }', 'valve = { unit = "m" }').replace("V", "m")
    ram = ram.replace(
        'between = ["slide", "ground"], law = "expression", force = "-k*spool"',
        'between = ["slide", "opened"], law = "linear_spring", stiffness = "k"',
    )
    refused(tmp_path, ram, "end 'opened' is no body, point, input or ground")
