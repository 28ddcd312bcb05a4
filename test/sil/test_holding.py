# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An input that acts in steps of a slower controller: its steps for a simulation, and how a hold is distinguished from a delay."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from one_mass import STEP, model
from samples import sample
from scipy.signal import StateSpace, lsim

import penode_gen
from penode_sil.batch import Batch
from penode_sil.diagnosis.extend import applied
from penode_sil.diagnosis.plant import plant
from penode_sil.diagnosis.search import naming
from penode_sil.diagnosis.search.holding import held
from penode_sil.diagnosis.study import driven
from penode_sil.diagnosis.study.noise import Experiment
from penode_sil.recordings.measured import load

FINE, SAMPLES = 8, 4000  # steps of the plant in a sample, samples
MASS, STIFFNESS, DAMPING = 2.0, 1800.0, 6.0
SENSORS = """x_mass = { value = "x", unit = "m", noise = 1e-6 }
a_mass = { value = "der(v)", unit = "m/s^2", noise = 1e-3 }"""
MODEL = model(MASS, STIFFNESS, DAMPING, 0.02, SENSORS)


def recording(path: Path, how: str, period: float, seed: int, top: float) -> Path:
    """A rig under a random force up to `top` [Hz] that acts late, or in steps, of a period [s], or whose first sensor is late, or whose
    second has an offset; a sine in its spring and in its damper makes it a little wrong everywhere. Simulated in steps of a quarter
    millisecond, written every 2 ms."""
    rng = np.random.default_rng(seed)
    step, n = STEP / FINE, SAMPLES * FINE
    t = np.arange(n) * step
    f = np.fft.rfftfreq(n, step)
    shape = np.where((f > 0.2) & (f < top), 1.0, 0.0)
    u = np.fft.irfft(shape * np.exp(2j * np.pi * rng.random(f.size)), n)
    u *= 10.0 / np.std(u)
    late = max(round(period / step), 1)
    acts = {"delay": np.interp(t - 0.5 * period, t, u), "hold": u[np.arange(n) // late * late]}.get(how, u)
    linear = StateSpace([[0.0, 1.0], [-STIFFNESS / MASS, -DAMPING / MASS]], [[0.0], [1.0 / MASS]], [[1.0, 0.0], [0.0, 1.0]], [[0.0], [0.0]])
    waves = np.zeros(n)
    for _ in range(3):  # the waves act along the motion that they make: a fixed point
        x, v = lsim(linear, acts + waves, t, interp=False)[1].T
        waves = 0.03 * (STIFFNESS * np.std(x) * np.sin(3.0 * x / np.std(x)) + DAMPING * np.std(v) * np.sin(2.5 * v / np.std(v)))
    a = (acts + waves - STIFFNESS * x - DAMPING * v) / MASS
    if how == "sensor":
        x = np.interp(t - 0.5 * period, t, x)
    if how == "offset":
        a = a + 0.2 * np.std(a)
    noise = rng.standard_normal((2, n)) * [[1e-6], [1e-3]]
    columns = np.column_stack([t, u, x + noise[0], a + noise[1]])[::FINE]
    np.savetxt(path, columns, delimiter=",", header="time [s],push [N],x_mass [m],a_mass [m/s^2]", comments="", fmt="%.9g")
    return path


@pytest.fixture
def answer(tmp_path: Path):
    (tmp_path / "rig.toml").write_text(MODEL)
    rig = penode_gen.load(tmp_path / "rig.toml")

    def search(how: str, period: float, seed: int, top: float = 6.0) -> naming.Answer:
        (m,) = load([recording(tmp_path / "r.csv", how, period, seed, top)], rig)
        e: Experiment = driven.experiment(m, rig)
        places = plant.places(rig)
        fastest = plant.linearise(rig, places, np.array([rig.start]), e.u[:1]).fastest
        return naming.answer(rig, places, [e], fastest, "default", lambda text: None)

    return search


def test_steps_have_the_mean_of_a_hold_about_each_sample():
    u = np.sin(np.arange(40) / 5.0)
    assert np.array_equal(held(u, 1e9, 0.0), np.zeros(40))  # held from the first sample on, which is 0
    whole = held(u, 4.0, 2.0)
    for k in range(4, 36):
        about = [u[(k + x - 2) // 4 * 4 + 2] for x in (-1, 0)]  # what is held from half a sample before to half a sample after
        assert whole[k] == pytest.approx(np.mean(about), abs=1e-12)
    late = np.interp(np.arange(400) - 1.25, np.arange(400), np.arange(400.0))
    assert np.mean((held(np.arange(400.0), 2.5, 0.3) - late)[10:-10]) == pytest.approx(0.0, abs=0.02)  # later by half a period


def test_a_hold_is_named_with_its_period_and_written_down(answer, tmp_path):
    found = answer("hold", 0.0235, 1)
    (cause,) = found.causes
    assert (cause.kind, cause.where) == ("input_hold", "push")
    assert cause.parameters["period"].value == pytest.approx(
        0.0235, abs=1e-5
    )  # 8 s resolve 1/8 Hz of 43 Hz; looked at in twentieths: 3.5e-6 s
    low, high = cause.parameters["period"].ci95
    assert low < 0.0235 < high
    nominal = penode_gen.load(tmp_path / "rig.toml")
    (tmp_path / "extended.toml").write_text(applied.apply(nominal, found.found.bench, found.run, found.found.terms, set()).text)
    (held,) = penode_gen.load(tmp_path / "extended.toml").sampled
    assert (held.source, held.law, held.time) == ("push", "held", 0.024)  # the nearest whole number of samples


@pytest.mark.parametrize("top", sample((1.0, 2.0), 1.0))
def test_a_hold_of_a_slow_force(answer, top):
    """Innovations are means over about half of a period: in them a hold is hardly more than a delay."""
    (cause,) = answer("hold", 0.04325, 2, top).causes
    assert cause.kind == "input_hold" and cause.parameters["period"].value == pytest.approx(
        0.04325, abs=5e-5
    )  # looked at in steps of 8e-5 s


@pytest.mark.long
def test_a_late_sensor_is_late_in_the_extended_model(answer, tmp_path):
    found = answer("sensor", 0.0235, 1)
    (cause,) = found.causes
    assert (cause.kind, cause.where) == ("sensor_delay", "x_mass")
    rig = penode_gen.load(tmp_path / "rig.toml")
    (tmp_path / "extended.toml").write_text(applied.apply(rig, found.found.bench, found.run, found.found.terms, set()).text)
    extended = penode_gen.load(tmp_path / "extended.toml")
    record, start = found.found.bench.records[0], [found.run.value(("start", 0, i)) for i in range(2)]
    z = Batch(extended).run(record.u, x0=np.array([[*start, start[0], 0.0]])).z[0, :, 0]
    plain = replace(extended, sensors=rig.sensors)
    before = Batch(plain).run(record.u, x0=np.array([[*start, start[0], 0.0]])).z[0, :, 0]
    left, late = (np.std((record.y[:, 0] - seen)[500:]) for seen in (z, before))
    assert left < 0.3 * late


def test_an_offset_of_an_accelerometer_is_no_load(answer):
    """In metres and m/s^2 together a load, which the deflection would show, looks the same."""
    (cause,) = answer("offset", 0.0, 1).causes
    assert (cause.kind, cause.where) == ("sensor_bias", "a_mass")


def test_a_delay_is_no_hold(answer):
    (cause,) = answer("delay", 0.0235, 1).causes
    assert (cause.kind, cause.where) == ("input_delay", "push")
    assert abs(cause.parameters["delay"].value - 0.01175) < 0.03 / np.sqrt(
        STIFFNESS / MASS
    )  # what waves of 3 % do, where they go with the rate


@pytest.mark.parametrize("held", (False, True))
def test_a_controller_may_repeat_a_value(tmp_path, held):
    """A command that stays for five samples is noted only where the model file does not say that a controller holds it."""
    text = MODEL.replace('sample_time = "2 ms"', 'sample_time = "2 ms"\ninput = "held"') if held else MODEL
    (tmp_path / "rig.toml").write_text(text)
    rng = np.random.default_rng(5)
    rows = np.column_stack([np.arange(2000) * STEP, rng.standard_normal((2000, 3)) * (1.0, 1e-3, 0.1)])
    rows[700:705, 1] = rows[700, 1]
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header="time [s],push [N],x_mass [m],a_mass [m/s^2]", comments="", fmt="%.9g")
    (found,) = load([tmp_path / "r.csv"], penode_gen.load(tmp_path / "rig.toml"))
    assert ["push repeats a value" in n for n in found.quality.problems] == [True] * (not held)
