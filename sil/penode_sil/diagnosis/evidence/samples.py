# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise of single samples, as recordings themselves show it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import signal

Array = NDArray[np.float64]
SEGMENT = 64  # samples of which a spectrum is taken
LOBE = 4  # half width in bins of the window's main lobe (Harris, Proc. IEEE 66, 1978, table I: 92 dB down); so many bins count together
WINDOW = signal.windows.blackmanharris(SEGMENT)
QUIETEST = slice(LOBE, 7 * SEGMENT // 16)  # bins to look at: what is resampled shows little of its noise above 0.4 of the rate


def shown(series: Sequence[Array]) -> float:
    """Standard deviation of the white noise in signals [n] (NaN: not measured): of the quietest band of their mean spectrum, where there is
    least motion. Of 600 samples it is 0.9 of the truth, for it is the least of several. Without SEGMENT samples in a row, as `bent`."""
    powers = [p for x in series for p in _spectra(x)]
    if not powers:
        return bent(series)
    return float(np.sqrt(np.min(np.mean(powers, axis=0)[QUIETEST].reshape(-1, LOBE).mean(axis=1))))


def bent(series: Sequence[Array]) -> float:
    """The same from second differences, whose variance is six times that of the noise, and which are also bent by motion; 0 if there are
    none."""
    bends = np.concatenate([np.diff(x, 2) for x in series])
    bends = bends[np.isfinite(bends)]
    return float(np.sqrt(np.mean(bends**2) / 6.0)) if bends.size else 0.0


def _spectra(x: Array) -> list[Array]:
    """Periodograms [bins] of segments that were measured whole, overlapping by half; white noise has its variance in each bin."""
    starts = range(0, len(x) - SEGMENT + 1, SEGMENT // 2)
    whole = [x[i : i + SEGMENT] for i in starts if np.isfinite(x[i : i + SEGMENT]).all()]
    return [np.abs(np.fft.rfft((s - np.mean(s)) * WINDOW)) ** 2 / np.sum(WINDOW**2) for s in whole]


def noise(series: Sequence[Sequence[Array]], stated: Array) -> Array:
    """Noise of a sample [n_z], in the sensors' SI units: what the file states, but not more than second differences show; of a sensor for
    which it states nothing (0), what the spectrum shows."""
    own = [min(bent(s) or most, most) if most > 0.0 else shown(s) for s, most in zip(series, stated, strict=True)]
    return np.maximum(own, 1e-12)
