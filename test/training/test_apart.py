# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Parameters beside networks: a damping stays a damping."""

from __future__ import annotations

from pathlib import Path

import campaign_more
import generator
import numpy as np

import penode_gen
from penode_sil.training import apart
from penode_sil.training.curve import Curve

HERE = Path(__file__).parent


def test_pairs_are_those_where_a_network_could_do_all_that_a_parameter_does() -> None:
    model = penode_gen.load(HERE / "damping.toml")
    every = tuple(model.parameters)  # masses, tyre, and both that stand beside a network
    found = {(a.network, a.parameter) for a in apart.find(model, every, tuple(model.networks))}
    assert found == {("spring_net", "c"), ("damper_net", "d")}
    assert apart.find(penode_gen.load(HERE / "quarter_two.toml"), every, ("both_net",)) == ()  # two inputs: no curve


def test_row_measures_the_part_along_the_sensitivity() -> None:
    """Of a curve a x + e with e orthogonal to x over the places, a times the RMS of x."""
    model = penode_gen.load(HERE / "damping.toml")
    x = np.linspace(-1.0, 1.0, 1000)
    (pair,) = (a.visited(x) for a in apart.find(model, ("d",), tuple(model.networks)))
    knots = np.linspace(-1.0, 1.0, 41)
    even = Curve(knots, 7.0 * (knots**2), 20)
    # groups have one sample each here, so but for rounding of values near 1 all is exact
    assert abs(pair.row(even) @ even.theta) < 1e-10
    both = Curve(knots, 3.0 * knots + even.values, 20)
    assert abs(pair.row(both) @ both.theta - 3.0 * np.sqrt(np.mean(x**2))) < 1e-10
    many = np.concatenate([np.linspace(-1.0, 1.0, 15_001), np.full(3_000, 0.5)])  # groups of 17 and of 18: each sample counts once
    line = Curve(knots, 3.0 * knots, 20)
    # a group of up to 18 samples is replaced by its mean, which loses its own variance
    lost = (18 * 2.0 / 15_000) ** 2 / 12.0 / np.mean(many**2)
    assert abs(pair.visited(many).row(line) @ line.theta / (3.0 * np.sqrt(np.mean(many**2))) - 1.0) < lost


def test_damping_beside_a_network_is_within_its_interval(tmp_path: Path) -> None:
    """The file says 900 N s/m; the whole force has 1034. Without the rule it stays where the file has it, to 222 N s/m."""
    made = generator.make(generator.Truth(), 4, seconds=12.0)
    value, sigma, truth = campaign_more.damping(made, 1.0, tmp_path)
    assert sigma < 1.0 and abs(value - truth) < 3.0 * sigma and abs(truth - 900.0) > 100.0
