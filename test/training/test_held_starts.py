# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings to judge by may start anywhere, and may go where the trained model leaves all bounds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import generator
import numpy as np

import penode_gen
from penode_sil.recordings.measured import load
from penode_sil.training import curves, data, held_starts, solve, story, threads
from penode_sil.training.engine import Engine
from penode_sil.training.problem import Problem

HERE = Path(__file__).parent


def test_start_far_from_that_of_the_model_file(tmp_path: Path) -> None:
    """From 0 the model comes to another rest on a road that begins half a metre higher, where no step leads back; its errors there are the
    noise all the same. A model whose spring pushes away leaves all bounds whatever the start is."""
    model = penode_gen.load(HERE / "quarter.toml")
    engine = Engine(model, [])
    ports = story.ports_of(model, engine)

    def read(made: generator.Made) -> tuple[data.Record, ...]:
        return (data.record(model, load([made.write(tmp_path / "rec.csv")], model)[0], engine.signals),)

    made = generator.make(generator.Truth(), 1, seconds=4.0)
    records = read(made)
    problem = Problem(engine, records, data.at_first(model, records, engine.signals), np.ones(2))
    with threads.one():
        problem, fit = curves.train(problem, ports, [], lambda share, doing: None)
        seen = curves.seen_by(problem, fit.point)
        high = read(replace(made, road=made.road + 0.5))
        own = problem.with_(records=high, frozen=True)
        alone = solve.solve(own, own.begin(fit.point.shapes), held_starts.ITERATIONS, held_starts.CLOSE, damping=1e-6)
        assert alone.cost > 1e3 * own.samples  # what the test is about: the model file's start leads nowhere
        found = held_starts.fitted(problem, high, fit.point, ports, seen)
        assert found is not None
        chi2 = found[0].chi2(found[1]) / found[0].samples
        assert abs(chi2 - 1.0) < 4.0 * np.sqrt(2.0 / found[0].samples)  # its deviation, for white noise
        spring, damper = fit.point.shapes
        unstable = replace(fit.point, shapes=(spring.with_theta(-30.0 * spring.theta), damper))
        assert held_starts.fitted(problem, records, unstable, ports, seen) is None


def test_line_is_that_of_the_visited_inputs() -> None:
    """A line through 0 by hand: sum x f / sum x x."""
    port = story.Port("net", ((0,),), False, True, 9)
    shape = held_starts.three(1.0, True).with_theta(np.array([-1.0, 3.0]))
    x = np.array([[-1.0], [0.5], [1.0]])
    slope = (1.0 * 1.0 + 0.5 * 1.5 + 1.0 * 3.0) / 2.25
    assert np.allclose(held_starts.line(port, shape, x)(np.array([-2.0, 1.0])), slope * np.array([-2.0, 1.0]), rtol=1e-12)
