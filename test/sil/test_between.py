# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Inputs between samples, the noise of samples, an observer on some samples, and sensors with scales and limits."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from scipy import signal
from test_innovations import swing

import penode_gen
from penode_gen.model import Parameter
from penode_sil.batch import Batch, Observer
from penode_sil.diagnosis.catalogue import others
from penode_sil.diagnosis.catalogue.actuators import lagging
from penode_sil.diagnosis.catalogue.form import Form, Part
from penode_sil.diagnosis.evidence import gain, samples
from penode_sil.diagnosis.evidence.fit import Fit
from penode_sil.diagnosis.evidence.observer import Filter, Predictor, Record, alike, augmented, scale
from penode_sil.diagnosis.extend import applied
from penode_sil.diagnosis.plant.between import finer, joined, parts, straight
from penode_sil.diagnosis.search import adopting, clipping
from penode_sil.diagnosis.search.terms import Term
from penode_sil.diagnosis.study.fit import Free

STEP = 2e-3
TIME = np.arange(400) * STEP


@pytest.mark.parametrize("count", (2, 3))
def test_samples_and_integrals_stay(count):
    """A wave of four samples a period away from its ends: the polygon has its samples, and its integral over each interval to twice
    (1/3)^8 of the amplitude, the image in a spline of degree 7 and what the wave itself lacks for it; of three parts the last line has the
    rate of the wave."""
    w = 2.0 * math.pi / (4.0 * STEP)
    wave, rate = np.sin(w * TIME + 0.3)[:, None], w * np.cos(w * TIME + 0.3)[:, None]
    split = parts(TIME, wave, rate, count)
    line = joined(split, wave)[:, 0]
    assert np.array_equal(line[::count], wave[:, 0])
    true = -np.diff(np.cos(w * TIME + 0.3)) / w
    trapezes = 0.5 * (line[1:] + line[:-1]).reshape(-1, count).sum(axis=1) * STEP / count
    assert np.max(np.abs(trapezes - true)[20:-20]) < 2.0 * 3.0**-8 * STEP
    if count == 3:
        assert np.allclose((wave[1:, 0] - split[:, 2, 0]) / (STEP / 3.0), rate[1:, 0], rtol=1e-9)


def test_many_runs_are_joined_as_one():
    runs = np.random.default_rng(3).standard_normal((5, 400, 2))
    many = joined(parts(TIME, runs, runs, 2), runs)
    assert many.shape == (5, 799, 2)
    assert np.allclose(many[3], joined(parts(TIME, runs[3], runs[3], 2), runs[3]), rtol=1e-12, atol=1e-12)


def test_what_has_edges_stays_on_straight_lines():
    edge = np.repeat([0.0, 1.0], 200)[:, None]
    line = joined(straight(edge, 2), edge)[:, 0]
    assert np.max(line) == 1.0 and np.min(line) == 0.0 and line[399] == 0.5


def test_noise_of_an_input_is_not_louder_at_its_ends():
    """Of white noise the middles have no more than 2 deviations in rms at the ends, as inside; a spline without ends turned round had 6."""
    noise = np.random.default_rng(5).standard_normal((4000, 40, 1))
    middles = parts(np.arange(40) * STEP, noise, noise, 2)[:, :, 1, 0]
    assert np.all(np.sqrt(np.mean(middles**2, axis=0)) < 2.0)


def test_noise_beside_a_motion_of_nine_samples_a_period():
    """White noise of 1e-3 of the motion. 186 spectra half over one another, four bins each: the quietest of five bands is low by less than
    10 %, and the motion, 92 dB down, is 2.5e-5 of itself there."""
    rng = np.random.default_rng(4)
    y = np.sin(2.0 * math.pi * np.arange(6000) / 9.0) + 1e-3 * rng.standard_normal(6000)
    assert abs(samples.shown([y]) / 1e-3 - 1.0) < 0.1
    y[::50] = np.nan  # no 64 in a row: second differences show the motion
    assert samples.shown([y]) > 0.1
    assert samples.shown([np.full(100, np.nan)]) == 0.0


def test_noise_that_is_low_passed_or_seldom_is_not_lost():
    """What a file states holds unless neighbours are nearer; of what is resampled to 0.4 of the rate more than half of the noise is seen,
    for the last band, 0.375 to 0.44, lies across that; of a slow sensor, whose samples have no neighbours, the file's word counts."""
    white = np.random.default_rng(6).standard_normal(20000)
    low = signal.filtfilt(*signal.butter(8, 0.8), white)
    assert 0.5 < samples.noise([[low]], np.zeros(1))[0] < 1.05
    assert samples.noise([[white]], np.array([0.5]))[0] == 0.5
    assert abs(samples.noise([[white]], np.array([3.0]))[0] - 1.0) < 0.03
    seldom = np.where(np.arange(20000) % 5, np.nan, white)
    assert samples.noise([[seldom]], np.array([0.1]))[0] == 0.1


