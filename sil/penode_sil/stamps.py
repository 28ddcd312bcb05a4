# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Time stamps that are coarser than the rows: of 10 ms or of six digits at rows of 2 ms, seconds in single precision.

Rows of a regular clock, rounded, lie within half a step of their stamps on a straight line over their numbers. Where they do,
the line is the better clock.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
COARSE = 0.05  # of an interval: stamps in finer steps are as good as exact
OFF = 0.1  # of a step: stamps that all are so near to multiples of it are in such steps; by chance with 0.2^n
SLACK = 0.05  # of a step or interval beyond rounding: what printing in other digits adds
MOST = 100.0  # rows that share a stamp
JITTER = 0.25  # of an interval beyond rounding: a row that is lost moves all later ones by a whole one, half of it to either side
NEARER = 1.0  # squares of a step that a lost row must explain: half of the rows of one stamp alone explain 1/4
LOST = 64  # places at which rows are lost
GAP = 1.5  # intervals beyond a step of the stamps from which on rows are missing
RARE = 0.02  # of the intervals: so few that differ from the others are faults, not rounding
HUGE = 1e12  # [s] what is later is no time
LEAST = 16  # rows that show a clock
SURE = 5.0  # standard deviations; chance 3e-7
STEPS = sorted({m * 10.0**-k for m in (1, 2, 5) for k in range(-1, 10)} | {2.0**-k for k in range(-3, 31)}, reverse=True)


@dataclass(frozen=True, eq=False)
class Evened:
    """Times [n, s] of rows spread evenly, the steps of their stamps [s], the rows' interval [s], how far stamps are off [s], and how
    much of that is more than rounding (jitter) [s]."""

    time: Array
    step: float
    interval: float
    off: float
    jitter: float

    @property
    def note(self) -> str:
        """What was done, for people."""
        rest = f"{1e3 * self.jitter:.3g} ms more than rounding" if self.jitter > 0.0 else "no more than rounding"
        return (
            f"time stamps are in steps of {1e3 * self.step:.6g} ms, rows {1e3 * self.interval:.6g} ms apart; rows are spread evenly, "
            f"from which stamps are up to {1e3 * self.off:.3g} ms off ({rest})"
        )


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def evened(time: Array) -> Evened | None:
    """Rows spread evenly whose stamps [n, s], which never go back, are in coarser steps; None if stamps are fine, or of no clock."""
    if time.size < LEAST or not time[-1] > time[0]:
        return None
    usual = float(time[-1] - time[0]) / (time.size - 1)
    between = np.diff(time)
    if np.mean(np.abs(between - np.median(between)) > COARSE * usual) < RARE or np.max(np.abs(time)) > HUGE:
        return None  # as they are, but for some faults
    steps = _steps(time, usual)
    if np.max(steps) < COARSE * usual:
        return None
    number = _numbers(time, steps, usual)
    slope, level, off = _line(time, number)
    for _ in range(LOST):  # rows that are lost here and there
        rest = np.cumsum(time - slope * number - np.mean(time - slope * number))
        tries = [(number + n * (np.arange(time.size) > k)) for n, k in ((1, int(np.argmin(rest))), (-1, int(np.argmax(rest))))]
        tries = [t for t in tries if np.all(np.diff(t) >= 1)] or [number]
        squares = [_squares(time, t) for t in (number, *tries)]
        if min(squares) > squares[0] - NEARER * np.max(steps) ** 2:
            break
        number = tries[int(np.argmin(squares[1:]))]
        slope, level, off = _line(time, number)
    if off > 0.5 * np.max(steps) + JITTER * slope or not slope > 0.0 or number[-1] > 2 * time.size + 1e6:
        return None
    jitter = off - 0.5 * float(np.max(steps))
    return Evened(level + slope * number, float(np.max(steps)), slope, off, jitter if jitter > SLACK * slope else 0.0)


def _numbers(time: Array, steps: Array, usual: float) -> Array:
    """The number of each row on a regular clock, by whole rows where stamps show a gap; `usual` [s] is the mean interval."""
    between = np.diff(time)
    for _ in range(2):  # a gap makes the mean too long
        gap = between > GAP * usual + (1.0 + SLACK) * np.maximum(steps[:-1], steps[1:])
        kept = float(np.mean(between[~gap])) if not gap.all() else 0.0
        usual = kept if kept > 0.0 else usual
    return np.concatenate(([0.0], np.cumsum(np.where(gap, np.maximum(1.0, np.rint(between / usual)), 1.0))))


def _line(time: Array, number: Array) -> tuple[float, float, float]:
    """Slope and level of the line through times over their numbers, and the largest distance from it, half of the range."""
    centred = number - np.mean(number)
    slope = float(centred @ (time - time[0]) / (centred @ centred))
    rest = time - slope * number
    low, high = float(np.min(rest)), float(np.max(rest))
    return slope, 0.5 * (low + high), 0.5 * (high - low)


def _squares(time: Array, number: Array) -> float:
    """Sum of the squares of what stamps are off the line."""
    slope = _line(time, number)[0]
    return float(time.size * np.var(time - slope * number))


def _steps(time: Array, usual: float) -> Array:
    """The step [n, s] in which each stamp is written: a fixed one, so many digits, or single precision; 0 if it is fine."""
    found = np.zeros(time.size)
    for given in (time, time - time[0]):
        for step in STEPS:
            if step < COARSE * usual:
                break
            if _multiples(given, np.full(time.size, step), usual):
                found = np.maximum(found, step)
                break
    size = np.abs(time)
    with np.errstate(divide="ignore"):
        exponent = np.floor(np.log10(np.where(size > 0.0, size, np.max(size))))
    for digits in range(3, 13):
        if _multiples(time, 10.0 ** (exponent - digits + 1.0), usual):
            found = np.maximum(found, 10.0 ** (exponent - digits + 1.0))
            break
    single = np.abs(np.spacing(time.astype(np.float32))).astype(np.float64)
    return np.maximum(found, single) if _multiples(time, single, usual) else found


def _multiples(values: Array, step: Array, usual: float) -> bool:
    off = np.abs(values - np.rint(values / step) * step)
    return bool(np.max(step) < MOST * usual and np.all(off < OFF * step))


def sampled_evenly(time: Array, even: Array, columns: list[Array]) -> bool:
    """Were rows whose stamps [n, s] scatter around a regular clock [n, s] sampled by it? Each row is foretold by a cubic through the
    two before and after it, by either time: where stamps are only late, the regular one is nearer more often than by chance."""
    better, worse = 0, 0
    for values in columns:
        own, regular = (np.abs(values[2:-2] - _foretold(t, values)) for t in (time, even))
        better += int(np.sum(regular < own))
        worse += int(np.sum(regular > own))
    # errors of neighbours share rows: a quarter of them count
    return better - worse > SURE * 2.0 * np.sqrt(better + worse) if better + worse else False


def _foretold(time: Array, values: Array) -> Array:
    """Values [n - 4] by Lagrange's cubic through the two rows before and after; NaN beside a row without a value."""
    n = values.size
    index = [slice(k, n - 4 + k) for k in (0, 1, 3, 4)]
    here = time[2 : n - 2]
    total = np.zeros(n - 4)
    for i in index:
        weight = np.ones(n - 4)
        for j in index:
            if j is not i:
                weight = weight * (here - time[j]) / (time[i] - time[j])
        total += weight * values[i]
    return total
