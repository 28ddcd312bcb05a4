# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Actuators that are not linear: a dead zone, a saturation, a limit of the rate, against what they do by definition."""

import numpy as np
import pytest
from test_selftest import check

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
spool = { input = "valve", law = "slew_limit", rate = "4 V/s" }
opened = { input = "spool", law = "dead_zone", width = "play" }
held_back = { input = "opened", law = "saturation", limit = "most" }
[parameters.k]
value = 30.0
unit = "N/V"
[bodies]
slide = { mass = "2 kg" }
[elements]
drive = { between = ["slide", "ground"], law = "expression", force = "-k*held_back" }
[outputs]
opened = { value = "opened", unit = "V" }
held_back = { value = "held_back", unit = "V" }
spool = { value = "spool", unit = "V" }
[sensors]
acceleration = { value = "der(v_slide)", unit = "m/s^2" }
"""


def test_each_call_does_as_documented(tmp_path):
    """Exactly: each is a sum and a choice. A sample that is not finite is not received: the limiter goes on from what it gave before."""
    path = tmp_path / "bent.toml"
    path.write_text(DRIVE)
    model = penode_gen.load(path)
    t = np.arange(4000) * STEP
    u = np.interp(t, [0.0, 1.0, 1.0 + STEP, 2.5, 2.5 + STEP, 4.0], [0.0, 0.1, 2.0, 2.0, -0.5, -0.5])
    spool = [u[0]]
    for x in u[1:]:
        spool.append(spool[-1] + np.clip(x - spool[-1], -4.0 * STEP, 4.0 * STEP))
    opened = np.sign(spool) * np.maximum(np.abs(spool) - 0.2, 0.0)
    run = Sil(model, np.float64).run(u[:, None])
    assert np.max(np.abs(run.y[:, 2] - spool)) < 1e-15 and abs(run.y[1450, 2] - 1.9) < 1e-3
    assert np.max(np.abs(run.y[:, 0] - opened)) < 1e-15
    assert np.max(np.abs(run.y[:, 1] - np.clip(opened, -1.5, 1.5))) < 1e-15
    assert np.array_equal(Batch(model).run(u[:, None]).z[0], run.z)
    gap = np.where(np.arange(4000) == 1100, np.nan, u)
    lost = Sil(model, np.float64).run(gap[:, None])
    assert lost.y[1101, 2] == run.y[1100, 2] and np.array_equal(np.delete(lost.y, 1100, 0)[:1100], run.y[:1100])


def test_the_self_test_has_them(tmp_path):
    """Its answers come from an implementation of its own, in Python; the C gives the same, to the bit."""
    path = tmp_path / "bent.toml"
    path.write_text(DRIVE)
    check(penode_gen.load(path), tmp_path)


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
        (', rate = "4 V/s"', "", "'rate' is missing"),
        ('rate = "4 V/s"', 'rate = "-4 V/s"', "actuators.spool.rate: is not above zero"),
        ('input = "valve", law = "slew_limit"', 'input = "held_back", law = "slew_limit"', "'held_back' is no input or earlier actuator"),
        ('rate = "4 V/s"', 'rate = "4 V"', "V/s"),
    ],
)
def test_what_is_refused_and_how_to_mend_it(tmp_path, old, new, what):
    refused(tmp_path, DRIVE.replace(old, new), what)


def test_an_element_does_not_act_on_what_has_no_rate(tmp_path):
    ram = DRIVE.replace('valve = { unit = "V" }', 'valve = { unit = "m" }').replace("V", "m")
    ram = ram.replace(
        'between = ["slide", "ground"], law = "expression", force = "-k*held_back"',
        'between = ["slide", "opened"], law = "linear_spring", stiffness = "k"',
    )
    refused(tmp_path, ram, "end 'opened' is no body, point, input or ground")
