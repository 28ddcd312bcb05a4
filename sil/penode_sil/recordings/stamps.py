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
Index = NDArray[np.int64]
STEPS = sorted({m * 10.0**-k for m in (1, 2, 5) for k in range(-1, 10)} | {2.0**-k for k in range(-3, 31)}, reverse=True)


@dataclass(frozen=True)
class Rules:
    """What makes coarse stamps of a regular clock."""

    coarse: float = 0.05  # of an interval: stamps in finer steps are as good as exact
    off: float = 0.1  # of a step: stamps that all are so near to multiples of it are in such steps; by chance with 0.2^n
    slack: float = 0.05  # of a step or interval beyond rounding: what printing in other digits adds
    most: float = 100.0  # rows that share a stamp
    jitter: float = (
        0.25  # of an interval beyond rounding: a row that is lost moves all later ones by a whole one, half of it to either side
    )
    nearer: float = 1.0  # squares of a step that a lost row must explain: half of the rows of one stamp alone explain 1/4
    lost: int = 64  # places at which rows are lost
    patience: int = 5  # places that are tried together
    further: float = 20.0  # intervals and steps from which on a gap is so long that a clock may have started anew
    gap: float = 1.5  # intervals beyond a step of the stamps from which on rows are missing
    rare: float = 0.02  # of the intervals: so few that differ from the others are faults, not rounding
    huge: float = 1e12  # [s] what is later is no time
    least: int = 16  # rows that show a clock
    sure: float = 5.0  # standard deviations; chance 3e-7


RULES = Rules()


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
    if time.size < RULES.least or not time[-1] > time[0]:
        return None
    usual = float(time[-1] - time[0]) / (time.size - 1)
    between = np.diff(time)
    if np.mean(np.abs(between - np.median(between)) > RULES.coarse * usual) < RULES.rare or np.max(np.abs(time)) > RULES.huge:
        return None  # as they are, but for some faults
    steps = _steps(time, usual)
    if np.max(steps) < RULES.coarse * usual:
        return None
    rows = _numbered(time, steps, usual)
    if np.max(rows.number) > 2 * time.size + 1e6:
        return None
    rows = _missed(rows, RULES.nearer * float(np.max(steps)) ** 2)
    off = rows.off
    if off > 0.5 * np.max(steps) + RULES.jitter * rows.slope or not rows.slope > 0.0:
        return None
    jitter = off - 0.5 * float(np.max(steps))
    return Evened(rows.even, float(np.max(steps)), rows.slope, off, jitter if jitter > RULES.slack * rows.slope else 0.0)


class _Rows:
    """Stamps [n, s] over the numbers [n] of their rows on a regular clock, which starts anew in each part [n], 0, 1, ..."""

    def __init__(self, time: Array, number: Array, part: Index):
        self.time, self.number, self.part = time, number, part
        self.size = np.bincount(part)
        self.centred = self._centred(number)
        square = float(self.centred @ self.centred)
        self.slope = float(self.centred @ (time - time[0]) / square) if square > 0.0 else 0.0
        self.rest = self._centred(time - self.slope * number)

    def _centred(self, values: Array) -> Array:
        values = values - values[0]
        return values - (np.bincount(self.part, values) / self.size)[self.part]

    @property
    def squares(self) -> float:
        """Sum of squared distances of the stamps from the lines."""
        return float(self.rest @ self.rest)

    def _range(self) -> tuple[Array, Array]:
        starts = np.concatenate(([0], np.cumsum(self.size)[:-1]))
        return np.minimum.reduceat(self.rest, starts), np.maximum.reduceat(self.rest, starts)

    @property
    def off(self) -> float:
        """Largest distance of a stamp from the line in the middle of all of its part [s]."""
        low, high = self._range()
        return float(np.max(0.5 * (high - low)))

    @property
    def even(self) -> Array:
        """The times of the rows on these lines [n, s]."""
        low, high = self._range()
        return self.time - self.rest + (0.5 * (low + high))[self.part]

    def shifted(self, row: int, count: int) -> _Rows:
        """The same with rows behind one up to the end of its part that many further on."""
        behind = (np.arange(self.time.size) > row) & (self.part == self.part[row])
        return _Rows(self.time, self.number + count * behind, self.part)

    def nearer(self) -> tuple[int, int]:
        """The row behind which one that was lost explains most, or (-1) one less."""
        ahead = np.arange(1, self.time.size + 1) - (np.cumsum(self.size) - self.size)[self.part]
        behind = self.size[self.part] - ahead
        # all rows behind one, but for what level and slope make of them
        square = behind * ahead / self.size[self.part]
        square = square - np.cumsum(self.centred) ** 2 / max(float(self.centred @ self.centred), 1e-300)
        along = 2.0 * np.cumsum(self.rest) * self.slope  # of each part they sum up to 0
        more, less = (square * self.slope**2 + sign * along for sign in (1.0, -1.0))
        less = np.where(np.append(np.diff(self.number) >= 2.0, False), less, np.inf)
        low = [(int(np.argmin(x)), count) for x, count in ((more, 1), (less, -1))]
        return min(low, key=lambda found: (more if found[1] > 0 else less)[found[0]])


