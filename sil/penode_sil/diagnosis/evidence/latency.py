# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A late signal without its delay, or without its first-order lag."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from . import samples

Array = NDArray[np.float64]
Spectrum = NDArray[np.complexfloating]


def moved(x: Array, count: Array) -> Array:
    """A signal [n] later by so many samples `count` [runs], earlier below zero, joined by straight lines: [runs, n]; its ends stay."""
    at = np.arange(len(x))
    return np.array([np.interp(at - d, at, x) for d in count])


def earlier(y: Array, count: Array) -> Array:
    """A signal [n] as it was so many samples `count` [runs] before it was seen: [runs, n]; what was not seen is NaN. Between samples it is
    band-limited: straight lines would halve the power of its noise there, which likelihood takes for a delay."""
    seen = np.arange(len(y)) + count[:, None] <= len(y) - 1
    near = moved(np.isfinite(y).astype(float), -count) == 1.0  # both neighbours were measured
    return np.where(seen & near, _filtered(y, count, lambda turn: np.exp(1j * turn)), np.nan)


def without_lag(y: Array, lags: Array) -> Array:
    """A signal [n] as it was before first-order `lags` [runs], in samples: [runs, n]; NaN stays."""
    return np.where(np.isfinite(y), _filtered(y, lags, lambda turn: 1.0 + 1j * turn), np.nan)


BEFORE = {"late": earlier, "lag": without_lag}  # by what is wrong with a sensor, see catalogue.form


def amplified(y: Array, lags: Array, update: int) -> Array:
    """By how much [runs] a signal [n] without its lags, in samples, is larger: the geometric mean of frequencies up to those of means of
    `update` samples."""
    moving = _moving(_spectrum(y))
    turns = np.pi * np.arange(len(moving) // update) / (len(moving) - 1)
    larger: Array = np.mean(np.log(np.abs(1.0 + 1j * lags[:, None] * turns)) * moving[: len(turns)], axis=1)
    return np.exp(larger)


def _filtered(y: Array, shifts: Array, response: Callable[[Array], Spectrum]) -> Array:
    """A signal [n] earlier by so many samples [runs], by the `response` to the turn [rad] in that time; noise stays as it is."""
    spectrum = _spectrum(y)
    each, runs = np.unique(shifts, return_inverse=True)  # of the runs of a fit, most share it
    turn = 2.0 * np.pi * _moving(spectrum) * np.fft.rfftfreq(2 * len(y) - 2) * each[:, None]
    start, slope = _line(y)
    at = np.arange(len(y)) + each[:, None]
    return (start + slope * at + np.fft.irfft(spectrum * response(turn), 2 * len(y) - 2)[:, : len(y)])[runs]


def _whole(y: Array) -> Array:
    """A signal [n] with straight lines where it was not measured."""
    good = np.isfinite(y)
    return np.interp(np.arange(len(y)), np.flatnonzero(good), y[good]) if good.any() else np.zeros(len(y))


def _line(y: Array) -> tuple[float, float]:
    """Start and slope of the line through the ends of a signal [n]."""
    x = _whole(y)
    return x[0], (x[-1] - x[0]) / max(len(x) - 1, 1)


def _spectrum(y: Array) -> Spectrum:
    """Of a signal [n] about the line through its ends, and reflected in them, so that neither value nor slope jumps there: [n]."""
    start, slope = _line(y)
    rest = _whole(y) - start - slope * np.arange(len(y))
    return np.fft.rfft(np.concatenate([rest, -rest[-2:0:-1]]))


def _moving(spectrum: Spectrum) -> NDArray[np.bool_]:
    """Frequencies [n] with at least twice the power of the quietest part of a spectrum. Others show noise, whose derivative is no evidence
    of a delay, and would hide what is."""
    width = max(len(spectrum) // samples.SEGMENT, 1)
    power: Array = ndimage.uniform_filter1d(np.abs(spectrum) ** 2, width)
    noise: float = 2.0 * np.min(power)  # means of noise scatter by less than that
    return power > noise
