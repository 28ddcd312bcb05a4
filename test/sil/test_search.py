# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Steps of the search for causes that no recording is needed for."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis.score import Candidate, Regression
from penode_sil.diagnosis.search import PART, pursue, terms_of

LAW = SimpleNamespace(law="linear_damper", shapes={})


def regression(main: list[float], companion: list[float], residual: list[float]) -> Regression:
    """A law of positive size and a companion of any, as columns; nothing else is free."""
    candidates = [Candidate("tyre_damping", "tyre", 1, False, LAW), Candidate("tyre_damping", "tyre", 0, True, LAW)]
    fit = SimpleNamespace(free=(), residual=np.array(residual), jacobian=np.zeros((len(residual), 0)))
    return Regression(fit, candidates, np.array([main, companion]))


@pytest.mark.parametrize(
    "residual, gains",
    [
        ([30.0, 10.0], (20.0, 10.0)),  # both, as they come
        ([10.0, 20.0], (PART * 10.0, 20.0)),  # the companion would do it alone, and more of it with less than nothing of the law
    ],
)
def test_a_law_stays_beside_its_companions(residual, gains):
    """A form that companions alone would take is still of the kind: without its law nothing would be left to be tried."""
    r = regression([1.0, 0.0], [1.0, 1.0], residual)
    assert [t.gain for t in terms_of(r, [0, 1])] == pytest.approx(gains, rel=0.3)
    assert pursue(r, [0, 1])[1] == [0, 1]


def test_companions_alone_are_no_cause():
    assert terms_of(regression([1.0, 0.0], [1.0, 1.0], [-10.0, -5.0]), [0, 1]) == []
    assert terms_of(regression([1.0, 0.0], [1.0, 1.0], [30.0, 10.0]), [1]) == []
