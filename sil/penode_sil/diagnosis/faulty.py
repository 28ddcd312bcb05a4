# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Simulated signals as faulty sensors show them: by clocks that run fast, late, or near their limits."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft

Array = NDArray[np.float64]
BLUNT = 0.3  # sharpness of a rail: with less it is about the same tanh, as a small difference of large numbers


def drifted(signals: Array, drift: Array) -> Array:
    """Signals [n, n_z, runs] by clocks that run fast by drifts [runs]: parabolas through the nearest three samples, of all runs the
    same ones where these are near for all."""
    n = len(signals)
    at = np.arange(n)[:, None] * (1.0 + drift)
    near = np.clip(np.rint(at).astype(int), 1, n - 2)
    if np.all(np.abs(near - near[:, :1]) <= 1):
        near = near[:, :1]
        before, here, after = (signals[near[:, 0] + k] for k in (-1, 0, 1))
    else:
        before, here, after = (np.take_along_axis(signals, (near + k)[:, None], axis=0) for k in (-1, 0, 1))
    part = (at - near)[:, None]
    return here + 0.5 * part * (after - before + part * (after - 2.0 * here + before))


def delayed(signals: Array, delay: Array, roll_off: Array, step: float) -> Array:
    """Signals [n, runs] later by delays [runs] [s] and less of them where they are fast, by -roll_off [runs] [s^2] of the second
    derivative. That is a dead time before two poles as evenly late as they can be: the poles alone from delay^2/6 on (Bessel's of
    order 2) to delay^2/2 (one pole), the dead time alone without. Before its start a signal is what it was there, and all of that
    with a delay that is as long as itself: a fit may try any."""
    n = len(signals)
    delay = np.minimum(delay, n * step)
    lead = min(int(np.ceil(8.0 * np.max(delay) / step)), n) + 16
    padded = np.concatenate([np.repeat(signals[:1], lead, 0), signals, np.repeat(signals[-1:], lead, 0)])
    size = fft.next_fast_len(len(padded), real=True)
    s = 2j * np.pi * fft.rfftfreq(size, step)[:, None]
    lag = np.minimum(delay, np.sqrt(6.0 * roll_off))
    poles = 1.0 + s * lag + s * s * (lag**2 / 2.0 - roll_off)
    return fft.irfft(fft.rfft(padded, size, axis=0) * np.exp(-s * (delay - lag)) / poles, size, axis=0)[lead : lead + n]


def railed(signals: Array, rail: Array, sharpness: Array) -> Array:
    """Signals [n, runs] that a sensor shows less and less of towards its limits of 1/rail [runs]: by a tanh with no sharpness [runs],
    all of them up to the limits with an endless one. In between, the slope is that of two logistic steps at the limits."""
    sharpness, rail = np.maximum(sharpness, BLUNT), np.maximum(rail, 1e-12)
    slope = np.tanh(0.5 * sharpness)
    x = signals * rail * (sharpness / slope)
    return signals / slope + (np.logaddexp(0.0, -x - sharpness) - np.logaddexp(0.0, x - sharpness)) / (sharpness * rail)
