# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Inputs between samples, the noise of samples, an observer on some samples, and sensors with scales and limits."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from test_innovations import swing

from penode_sil.batch import Batch, Observer
from penode_sil.diagnosis import adopting, applied, clipping, plant
from penode_sil.diagnosis.between import joined, parts, straight
from penode_sil.diagnosis.catalogue.form import Form, Part
from penode_sil.diagnosis.evidence import samples
from penode_sil.diagnosis.evidence.observer import Filter, Predictor, Record, augmented, scale
from penode_sil.diagnosis.fit import Free
from penode_sil.diagnosis.terms import Term

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


def test_noise_beside_a_motion_of_nine_samples_a_period():
    """White noise of 1e-3 of the motion. 186 spectra half over one another, four bins each: the quietest of six bands is low by less than
    10 %, and the motion, 92 dB down, is 2.5e-5 of itself there."""
    rng = np.random.default_rng(4)
    y = np.sin(2.0 * math.pi * np.arange(6000) / 9.0) + 1e-3 * rng.standard_normal(6000)
    assert abs(samples.shown([y]) / 1e-3 - 1.0) < 0.1
    y[::50] = np.nan  # no 64 in a row: second differences show the motion
    assert samples.shown([y]) > 0.1
    assert samples.shown([np.full(100, np.nan)]) == 0.0


def test_an_observer_counts_the_samples_that_are_kept(tmp_path):
    """Two steps of half a sample, of which one is kept, and two substeps of a whole one: the same but for rounding."""
    model, (e,) = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)
    gain, n = np.array([[0.3], [2.0]]), len(e.u)
    whole = Batch(replace(model, substeps=2)).run(e.u, observer=Observer(4, e.y, gain))
    between = np.interp(np.arange(2 * n - 1) / 2.0, np.arange(n), e.u[:, 0])[:, None]
    halves = Batch(replace(model, sample_time=0.5 * model.sample_time)).run(between, observer=Observer(4, e.y, gain), every=2)
    assert halves.z.shape == whole.z.shape
    assert np.max(np.abs(halves.z - whole.z)) < 1e-13
    assert np.max(np.abs(whole.z - Batch(replace(model, substeps=2)).run(e.u).z)) > 1e-6  # it does follow
    with pytest.raises(ValueError, match=r"must be \[kept, n_z\] = \[100, 1\]"):
        Batch(replace(model, sample_time=0.5 * model.sample_time)).run(between, observer=Observer(4, np.zeros((2 * n - 1, 1)), gain), every=2)


def test_a_scale_of_a_sensor_does_not_tune_the_filter(tmp_path):
    """Twice as large a measurement of a sensor of scale 2 has twice the innovations, whatever the gain."""
    model, (e,) = swing(tmp_path, lambda s, v: 0.02 * math.sin(9.0 * s), seconds=2.0)
    wide, by = augmented(model, plant.places(model)), Filter(np.array([[0.4], [3.0], [0.0]]), np.array([0.01]))
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
    limited, free = clipping.limited(model, Form(clipping.KIND, "phi", "clip", 0, limit=0.5 * top), "most")
    whole, open_, cut = (Batch(m).run(e.u, parameters=p).z[0] for m, p in ((model, {}), (limited, {}), (limited, {"most": free.value})))
    assert np.array_equal(whole, open_)
    assert np.array_equal(np.clip(whole, -0.5 * top, 0.5 * top), cut) and np.any(cut != whole)


def test_a_constant_beside_a_friction_is_a_cause_of_its_own():
    slides, load = Part("coulomb_friction", ("force", "N"), {"transition": (0.1, "m/s")}), Part("constant_force", ("force", "N"), kind="constant_force")
    names = ("x0_0_0", "x0_0_1")
    free = tuple(Free(f"{n}_{k}", 1.0, 1.0) for n, k in (("x0_0_0", "force"), ("x0_0_0", "transition"), ("x0_0_1", "force")))
    first, second = adopting.apart(Term(Form("coulomb_friction", "guide", "force", 0, (slides, load), "with a constant"), names, free))
    assert (first.form.kind, first.elements, len(first.free)) == ("coulomb_friction", names[:1], 2)
    assert (second.form.kind, second.elements, [f.target for f in second.free]) == ("constant_force", names[1:], ["x0_0_1_force"])
    alone = Term(Form("coulomb_friction", "guide", "force", 0, (slides,)), names[:1], free[:2])
    assert adopting.apart(alone) == [alone]


def test_what_is_wrong_with_one_input_stands_in_a_row(tmp_path):
    """A hold goes before a gain, an offset behind both; each element is written once."""
    model, _ = swing(tmp_path, lambda s, v: 0.0, seconds=0.4)

    def term(how: str, **more) -> Term:
        return Term(Form(how, "tau", how, 0, **more), (), (Free((how, 0), 0.0, 1.0),))

    class Values:
        values: dict[str, float] = {}

        @staticmethod
        def value(target):
            return {"input_gain": 0.2, "input_offset": 0.03, "input_delay": 0.012}[target[0]]

    found, left = applied._driven(model, Values, [term("input_offset"), term("input_gain"), term("input_delay")])
    assert not left
    assert found["actuators"] == ['tau_acts = { input = "tau", law = "delay", samples = 3 }', 'tau_acts_acts = { input = "tau_acts", law = "gain", gain = "tau_gain" }']
    assert [x.split(" = ")[0] for x in found["elements"]] == ["motor"] and '"-(tau_acts_acts + tau_offset)"' in found["elements"][0]
    assert [x.split(" = ")[0] for x in found["parameters"]] == ["tau_gain", "tau_offset"]
