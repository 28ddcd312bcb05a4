# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A damper or a spring that the model does not have at all, in driven and in free motion."""

from __future__ import annotations

import numpy as np
import pytest
from curves import curve, integrate

import penode_gen
from penode_sil.diagnosis import diagnose
from penode_sil.diagnosis.plant.plant import places
from penode_sil.recordings.measured import load

STEP, SAMPLES, MASS, NOISE = 2e-3, 3000, 2.0, 2e-5
ELEMENTS = {
    "k": 'spring = {{ between = ["body", "ground"], law = "linear_spring", stiffness = "k" }}',
    "d": 'damper = {{ between = ["body", "ground"], law = "linear_damper", damping = "d" }}',
}
MODEL = """[model]
name = "rig"
sample_time = "2 ms"
[parameters]
m = {{ value = 2, unit = "kg", tolerance = 0.02 }}
{own} = {{ value = {value}, unit = "{unit}", tolerance = 0.03 }}
[inputs]
push = {{ unit = "N" }}
[bodies]
body = {{ mass = "m", position = "x", velocity = "speed" }}
[elements]
{element}
drive = {{ between = ["body", "ground"], law = "expression", force = "-push" }}
[outputs]
x = {{ value = "x", unit = "m" }}
[sensors]
way = {{ value = "x", unit = "m", noise = 2e-5 }}
"""


def record(path, seed, stiffness, damping, push, start):
    """A CSV of a mass on a spring and a damper, pushed by noise, or released from `start` [m]."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(SAMPLES, STEP)
    force = np.fft.irfft(np.where((f > 0.3) & (f < 8.0), np.exp(2j * np.pi * rng.random(f.size)), 0.0), SAMPLES)
    force = push * force / np.std(force) * np.minimum(np.arange(SAMPLES) * STEP, 1.0)
    drive = curve(force, STEP)
    x, _ = integrate(lambda t, x: [x[1], (drive(t) - stiffness * x[0] - damping * x[1]) / MASS], [start, 0.0], STEP, SAMPLES)
    rows = np.stack([np.arange(SAMPLES) * STEP, force, x[0] + NOISE * rng.standard_normal(SAMPLES)], axis=1)
    np.savetxt(path, rows, delimiter=",", header="time [s],push [N],way [m]", comments="", fmt="%.9g")
    return path


def diagnosed(folder, own, stiffness, damping, push=20.0, start=0.0):
    """The answer where the model has only `own`, k or d."""
    value, unit = {"k": (stiffness, "N/m"), "d": (damping, "N*s/m")}[own]
    element = ELEMENTS[own].format()
    (folder / "rig.toml").write_text(MODEL.format(own=own, value=value, unit=unit, element=element))
    model = penode_gen.load(folder / "rig.toml")
    train, holdout = (load([record(folder / f"{n}.csv", n, stiffness, damping, push, start)], model) for n in (1, 2))
    return diagnose(model, train, holdout)


@pytest.mark.parametrize("push, start", [(20.0, 0.0), (0.0, 0.03)])
def test_damping_that_the_model_lacks_is_named(tmp_path, push, start):
    """Driven, where samples show it, and in free swings, of which the model follows nothing but the beginning."""
    found = diagnosed(tmp_path, "k", 800.0, 3.0, push, start)
    (cause,) = found.causes
    low, high = cause.parameters["damping"].ci95
    assert (cause.kind, cause.where, found.verdict) == ("missing_damper", "spring", "explained")
    assert low < 3.0 < high < 1.1 * low and cause.confidence > 0.9
    assert found.gain["way"].after_rmse < 1.1 * NOISE


def test_a_stiffness_that_the_model_lacks_is_named(tmp_path):
    """Of a cable, say, that holds a carriage."""
    found = diagnosed(tmp_path, "d", 60.0, 12.0)
    (cause,) = found.causes
    assert (cause.kind, cause.where, found.verdict) == ("missing_spring", "damper", "explained")
    assert cause.parameters["stiffness"].value == pytest.approx(60.0, rel=1e-3)
    assert found.gain["way"].after_rmse < 1.1 * NOISE


@pytest.mark.parametrize("own, stiffness, damping", [("k", 800.0, 0.0), ("d", 0.0, 12.0)])
def test_nothing_is_missing_where_the_model_is_right(tmp_path, own, stiffness, damping):
    found = diagnosed(tmp_path, own, stiffness, damping)
    assert (found.verdict, found.causes) == ("no_discrepancy", ())


@pytest.mark.parametrize(
    "force, unit, lacks",
    [
        ("d*speed", "N*s/m", ("linear_spring",)),
        ("d*v_gravity", "N*s/m", ("linear_spring",)),
        ("d*x", "N/m", ("linear_damper",)),
        ("d*abs(v)*s", "N*s/m^2", ()),
    ],
)
def test_an_expression_may_be_the_line(tmp_path, force, unit, lacks):
    """Where an expression mentions position or rate, its own parameters are looked at, and no line beside it."""
    element = f'gravity = {{ between = ["body", "ground"], law = "expression", force = "{force}" }}'
    (tmp_path / "rig.toml").write_text(MODEL.format(own="d", value=1.0, unit=unit, element=element))
    assert next(p.lacks for p in places(penode_gen.load(tmp_path / "rig.toml")) if p.elements) == lacks
