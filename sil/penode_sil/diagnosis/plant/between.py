# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Inputs between samples that are too far apart to be joined by straight lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline, make_interp_spline

Array = NDArray[np.float64]
CLOSE = 1e-3  # [s] sample time up to which parabolas between samples are close enough, and cubics where a model uses rates


def far(step: float, signals: Sequence[Array]) -> bool:
    """Are samples `step` [s] apart too far for straight lines between them? More than CLOSE, or with fewer than 32 in a period of a signal
    [n, n_u], whose rms a line misses by (2 pi/32)^2/12 = 0.3 %."""
    rms, change = (
        np.sqrt(np.mean(np.concatenate(x) ** 2, axis=0))
        for x in ([s - np.mean(s, axis=0) for s in signals], [np.diff(s, axis=0) for s in signals])
    )
    return step > CLOSE or bool(np.any(32.0 * change > 2.0 * np.pi * rms))


def finer(u: Array, step: float, count: int) -> Array:
    """Smooth signals [..., n, n_u], `step` [s] apart, with `count` intervals for each: 2, or 3 for a model that uses their rates."""
    time = np.arange(0.0, u.shape[-2]) * step
    return joined(parts(time, u, CubicSpline(time, u, axis=-2)(time, 1) if count == 3 else u, count), u)


def parts(time: Array, u: Array, rate: Array, count: int) -> Array:
    """Splits each interval of signals u [..., n, n_u], sampled at `time` [n] in s, into `count` parts: 2, or 3 for a model that uses their
    `rate` [..., n, n_u]. Returns samples [..., n - 1, count, n_u], each interval without its end, to be joined by straight lines.

    At the samples they are what they are, for that is what sensors see. In between, the middle one is such that the integral over each
    interval, which moves the plant, is that of the smooth input: a spline of degree 7, which shows an image of 3.3 samples a period by
    (0.3/0.7)^8, where a cubic one shows (0.3/0.7)^4 (Unser, IEEE Signal Process. Mag. 16, 1999). Of 3, the last is such that the line to
    the next sample has its rate, which sensors may see as well.
    """
    h = float(time[1] - time[0])
    whole = _means(u)
    first, last = u[..., :-1, :], u[..., 1:, :]
    found = np.empty((*first.shape[:-1], count, u.shape[-1]))
    found[..., 0, :] = first
    if count == 2:
        found[..., 1, :] = 2.0 * whole - 0.5 * (first + last)
    else:
        found[..., 2, :] = last - h * rate[..., 1:, :] / 3.0
        found[..., 1, :] = 3.0 * whole - 0.5 * (first + last) - found[..., 2, :]
    return found


def _means(u: Array) -> Array:
    """Means of the smooth signals [..., n - 1, n_u] over each interval. They are continued by point reflection at their ends, where
    the noise of samples would otherwise count six times."""
    more, axis = min(16, u.shape[-2] - 1), u.ndim - 2
    before, after = (
        2.0 * u[..., [end], :] - u[..., rows, :][..., ::-1, :] for end, rows in ((0, slice(1, more + 1)), (-1, slice(-more - 1, -1)))
    )
    at = np.arange(float(u.shape[-2] + 2 * more))
    spline = make_interp_spline(at, np.concatenate([before, u, after], axis=-2), k=7, axis=axis)
    return np.diff(spline.antiderivative()(at[more : len(at) - more]), axis=axis)


def straight(u: Array, count: int) -> Array:
    """The same shape on straight lines, for signals with edges."""
    share = np.arange(count)[:, None] / count
    found: Array = share * np.diff(u, axis=-2)[..., None, :]
    found += u[..., :-1, None, :]
    return found


def joined(split: Array, u: Array) -> Array:
    """Parts [..., n - 1, count, n_u] of signals u [..., n, n_u] as one signal [..., (n - 1) count + 1, n_u]."""
    longer = (u.shape[-2] - 1) * split.shape[-2]
    return np.concatenate([split.reshape(*u.shape[:-2], longer, u.shape[-1]), u[..., -1:, :]], axis=-2)
