# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What an explanation leaves of recordings beyond the noise of sensors and inputs: power, and coherence of sensors. Tones: `tones`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..study.fit import Fit
from ..study.noise import ALIKE, UNSEEN, correlation
from ..study.restoring import rms
from ..study.study import Study

Array = NDArray[np.float64]
CHANCE = 3.0  # deviations of chi2
DOUBT = 6.0  # standard deviations of chi2 that count as a discrepancy


def left_over(study: Study, simulated: Sequence[Array]) -> bool:
    """Does a simulation [n, n_z] per recording leave more than noise?"""
    if beyond_noise(chi2(study, simulated) - rows(study), rows(study)):
        return True
    return correlation(study.experiments, study.metrics, simulated) > ALIKE


def beyond_noise(excess: float, rows: float) -> bool:
    """Is chi2 so much in excess of its `rows` that it is neither chance nor an error in the spectrum of the noise?"""
    return bool(excess > max(DOUBT * np.sqrt(2.0 * rows), 0.15 * rows))


def chi2(study: Study, simulated: Sequence[Array]) -> float:
    """Chi2 that a simulation [n, n_z] per recording leaves."""
    pairs = zip(study.experiments, study.metrics, simulated, strict=True)
    return sum(float(np.sum(m.white(m.spectrum(np.where(e.good, e.y - z, 0.0))) ** 2)) for e, m, z in pairs)


def rows(study: Study) -> float:
    """Chi2 that noise leaves."""
    return len(study.null.residual) * float(np.mean([np.mean(e.good) for e in study.experiments]))


def only_noise(study: Study, fit: Fit) -> bool:
    """Does a fit leave no more than noise? Of few chi2 it is, what a wrong form leaves is hundreds of deviations more."""
    return bool(fit.chi2 < rows(study) + CHANCE * np.sqrt(2.0 * rows(study)))


def within(study: Study, simulated: Sequence[Array], noise: Array) -> bool:
    """Does a simulation leave of every sensor no more than its noise [n_z]?"""
    for j, most in enumerate(noise):
        left = np.concatenate([(e.y - z)[e.good[:, j], j] for e, z in zip(study.experiments, simulated, strict=True)])
        if left.size and rms(left) > UNSEEN * most:
            return False
    return True
