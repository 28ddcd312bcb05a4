# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forms before they are fitted: which sizes a screening gives them, and which limits of a sensor its samples allow."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis import clipping
from penode_sil.diagnosis.catalogue.form import Form
from penode_sil.diagnosis.evidence.fit import Fit
from penode_sil.diagnosis.evidence.observer import Filter
from penode_sil.diagnosis.evidence.screening import scores

ROWS = 400


def left(nu) -> Fit:
    """A fit without free values that leaves innovations nu [updates]."""
    return Fit((), Filter.none(0, 1), nu[:, None], np.zeros((len(nu), 1, 0)), np.ones((len(nu), 1), bool), np.ones(1), 0.0, 0.0)


@pytest.mark.parametrize("signs, sizes", [((0, 0), (2.0, -1.0)), ((1, 0), (2.0, -1.0)), ((0, 1), (2.0, 0.0)), ((-1, 1), (0.0, 0.0))])
def test_a_size_has_the_sign_that_its_law_allows(signs, sizes):
    """Of two orthogonal changes, 2 and -1 times of which are missed: what may not be is nothing, and gains nothing."""
    one, other = np.sin(2.0 * np.pi * np.arange(ROWS) / ROWS), np.cos(2.0 * np.pi * np.arange(ROWS) / ROWS)
    rest = -(2.0 * one - other) + 0.1 * np.where(np.arange(ROWS) % 2, 1.0, -1.0)  # orthogonal to both
    (found,) = scores(left(rest), [np.stack([one, other], axis=-1)[:, None, :]], [signs])
    assert found.sizes == pytest.approx(sizes, abs=1e-6)
    power = rest @ rest
    gone = sum((x**2) * 0.5 * ROWS for x in sizes)
    assert found.gain == pytest.approx(0.5 * ROWS * np.log(power / (power - gone)), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("limit, possible", [(1.0, True), (0.97, True), (0.9, False)])
def test_no_limit_that_samples_are_beyond(limit, possible):
    """A sensor that cuts off at 1, with noise of 0.01: 0.2 % of its samples may be far out, the others are within three deviations."""
    y = np.clip(3.0 * np.sin(0.01 * np.arange(5000)), -1.0, 1.0)
    y[::1000] = 40.0
    bench = SimpleNamespace(records=(SimpleNamespace(y=y[:, None]),), noise=np.array([0.01]))
    assert clipping.is_possible(bench, Form("sensor_clipping", "y", "clip", 0), limit) is possible