def _numbered(time: Array, steps: Array, usual: float) -> _Rows:
    """Each row's number, by whole rows where stamps show a gap, anew behind a long one; `usual` [s] is the mean interval."""
    between, coarse = np.diff(time), np.maximum(steps[:-1], steps[1:])
    for _ in range(2):  # a gap makes the mean too long
        gap = between > RULES.gap * usual + (1.0 + RULES.slack) * coarse
        kept = float(np.mean(between[~gap])) if not gap.all() else 0.0
        usual = kept if kept > 0.0 else usual
    number = np.concatenate(([0.0], np.cumsum(np.where(gap, np.maximum(1.0, np.rint(between / usual)), 1.0))))
    part = np.concatenate(([0], np.cumsum(between > RULES.further * (usual + coarse))))
    return _Rows(time, number, part)


def _missed(rows: _Rows, worth: float) -> _Rows:
    """Rows that were lost here and there, each of which lessens the squares by `worth`, but together: one of several alone need not."""
    best, least, since = rows, rows.squares, 0
    moves: list[tuple[int, int]] = []
    for _ in range(RULES.lost):
        row, count = rows.nearer()
        moves.append((row, count))
        rows = rows.shifted(row, count)
        for k, (row, count) in enumerate(moves[:-1] if len(moves) <= RULES.patience else []):  # with the others known
            rows = rows.shifted(row, -count)
            moves[k] = rows.nearer()
            rows = rows.shifted(*moves[k])
        if rows.squares + worth * len(moves) < least and np.all(np.diff(rows.number) >= 1.0):
            best, least, since = rows, rows.squares + worth * len(moves), len(moves)
        elif len(moves) - since >= RULES.patience:
            break
    return best


def _steps(time: Array, usual: float) -> Array:
    """The step [n, s] in which each stamp is written: a fixed one, so many digits, or single precision; 0 if it is fine."""
    found = np.zeros(time.size)
    for given in (time, time - time[0]):
        for step in STEPS:
            if step < RULES.coarse * usual:
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
    return bool(np.max(step) < RULES.most * usual and np.all(off < RULES.off * step))


def sampled_evenly(time: Array, even: Array, columns: list[Array]) -> bool:
    """Were rows whose stamps [n, s] scatter around a regular clock [n, s] sampled by it? Each row is predicted by a cubic through the
    two before and after it, by either time: where stamps are only late, the regular one is nearer more often than by chance. Of fewer
    than five rows, none has two on either side."""
    better, worse = 0, 0
    for values in columns if time.size > 4 else []:
        own, regular = (np.abs(values[2:-2] - predicted(t, values)) for t in (time, even))
        better += int(np.sum(regular < own))
        worse += int(np.sum(regular > own))
    # errors of neighbours share rows: a quarter of them count
    return better - worse > RULES.sure * 2.0 * np.sqrt(better + worse) if better + worse else False


def predicted(time: Array, values: Array) -> Array:
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