def test_an_observer_counts_the_samples_that_are_kept(tmp_path):
    """Two steps of half a sample, of which one is kept, and two substeps of a whole one: the same but for rounding."""
    model, (e,) = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)
    follow, n = np.array([[0.3], [2.0]]), len(e.u)
    whole = Batch(replace(model, substeps=2)).run(e.u, observer=Observer(4, e.y, follow))
    between = np.interp(np.arange(2 * n - 1) / 2.0, np.arange(n), e.u[:, 0])[:, None]
    halves = Batch(replace(model, sample_time=0.5 * model.sample_time)).run(between, observer=Observer(4, e.y, follow), every=2)
    assert halves.z.shape == whole.z.shape
    assert np.max(np.abs(halves.z - whole.z)) < 1e-13
    assert np.max(np.abs(whole.z - Batch(replace(model, substeps=2)).run(e.u).z)) > 1e-6  # it does follow
    with pytest.raises(ValueError, match=r"must be \[kept, n_z\] = \[100, 1\]"):
        Batch(replace(model, sample_time=0.5 * model.sample_time)).run(
            between, observer=Observer(4, np.zeros((2 * n - 1, 1)), follow), every=2
        )


def test_a_scale_of_a_sensor_does_not_tune_the_filter(tmp_path):
    """Twice as large a measurement of a sensor of scale 2 has twice the innovations, whatever the gain."""
    model, (e,) = swing(tmp_path, lambda s, v: 0.02 * math.sin(9.0 * s), seconds=2.0)
    wide, by = augmented(model), Filter(np.array([[0.4], [3.0], [0.0]]), np.array([0.01]))
    twice = Free(scale("phi"), 2.0, 0.01)
    nus = []
    for y, free in ((e.y, ()), (2.0 * e.y, (twice,))):
        lanes = Predictor(wide, [Record("r", e.step, e.drive, y)], 5).predict(free, np.zeros((1, len(free))), by)[0]
        nus.append(lanes.nu[0][0])
    assert np.allclose(nus[1], 2.0 * nus[0], rtol=1e-9, atol=1e-15)


def test_a_limit_that_nothing_reaches_is_none(tmp_path):
    """And one that is reached cuts off just that."""
    model, (e,) = swing(tmp_path, lambda s, v: 0.0, seconds=2.0)
    top = float(np.max(np.abs(e.y)))
    limited, (free,) = clipping.limited(model, others.limited("phi", 0, 0.5 * top), "most")
    whole, open_, cut = (
        Batch(m).run(e.u, parameters=p).z[0] for m, p in ((model, {}), (limited, {}), (limited, {free.target: free.value}))
    )
    assert np.array_equal(whole, open_)
    assert np.array_equal(np.clip(whole, -0.5 * top, 0.5 * top), cut) and np.any(cut != whole)


def test_a_constant_beside_a_friction_is_a_cause_of_its_own():
    slides, load = (
        Part("coulomb_friction", ("force", "N"), {"transition": (0.1, "m/s")}),
        Part("constant_force", ("force", "N"), kind="constant_force"),
    )
    names = ("x0_0_0", "x0_0_1")
    free = tuple(Free(f"{n}_{k}", 1.0, 1.0) for n, k in (("x0_0_0", "force"), ("x0_0_0", "transition"), ("x0_0_1", "force")))
    first, second = adopting.apart(Term(Form("coulomb_friction", "guide", "force", 0, (slides, load), "with a constant"), names, free))
    assert (first.form.kind, first.elements, len(first.free)) == ("coulomb_friction", names[:1], 2)
    assert (second.form.kind, second.elements, [f.target for f in second.free]) == ("constant_force", names[1:], ["x0_0_1_force"])
    alone = Term(Form("coulomb_friction", "guide", "force", 0, (slides,)), names[:1], free[:2])
    assert adopting.apart(alone) == [alone]


def term(how: str, where: str = "tau") -> Term:
    return Term(Form(how, where, how, 0), (), (Free((how, 0), 0.0, 1.0),))


class Values:
    """Values of a fit, as far as a file needs them."""

    values: ClassVar[dict[str, float]] = {}

    @staticmethod
    def value(target):
        return {"input_gain": 0.2, "input_offset": 0.03, "input_delay": 0.0128}[target[0]]


