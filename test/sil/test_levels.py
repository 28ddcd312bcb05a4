# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How loud the noise of a sensor is, from a residual that is noise: white, and slow in any share of the room there is for it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from penode_sil.diagnosis.study.noise import prepare, sensor_levels

STEP, SAMPLES, DECLARED = 0.002, 15_000, 1.0
ROOM = 1.25**2 - 1.0  # for slow noise: a sensor of white noise as declared may have a quarter more


@pytest.mark.parametrize("share", [0.0, 0.17, 0.35, 0.62, 0.87])
def test_level_is_that_of_the_noise(share):
    """
    Over 20 recordings the mean level is within 1.5 % of the truth, whatever the share: also between those that are tried first.

    A recording has 15 000 white values and, of the slow part with a time constant of 10 samples, 790 independent ones, so its
    variance is known to sqrt(2 / 15 000) + share ROOM / (1 + share ROOM) sqrt(2 / 790) = 3 % at most, the mean of 20 to 0.7 %.
    """
    pole, rng, ratio = 0.9, np.random.default_rng(5), []
    for _ in range(20):
        white = rng.standard_normal(SAMPLES)
        slow = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], rng.standard_normal(SAMPLES))
        residual = DECLARED * (white + np.sqrt(share * ROOM) * slow)[:, None]
        still = np.zeros((SAMPLES, 1))
        e = prepare("", STEP * np.arange(SAMPLES), still, residual, np.ones((SAMPLES, 1), bool), np.zeros(1), [None])
        levels = sensor_levels(e, residual, np.array([DECLARED]), np.zeros((len(e.frequencies), 1, 1)), robust=False)
        omega = 2.0 * np.pi * e.frequencies[: e.band] * STEP
        true = 1.0 + share * ROOM * (1.0 - pole**2) / np.abs(1.0 - pole * np.exp(-1j * omega)) ** 2
        ratio.append(np.mean(levels[:, 0]) / np.mean(true))
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.015)
