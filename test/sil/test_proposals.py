# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forms before they are accepted: which limits of a sensor its samples allow."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis import clipping
from penode_sil.diagnosis.catalogue.form import Form


@pytest.mark.parametrize("limit, possible", [(1.0, True), (0.97, True), (0.9, False)])
def test_no_limit_that_samples_are_beyond(limit, possible):
    """A sensor that cuts off at 1, with noise of 0.01: 0.2 % of its samples may be far out, the others are within three deviations."""
    y = np.clip(3.0 * np.sin(0.01 * np.arange(5000)), -1.0, 1.0)
    y[::1000] = 40.0
    bench = SimpleNamespace(records=(SimpleNamespace(y=y[:, None]),), noise=np.array([0.01]))
    assert clipping.is_possible(bench, Form("sensor_clipping", "y", "clip", 0), limit) is possible
