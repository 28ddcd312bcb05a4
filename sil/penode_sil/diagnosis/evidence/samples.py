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
LOBE = 4  # bins from a line to where its window is 92 dB below it (Harris, Proc. IEEE 66, 1978, table I); so many count together
WINDOW = signal.windows.blackmanharris(SEGMENT)


def shown(series: Sequence[Array]) -> float:
    """Standard deviation of white noise that signals [n] with NaN for what was not measured show: what is left in their quietest band,
    for motion is not in all of them; or in second differences, which have six times its variance, where there are no SEGMENT in a row."""
    powers = [p for x in series for p in _spectra(x)]
    if powers:
        mean = np.mean(powers, axis=0)[LOBE : SEGMENT // 2]
        return float(np.sqrt(np.min(mean.reshape(-1, LOBE).mean(axis=1))))
    bends = np.concatenate([np.diff(x, 2) for x in series])
    bends = bends[np.isfinite(bends)]
    return float(np.sqrt(np.mean(bends**2) / 6.0)) if bends.size else 0.0


def _spectra(x: Array) -> list[Array]:
    """Periodograms [bins] of segments that were measured whole, each half over the one before; white noise has its variance in each bin."""
    starts = range(0, len(x) - SEGMENT + 1, SEGMENT // 2)
    whole = [x[i : i + SEGMENT] for i in starts if np.isfinite(x[i : i + SEGMENT]).all()]
    return [np.abs(np.fft.rfft((s - np.mean(s)) * WINDOW)) ** 2 / np.sum(WINDOW**2) for s in whole]


def noise(series: Sequence[Sequence[Array]], stated: Array) -> Array:
    """Of a sample of each sensor [n_z], from its signals: what the model file states (0: nothing), but not more than they show."""
    own = [(shown(s), most) for s, most in zip(series, stated)]
    return np.array([max(min(seen, most) if most > 0.0 else seen, 1e-12) for seen, most in own])
