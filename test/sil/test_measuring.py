# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The gain on a hold-out: by errors of a known size."""

import numpy as np
import pytest

from penode_sil.diagnosis.extend.measuring import achieved


def test_gained_share_has_an_interval():
    """Errors of independent blocks: the deviation of an RMS of n is sigma/sqrt(2 n), of the share that over the
    room."""
    rng = np.random.default_rng(3)
    n = 8000
    before, after = 3.0 * rng.standard_normal(n), 1.2 * rng.standard_normal(n)
    share, (low, high) = achieved(before, after, 1.0)
    deviation = np.hypot(1.2 / 2.0, 3.0 * (0.2 / 2.0) / 2.0) / np.sqrt(2.0 * n)  # of (b - a)/(b - 1) at b = 3, a = 1.2
    assert share == pytest.approx(0.9, abs=4.0 * deviation)
    assert high - low == pytest.approx(2.0 * 1.96 * deviation, rel=0.5)  # 40 blocks tell a deviation to 11 %, 4 of those
    assert achieved(after, after, 1.2) == (None, None)
