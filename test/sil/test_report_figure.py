# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Figures of the report: fewer points without losing extremes, ticks."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

from penode_sil.diagnosis.report import figure as fig
from penode_sil.diagnosis.report.figure import Axis


def test_thinning_keeps_the_extremes():
    x = np.arange(50_000.0)
    y = np.random.default_rng(2).standard_normal(50_000)
    y[31_234], y[7] = 40.0, -50.0
    got = fig.thinned(x, y, 400)
    assert len(got[0]) <= 400 and np.all(np.diff(got[0]) > 0.0)
    assert got[1].max() == 40.0 and got[1].min() == -50.0
    for a, b in itertools.pairwise(np.linspace(0, 50_000, 201).astype(int)):
        inside = got[1][(got[0] >= a) & (got[0] < b)]
        assert inside.max() == y[a:b].max() and inside.min() == y[a:b].min()


@pytest.mark.parametrize(
    "axis",
    [
        Axis("", "", 0.0, 23.7),
        Axis("", "", -0.013, 0.4),
        Axis("", "", 3e-7, 4.1e-7),
        Axis("", "", 0.4, 95.0, True),
        Axis("", "", 1e-6, 3.0, True),
        Axis("", "", 2.0, 9.0, True),
    ],
)
def test_ticks_are_few_round_and_inside(axis):
    ticks = axis.ticks()
    assert 2 <= len(ticks) <= 12 and all(0.0 <= at <= 1.0 for at, _ in ticks) and len({t for _, t in ticks}) == len(ticks)
    powers = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
    for at, text in ticks:
        mantissa, _, power = text.partition("10") if "10" in text and re.search("[⁰¹²³⁴⁵⁶⁷⁸⁹]", text) else (text, "", "0")
        number = float((mantissa.rstrip("·") or "1").translate(powers)) * 10.0 ** int(power.translate(powers))
        assert axis.share(number) == pytest.approx(at, abs=1e-6)
