# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A force that turns between two knots is found; one that bends, one that noise bends, and one that turns at 0 are not."""

from __future__ import annotations

import numpy as np

from penode_sil.training import kinks
from penode_sil.training.curve import Curve


def curve(values: np.ndarray, knots: np.ndarray) -> Curve:
    """A curve that is 0 at 0."""
    return Curve(knots, values, int(np.flatnonzero(knots == 0.0)[0]))


def test_stop_between_two_knots_is_found_where_it_is() -> None:
    knots = np.arange(-20, 21) * 1.0
    spread = np.diag(np.full(41, 1.0))
    for at in (7.3, -11.8):
        found = kinks.find(curve(knots + 50.0 * np.sign(at) * np.maximum(np.sign(at) * (knots - at), 0.0), knots), spread)
        assert len(found) == 1
        # the values are those of the stop: the lines beside its cell meet there to rounding
        assert abs(found[0][0] - at) < 1e-9 and found[0][1] == 1.0
    two = kinks.find(curve(50.0 * (np.maximum(knots - 7.3, 0.0) + np.minimum(knots + 11.8, 0.0)), knots), spread)
    assert np.allclose([x for x, _ in two], [-11.8, 7.3], rtol=1e-9)


def test_smooth_forces_noise_and_friction_are_none() -> None:
    knots = np.arange(-20, 21) * 1.0
    spread = np.diag(np.full(41, 1.0))
    random = np.random.default_rng(1)
    assert not kinks.find(curve(knots + 0.1 * knots**3, knots), spread)
    uneven = np.delete(knots, [12, 27])
    assert not kinks.find(curve(uneven + 10.0 * uneven**2, uneven), np.diag(np.full(39, 1.0)))
    assert not kinks.find(curve(100.0 * np.tanh(knots / 0.4), knots), spread)
    for _ in range(200):  # the change of slope has a deviation of 2: five of them in one of 200 times 36 cells come once in 200 such tests
        noise = np.where(knots == 0.0, 0.0, random.normal(size=41))
        assert not kinks.find(curve(3.0 * knots + noise, knots), spread)
