# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Straight lines find the range of motion where no law stands beside the networks; a network in an equation is a curve too."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_gen.reading.untrained import untrained
from penode_sil.recordings.measured import load
from penode_sil.training import curve, data, lines, story, threads, unfold
from penode_sil.training.engine import Engine
from penode_sil.training.problem import Problem
from penode_sil.training.solve import NONE

sys.path.insert(0, str(Path(__file__).with_name("smooth")))
import plants


@pytest.mark.parametrize("kind, number", [("alone", 1), ("alone", 5), ("two", 2)])
def test_lines_find_where_a_free_body_is(kind: str, number: int, tmp_path: Path) -> None:
    """The first deflection within 5 mm of the plant's: springs of a few hundredths of a metre that bend are no lines."""
    plant = plants.draw(kind, number, 10.0)
    path, table = plant.write(tmp_path)
    model = penode_gen.load(path)
    engine = Engine(model, [])
    records = tuple(data.record(model, m, engine.signals) for m in load([table], model))
    ports = story.ports_of(model, engine)
    problem = Problem(engine, records, data.at_first(model, records, engine.signals), np.ones(len(ports)))
    with threads.one():
        _, point = lines.fitted(problem, ports, lambda point: NONE)
    deflection = next(iter(plant.forces.values()))[1].reshape(len(records[0].y), -1)[0, 0]
    assert abs(point.starts[0, 1] - point.starts[0, 0] - deflection) < 5e-3


@pytest.mark.parametrize("layers", [[8], [8, 8], [6, 9, 7, 5]])
@pytest.mark.parametrize("low, high", [(-0.9, 1.3), (293.0, 340.0), (-3.0, -1.0)])
def test_a_curve_that_is_not_0_at_0_is_its_network(layers: list[int], low: float, high: float) -> None:
    network, random = untrained({"layers": layers}, 1, "net"), np.random.default_rng(1)
    knots = np.linspace(low, high, unfold.capacity(network) - 1)
    values = random.normal(200.0, 300.0, len(knots))
    found = unfold.unfold(curve.Curve(knots, values, -1), network, low, high)
    x = np.linspace(low, high, 1001)
    expected = curve.Curve(knots, values, -1)(x)
    # sums of doubles of the size of the slope times the way from 0
    slope = np.max(np.abs(np.diff(values) / np.diff(knots)))
    assert np.allclose(found.evaluate(x[:, None])[:, 0], expected, rtol=0.0, atol=1e-12 * slope * max(abs(low), abs(high)) * 100.0)
    assert found.architecture == network.architecture


def test_a_knot_without_evidence_is_dropped() -> None:
    """A straight force whose outermost knot, beyond what was visited, is anywhere: without its neighbour the force is straight still."""
    knots, spread = np.linspace(0.0, 1.0, 9), np.diag([*np.full(8, 1e-2), 1e6])
    values = np.where(knots == 1.0, 500.0, -3.0 * knots)
    found = curve.without(knots, values, spread, np.arange(9) % 2 == 0)
    assert np.allclose(found, -3.0 * knots[::2], atol=0.1)