def test_what_is_wrong_with_one_input_stands_in_a_row(tmp_path):
    """A delay goes before a gain, an offset behind both, but not into a rate; each element is written once, and no name is taken twice."""
    model, _ = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)
    seen = replace(model.sensors[0], expression="phi + 0.1*tau + 0.01*der(tau)")
    model = replace(model, sensors=(seen,), parameters=model.parameters | {"tau_offset": Parameter("tau_offset", 0.5, "N*m")})
    found = applied._driven(model, Values, [term("input_offset"), term("input_gain"), term("input_delay")], {"tau_offset", "tau_acts"})
    assert found.left == ["input_delay of tau is 3.20 samples; the model file has 3"]
    assert found.actuators == [
        'tau_acts_2 = { input = "tau", law = "delay", samples = 3 }',
        'tau_acts_3 = { input = "tau_acts_2", law = "gain", gain = "tau_gain" }',
    ]
    assert [x.split(" = ")[0] for x in found.parameters] == ["tau_gain", "tau_offset_2"]
    assert found.through(seen.expression) == "phi + 0.1*(tau_acts_3 + tau_offset_2) + 0.01*der(tau_acts_3)"
    (motor,) = applied.redirected(model, found, {})["elements"]
    assert motor.startswith("motor = ") and '"-(tau_acts_3 + tau_offset_2)"' in motor


def test_an_input_that_an_actuator_of_the_file_takes_is_left(tmp_path):
    _model, _ = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)
    for own in ('slow = { input = "tau", law = "lag", time = "5 ms" }', 'slow = { input = "tau", law = "delay", samples = 3 }'):
        text = (tmp_path / "model.toml").read_text().replace("[elements]", f"[actuators]\n{own}\n[elements]").replace("-tau", "-slow")
        (tmp_path / "slow.toml").write_text(text)
        found = applied._driven(penode_gen.load(tmp_path / "slow.toml"), Values, [term("input_gain")], set())
        assert not found.actuators and len(found.left) == 1 and "has to be corrected" in found.left[0]


def test_two_sensors_have_a_limit_each(tmp_path):
    """Forms that are adopted one after the other have names of their own, in any bench the same."""
    model, (_e,) = swing(tmp_path, lambda s, v: 0.0, seconds=2.0)
    both = replace(model, sensors=(*model.sensors, replace(model.sensors[0], name="again")))
    names = []
    for number, index in enumerate((0, 1)):
        form = others.limited(both.sensors[index].name, index, 0.1 * (index + 1))
        both, free = clipping.limited(both, form, f"x{90 + number}_0")
        names += [f.target for f in free]
    assert names == ["x90_0_limit", "x91_0_limit"] and [s.expression.count("limit") for s in both.sensors] == [2, 2]


def test_what_noise_cannot_move_has_a_filter():
    """Without any noise of states the steady gain is nothing, and the doubling ends."""
    assert np.all(gain.riccati(0.9 * np.eye(2), np.ones((1, 2)), np.zeros((2, 2)), np.zeros((2, 1)), np.eye(1)) == 0.0)


def test_a_share_of_noise_is_zero():
    """A sensor 2 % above its noise, of 200 updates: all of that is within three deviations, 0.3, of an estimate."""
    before, after = (SimpleNamespace(variance=np.array(v), used=np.ones((200, 2), bool)) for v in ([1.02, 100.0], [1.0, 100.0]))
    assert np.all(Fit.taken(before, after, np.ones(2)) < 0.1)


@pytest.mark.parametrize("tau", [1e-4, 3e-3, 0.03, 2.0])
def test_a_lag_of_an_input_is_that_of_straight_lines(tau):
    """As the actuator of the written model has it; half a sample off, a delay of a sensor would have to make up for it."""
    step, n = 4e-3, 500
    x = np.cumsum(np.random.default_rng(1).standard_normal(n))
    time = np.arange(n) * step
    exact = signal.lsim(([1.0], [tau, 1.0]), x - x[0], time)[1]
    assert lagging(x - x[0], tau, step) == pytest.approx(exact, abs=1e-9 * np.ptp(x))


def test_runs_with_the_same_input_are_filled_in_once():
    """To the bit as if each had been, whichever differ; a single signal too."""
    rng = np.random.default_rng(7)
    u = np.repeat(np.cumsum(rng.standard_normal((1, 300, 2)), axis=1), 6, axis=0)
    u[2] *= 1.1
    u[5, :, 1] += 0.2
    asked = []

    def filled(some):
        asked.append(len(some))
        return finer(some, 0.01, 2)

    assert (alike(u, filled) == finer(u, 0.01, 2)).all() and asked == [1, 2]
    assert (alike(u[0], lambda some: finer(some, 0.01, 2)) == finer(u[0], 0.01, 2)).all()
