# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rows whose intervals differ, because a logger polls, or because rows are lost: what is a gap among them, and values at other instants.

A sensor counts where it was measured: at the instant nearest to a row, moved there along the signal's own course. So its noise stays
that of a row, and neighbours share none of it. An input, which has to be known everywhere, is joined between its rows, by a smooth curve
or straight lines, whichever predicts rows better from those around them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from .stamps import RULES, predicted

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


def longest(between: Array, gap: float) -> float:
    """The longest interval [s] that is no gap among intervals [n, s]: `gap` times the usual one, or, where more than one
    in ten is long, what is likely in so many intervals of a clock whose long ones are spread like those here."""
    if not between.size:
        return np.inf
    middle, edge = (float(x) for x in np.quantile(between, (0.5, 0.9), method="lower"))
    scale = (edge - middle) / np.log(
        5.0
    )  # of an exponential tail that starts at the median: nine in ten rows are no evidence of a rare gap
    if scale == 0.0:
        return gap * middle
    # a longer one comes by chance in one of 400 recordings; quantiles of intervals that are whole rows are off by one
    return float(max(gap * middle, edge + middle + scale * (np.log(0.1 * between.size) + 6.0)))


def mean_interval(between: Array, gap: float) -> float:
    """The mean of the intervals [n, s] but for gaps."""
    return float(np.mean(between[between <= longest(between, gap)]))


def joined(time: Array, values: Array, at: Array) -> Array:
    """A signal of rows at increasing times [n, s] at other instants between them [m, s]; beyond them, the first and the last value."""
    nodes, means, _ = _merged(time, values, 0.3 * float(np.median(np.diff(time))) if time.size > 1 else 0.0)
    size = float(np.max(np.abs(means)))
    inner = means[2:-2]
    if inner.size <= 1 or size == 0.0:
        return np.interp(at, time, values)
    by_curve = (inner - predicted(nodes, means)) / size
    share = (nodes[2:-2] - nodes[1:-3]) / (nodes[3:-1] - nodes[1:-3])
    by_lines = (inner - (means[1:-3] * (1.0 - share) + means[3:-1] * share)) / size
    if float(by_curve @ by_curve) >= float(by_lines @ by_lines):
        return np.interp(at, time, values)
    curve: Array = CubicSpline(nodes, means)(np.clip(at, time[0], time[-1]))
    return curve


def measured_near(raster: Array, step: float, time: Array, values: Array, still: float) -> tuple[Array, Flags]:
    """Rows at increasing times [n, s] at the instants [m, s] of a raster `step` [s] apart: the mean of those within half a step, moved to
    the instant along a parabola through the rows around; elsewhere straight lines. True where there is such a row. One within
    `still` [s] needs no others around it."""
    out = np.interp(raster, time, values)
    usable = np.zeros(raster.size, dtype=bool)
    cells = np.rint((time - raster[0]) / step).astype(np.int64)
    inside = (cells >= 0) & (cells < raster.size)
    if not inside.any():
        return out, usable
    _, first, count = np.unique(cells[inside], return_index=True, return_counts=True)
    nodes = np.add.reduceat(time[inside], first) / count
    means = np.add.reduceat(values[inside], first) / count
    cell = cells[inside][first]
    off = raster[cell] - nodes
    usual = max(step, float(np.median(np.diff(nodes))) if nodes.size > 1 else step)
    move, known = _along(nodes, means, count.astype(float), off, usual)
    known |= np.abs(off) <= still
    out[cell] = np.where(known, means + move, out[cell])
    usable[cell[known]] = True
    return out, usable


def _merged(time: Array, values: Array, near: float) -> tuple[Array, Array, Array]:
    """Rows nearer to each other than `near` [s] made one, by means: times, values and how many rows each is."""
    count = np.ones(time.size)
    while time.size > 1:
        close = np.diff(time) < near
        close &= ~np.concatenate(([False], close[:-1]))  # each with one other
        if not close.any():
            break
        first = np.concatenate(([0], 1 + np.flatnonzero(~close)))
        total = np.add.reduceat(count, first)
        time, values = (np.add.reduceat(count * x, first) / total for x in (time, values))
        count = total
    return time, values, count


def _along(time: Array, values: Array, count: Array, off: Array, usual: float) -> tuple[Array, Flags]:
    """By how much a signal moves from each row [n] to the instant `off` [n, s] beside it, by a parabola through the rows around, each with
    the weight of those that it is made of; and where that is known."""
    around = np.arange(time.size)[:, None] + np.arange(-2, 3)
    inside = (around >= 0) & (around < time.size)
    around = around.clip(0, time.size - 1)
    x = (time[around] - time[:, None]) / usual
    weight = np.where(inside, np.maximum(1.0 - (x / 4.0) ** 2, 0.0), 0.0) ** 2  # rows farther than 4 intervals have no weight
    powers = np.stack([np.ones_like(x), x, x**2], axis=-1)
    known = (np.count_nonzero(weight, axis=1) >= powers.shape[-1]) & (np.min(x, axis=1) < 0.0) & (np.max(x, axis=1) > 0.0)
    weight = weight * np.minimum(count[around], 4.0)
    square = np.einsum("nk,nki,nkj->nij", weight, powers, powers)
    square += 1e-6 * np.trace(square, axis1=1, axis2=2)[:, None, None] * np.diag([0.0, 0.0, 1.0])  # a bend that nothing shows is none
    square[~known] = np.eye(3)
    right = np.einsum("nk,nki,nk->ni", weight, powers, values[around] - values[:, None])
    bend = np.linalg.solve(square, right[:, :, None])[:, :, 0]
    u = off / usual
    return bend[:, 1] * u + bend[:, 2] * u**2, known


def row_numbers(time: Array, interval: float) -> NDArray[np.int64]:
    """The number of each row on a regular clock, from 0."""
    steps = np.maximum(1, np.round(np.diff(time) / interval).astype(np.int64))
    return np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(steps)))


def regular_clock(time: Array, interval: float) -> tuple[float, float, float]:
    """Start [s] and interval [s] of the regular clock nearest to the times; the largest distance, in intervals."""
    number = row_numbers(time, interval)
    if np.max(np.abs(time[0] + number * interval - time)) < 1e-3 * interval:
        return float(time[0]), interval, 0.0
    slope, start = np.polynomial.polynomial.polyfit(number, time - time[0], 1)[::-1]
    start += time[0]
    return float(start), float(slope), float(np.max(np.abs(start + number * slope - time)) / slope)


def held_rows(time: Array, raster: Array) -> NDArray[np.int64]:
    """The row [n] of a held channel that counts at each time of a raster [n, s], -1 before the first: the last one that is not later; or
    later by as much as time stamps are off a regular clock, so that the jitter of a logger delays no value by a whole row."""
    usual = float(np.median(np.diff(time))) if time.size > 1 else 0.0
    off = regular_clock(time, usual)[2] if usual > 0.0 else 0.0
    late = max(2.0 * off if off < RULES.jitter else 0.0, 1e-3) * usual  # a raster that begins at a row is off as well
    return np.searchsorted(time, raster + late, side="right") - 1
