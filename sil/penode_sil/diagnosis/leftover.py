# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What an explanation leaves of recordings beyond the noise of sensors and inputs: power, and coherence of sensors. Tones: `tones`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .noise import ALIKE, correlation
from .study import Study

Array = NDArray[np.float64]
DOUBT = 6.0  # standard deviations of chi2 that count as a discrepancy


def left_over(study: Study, simulated: Sequence[Array]) -> bool:
    """Does a simulation [n, n_z] per recording leave more than noise?"""
    chi2 = rows = 0.0
    for e, m, z in zip(study.experiments, study.metrics, simulated, strict=True):
        white = m.white(m.spectrum(np.where(e.good, e.y - z, 0.0)))
        chi2, rows = chi2 + float(np.sum(white**2)), rows + white.size * float(np.mean(e.good))
    if beyond_noise(chi2 - rows, rows):
        return True
    return correlation(study.experiments, study.metrics, simulated)[0] > ALIKE


def beyond_noise(excess: float, rows: float) -> bool:
    """Is chi2 so much in excess of its `rows` that it is neither chance nor an error in the spectrum of the noise?"""
    return excess > max(DOUBT * np.sqrt(2.0 * rows), 0.15 * rows)
