# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Curves bend as held-out parts allow; knots beside 0 come in pairs; a parameter stops at its limit."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import generator
import numpy as np

import penode_gen
from penode_sil.recordings.measured import load
from penode_sil.training import curve, curves, data, heldout, story, threads
from penode_sil.training.engine import Engine
from penode_sil.training.problem import Point, Problem

HERE = Path(__file__).parent


def fitted(folder: Path, spring: tuple[float, ...], sway: float) -> tuple[Problem, Point]:
    """Curves fitted to three seconds of a plant whose body carries a force that no network can be: `sway` [m/s^2], slow, without end."""
    truth = generator.Truth(spring_by=spring, damper=1, damper_by=(0.0, 0.0, 0.02, 0.0))
    made = generator.make(truth, 1, seconds=3.0)
    slow = sway * np.sin(2.0 * np.pi * 0.9 * made.time**1.3)
    model = penode_gen.load(HERE / "quarter.toml")
    measured = load([replace(made, a_body=made.a_body + slow).write(folder / "rec.csv")], model)
    engine = Engine(model, [p.name for p in model.parameters.values() if p.tolerance > 0.0])
    records = (data.record(model, measured[0], engine.signals),)
    problem = Problem(engine, records, data.at_first(model, records, engine.signals), np.ones(2), held=frozenset(engine.free))
    with threads.one():
        problem, fit = curves.train(problem, story.ports_of(model, engine), [], lambda share, doing: None)
    return problem, fit.point


def test_a_network_that_predicts_nothing_is_zero(tmp_path: Path) -> None:
    """No force is missing, but there is a disturbance twenty times as loud as the noise, which curves follow; held-out parts show that they
    predict nothing. A spring that is missing is kept."""
    problem, point = fitted(tmp_path, (0.0, 0.03, 0.0, 0.0), 0.4)
    assert heldout.loud(problem, point)
    left = problem.scale * heldout.sizes(problem, point)
    assert np.all(left <= 0.1 * problem.scale), left / problem.scale
    problem, point = fitted(tmp_path, (500.0, 0.03, 0.0, 0.0), 0.4)
    assert heldout.loud(problem, point)
    spring = point.shapes[0]
    wide = float(np.diff(spring.knots).max())
    bend = (500.0 * wide) ** 2  # of the plant's parabola: how far a knot is from the line between its neighbours
    assert heldout.sizes(problem, point)[0] * 0.3 * problem.scale[0] >= bend  # 0.3: SETTINGS.problem_bent, one standard deviation


def test_noise_alone_is_not_loud(tmp_path: Path) -> None:
    assert not heldout.loud(*fitted(tmp_path, (500.0, 0.03, 0.0, 0.0), 0.0))


def test_parts_are_predicted_from_the_others() -> None:
    """A mean of four parts: each is predicted by the mean of the other three, by hand."""
    values, weight = np.array([1.0, 3.0, 2.0, 6.0]), 5.0
    found = [heldout.Part(np.array([[weight]]), np.array([weight * v]), weight * v * v) for v in values]
    others = (values.sum() - values) / 3.0
    assert np.allclose(heldout.predicted(found, np.zeros((1, 1)), np.zeros(1)), weight * (values - others) ** 2, rtol=1e-9)


def test_first_knots_on_both_sides_of_zero_stay_or_go_together() -> None:
    """A force that turns about 0, and noise: by itself it keeps a knot on one side only in some draws."""
    knots, regular, alone = np.linspace(-1.0, 1.0, 41), np.arange(41) % 2 == 0, 0
    for seed in range(20):
        values = np.where(knots == 0.0, 0.0, 5.0 * np.tanh(10.0 * knots) + np.random.default_rng(seed).normal(0.0, 0.15, 41))
        spread = np.eye(41) * 0.15**2
        one = curve._fewer(knots, values, spread, 13, regular, np.arange(41) == 20)
        both = curve.fewer(knots, values, spread, 13, regular, 20)
        alone += int(one[19] != one[21])
        assert both[19] == both[21] and both.sum() == 13, seed
    assert alone > 0


def test_a_grid_is_symmetric_about_zero() -> None:
    for low, high, count, power in (
        (-1.19, 1.11, 41, 2.0),
        (-0.066, 0.041, 29, 1.2),
        (-1.0, 1e-3, 20, 2.0),
        (0.0, 0.3, 7, 2.0),
        (-0.3, 0.3, 5, 2.0),
    ):
        found = curve.spaced(low, high, count, power)
        assert len(found) == count and found[0] == low and found[-1] == high and np.all(np.diff(found) > 0.0) and np.sum(found == 0.0) == 1
    found = curve.spaced(-1.19, 1.11, 41, 2.0)
    zero = int(np.flatnonzero(found == 0.0)[0])
    assert np.array_equal(found[zero + 1 : zero + 18], -found[zero - 17 : zero][::-1])


def test_during_a_fit_a_constant_costs_and_a_step_does_not() -> None:
    """A force that is 0 at 0 alone and a constant elsewhere moves where another network's 0 is: on the way to a fit a spike costs as if
    its deviation were 1e-4 (SETTINGS.problem_tied) of 0.3 spans (problem_bent); a step of friction costs what it does at the end."""
    model = penode_gen.load(HERE / "quarter.toml")
    engine = Engine(model, [])
    knots = np.array([-1.0, -0.5, -0.01, 0.0, 0.01, 0.5, 1.0])
    problem = Problem(engine, (), data.Noise(np.ones(0), (), np.ones(0)), np.full(2, 10.0))

    def costs(values: np.ndarray) -> tuple[float, float]:
        shape = curve.Curve(knots, values, 3)
        both = (p._of_shape(shape, 10.0) for p in (problem, problem.with_(plain=True)))
        return tuple(float(shape.theta @ m @ shape.theta) for m in both)

    end, way = costs(np.where(knots == 0.0, 0.0, 2.0))
    assert abs((way - end) / (2.0 / (1e-4 * 0.3 * 10.0)) ** 2 - 1.0) < 1e-6
    end, way = costs(2.0 * np.sign(knots))
    assert abs(way - end) < 1e-9 * end
