# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a row of a table is: which rows of a channel were measured, and when.

A table on one time base holds channels of other clocks: it repeats the last value (held), joins samples by straight lines,
or leaves cells empty. Only the samples themselves are measurements; what lies between them is made up by the logger. Each of
these leaves marks at regular instants: new values, kinks of the lines, cells with a value. Where marks stand only there,
and chance would not have put them there, the channel has a clock of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len, rfft
from scipy.linalg import solveh_banded
from scipy.special import rel_entr

from .quality import quantisation

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Rules:
    """What makes a clock of marks, and samples of its instants."""

    chance: float = 1e-6  # that rows which have nothing to do with a clock show one, in a whole channel
    fewest: int = 20  # marks; fewer do not make a clock
    exact: float = 0.95  # share of the marks that must stand at the clock: a few are faults of the sensor itself
    slower: float = 1.05  # rows per sample from which on a clock is another one than that of the rows
    searched: int = 4096  # rows in which a clock is looked for, before it is followed to the end of the recording
    fine: int = 8  # bins per row in which its frequency is looked for
    padded: int = 8  # times the length of the rows: a frequency is then known to 1/32 of a turn over all of them
    stands_out: float = 30.0  # times the mean that a line of a clock has in the spectrum of the marks; noise reaches it with exp(-30) a bin
    tried: int = 24  # frequencies, the slowest of those that stand out, for the others are their multiples
    stamped: float = 0.2  # of its interval: a clock with stamps of its own is as near to regular instants
    alike: float = 0.8  # share of kinks or steps of one size from which on they are of a square, a ramp or a triangle, not of samples
    double: float = 1e-11  # of the largest value, by which lines may be off that were computed in double precision
    rounded: float = 0.5  # of the last digit: RMS by which rounding moves a row off a line; 0.29 for one rounding, 0.41 for two


RULES = Rules()


@dataclass(frozen=True, eq=False)
class Samples:
    """The samples of a channel: the row that shows each first, its own instant [s] and its value in the units of the rows.

    `how`: "held", "lines", or "sparse" where the other cells are empty. `interval` [s] of the samples, `every` rows.
    """

    how: str
    rows: Index
    time: Array
    values: Array
    interval: float
    every: float


@dataclass(frozen=True)
class Raster:
    """Instants start + k*interval [s], and the logarithm of the chance that marks stand at them without a reason."""

    start: float
    interval: float
    surprise: float

    def instants(self, first: float, last: float) -> Array:
        """All instants from `first` to `last` [s], with those just outside."""
        low, high = (int(np.floor((t - self.start) / self.interval)) for t in (first, last))
        return self.start + np.arange(low, high + 2, dtype=float) * self.interval


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def own_samples(time: Array, values: Array, driving: bool = False) -> Samples | None:
    """The samples of a channel [n] at increasing times [n, s], NaN where a cell is empty; None if every row is one, or is lost at
    random. Of a channel that drives the model, lines stay lines."""
    finite = np.flatnonzero(np.isfinite(values))
    if finite.size < RULES.fewest:
        return None
    if finite.size < values.size and (sparse := _sparse(time, values, finite)) is not None:
        return sparse
    usual = _usual(time)
    time, values = time[finite], values[finite]
    found = _held(time, values) or (None if driving else _joined(time, values))
    if found is None:
        return None
    return Samples(found.how, finite[found.rows], found.time, found.values, found.interval, found.interval / usual)


def _usual(time: Array) -> float:
    """The mean interval [s] of rows, but for gaps; the median would be that of the fastest clock in a union of several."""
    between = np.diff(time)
    return float(np.mean(between[between <= 3.0 * np.median(between)]))


def _sparse(time: Array, values: Array, finite: Index) -> Samples | None:
    """The cells that have a value, if these are at instants of a clock (a union of clocks); its instants are those of the rows."""
    marks = np.zeros(time.size, dtype=bool)
    marks[finite] = True
    raster = regular(time, marks)
    if raster is None:
        return None
    at = raster.instants(time[0], time[-1])
    off = time[finite] - at[np.searchsorted(at, time[finite] - 0.5 * raster.interval).clip(0, at.size - 1)]
    if np.ptp(off) > RULES.stamped * raster.interval:
        return None  # every tenth cell is lost: that is no clock of nine rows in ten
    return Samples("sparse", finite, time[finite], values[finite], raster.interval, raster.interval / _usual(time))


def _held(time: Array, values: Array) -> Samples | None:
    """The rows that show a new value, if there are new values only at instants of a clock."""
    marks = np.concatenate(([False], np.diff(values) != 0.0))  # nobody knows since when the first one is held
    raster = regular(time, marks)
    if raster is None:
        return None
    rows = _Marks(time, marks).rows(raster)
    if np.mean(marks[rows]) > 0.9 and _of_one_size(np.diff(values)[marks[1:]]):
        return None  # a ramp in steps of a quantum, a square wave: it makes as even a pattern by itself
    at = raster.instants(time[0], time[-1])
    # each was taken after the row before, and no later than the one that shows it first
    near = at[np.searchsorted(at, time[rows] + 1e-6 * raster.interval).clip(1, at.size) - 1]
    before = np.where(rows > 0, time[rows - 1], -np.inf)
    instants = np.where(near > before + 1e-6 * raster.interval, near, time[rows])
    return Samples("held", rows, instants, values[rows], raster.interval, raster.interval / _usual(time))


def _of_one_size(steps: Array) -> bool:
    """Are most steps of one size, up or down? Samples of a signal with noise are not."""
    size = np.abs(steps)
    if not size.size:
        return True
    middle = np.median(size)
    return bool(np.mean(np.abs(size - middle) < 1e-3 * middle) > RULES.alike)


# -- clocks of marks ---------------------------------------------------------------------------------------------------


def regular(time: Array, marks: Flags, wide: bool = False) -> Raster | None:
    """The clock at whose instants alone the rows [n] have marks: in the first row at or after each, or, if `wide`, also in the row
    before. None if there is none, or it is as fast as the rows.

    If marks had nothing to do with a clock, every choice of so many rows would be as likely: how many of them are rows of the
    clock would follow the hypergeometric distribution, whose tail Hoeffding's bound is above. Some n^2 clocks differ in n rows,
    of which one is chosen.
    """
    count = int(np.sum(marks))
    if count < RULES.fewest or count > time.size / RULES.slower:
        return None
    some = slice(0, RULES.searched if np.sum(marks[: RULES.searched]) >= RULES.fewest else time.size)
    first = _Marks(time[some], marks[some], wide)
    least = first.usual * (2.0 if wide else RULES.slower)  # lines show their corners if two rows lie on each
    found = [first.clock(interval) for interval in first.intervals() if interval > 0.99 * least]
    if not found:
        return None
    best = min(found, key=lambda r: r.surprise)
    size = first.time.size
    while size < time.size and best.surprise < _rare(size):  # followed to the end, while it may still be one
        size = min(2 * size, time.size)
        best = _Marks(time[:size], marks[:size], wide).refined(best)
    if best.interval <= 0.99 * least or best.surprise >= _rare(size):
        return None
    caught = np.sum(marks[_Marks(time, marks, wide).rows(best)])
    return best if caught >= RULES.exact * count else None


def _rare(rows: int) -> float:
    """The surprise below which marks of so many rows follow a clock."""
    return float(np.log(RULES.chance) - 2.0 * np.log(rows))


class _Marks:
    """Rows at increasing times [n, s], some of them with a mark."""

    def __init__(self, time: Array, marks: Flags, wide: bool = False):
        self.time, self.marks, self.wide = time, marks, wide
        self.usual, self.at = _usual(time), time[marks]

    def intervals(self) -> list[float]:
        """Intervals that the marks may have, by what stands out of their spectrum over the rows'."""
        place = np.rint((self.time - self.time[0]) / self.usual * RULES.fine)
        if place[-1] > 64 * RULES.fine * self.time.size:
            return []
        density = np.bincount(place.astype(np.int64), weights=self.marks - np.mean(self.marks))
        size = next_fast_len(RULES.padded * density.size, real=True)
        power = np.abs(rfft(density, size)) ** 2
        top = min(int(size / (RULES.fine * RULES.slower)), power.size - 2)
        inner = power[1 : top + 1]
        peak = 1 + np.flatnonzero((inner >= power[:top]) & (inner >= power[2 : top + 2]) & (inner > 0.2 * np.max(inner, initial=0.0)))
        if not peak.size or np.max(power[peak]) < RULES.stands_out * np.mean(inner):
            return []
        left, here, right = (power[peak + k] for k in (-1, 0, 1))
        exact = peak + 0.5 * (left - right) / (left - 2.0 * here + right - 1e-300)
        found: list[float] = (size / RULES.fine * self.usual / exact[exact > RULES.padded][: RULES.tried]).tolist()
        return found

    def clock(self, interval: float) -> Raster:
        """The clock of about this interval that catches most marks."""
        turn = np.exp(2j * np.pi * (self.at - self.time[0]) / interval)
        start = float(self.time[0] + np.angle(np.mean(turn)) / (2.0 * np.pi) * interval)
        return self.refined(Raster(start, interval, 0.0))

    def refined(self, raster: Raster) -> Raster:
        """The clock moved to the marks: the interval by the line through most of them, the start where it catches most."""
        tick, at = np.rint((self.at - raster.start) / raster.interval), self.at
        slope = raster.interval
        for near in (0.5 * raster.interval, 2.0 * self.usual, 1.05 * self.usual, None, None):
            if at.size < RULES.fewest or np.ptp(tick) == 0.0:
                return raster
            line = np.polynomial.polynomial.polyfit(tick, at - raster.start, 1)
            slope = float(line[1])
            off = np.abs(at - raster.start - line[0] - slope * tick)
            kept = off <= (near or 4.0 * np.median(off) + 1e-9 * self.usual)  # marks spread over one row at the most
            tick, at = tick[kept], at[kept]
        found = Raster(self._start(raster.start, slope), slope, 0.0)
        old = Raster(raster.start, raster.interval, self.surprise(raster))
        new = Raster(found.start, found.interval, self.surprise(found))
        return new if new.surprise < 0.99 * old.surprise or old.surprise == 0.0 else old

    def _start(self, origin: float, interval: float) -> float:
        """The latest start at which most marks are caught: each is by the instants since the row before it."""
        rows = np.flatnonzero(self.marks)
        before = self.time[np.maximum(rows - 1, 0)]
        after = self.time[np.minimum(rows + 1, self.time.size - 1)] if self.wide else self.at
        near = 1e-3 * self.usual
        low, high = before + near, after + near
        place = np.concatenate([low, high]) - origin
        change = np.repeat([1.0, -1.0], rows.size)
        wraps = np.floor(place[rows.size :] / interval) - np.floor(place[: rows.size] / interval)
        place = place % interval
        order = np.lexsort((change, place))
        caught = np.cumsum(change[order]) + np.sum(wraps)
        k = int(np.argmax(caught))
        end = place[order[(k + 1) % order.size]] + (interval if k + 1 == order.size else 0.0)
        if self.wide:
            end = 0.5 * (end + place[order[k]])
        return origin + float(end) - (0.0 if self.wide else near)

    def rows(self, raster: Raster) -> Index:
        """The first row at or after each instant, once; if `wide`, with the row before, unless the instant is that of the row."""
        near = 1e-3 * self.usual
        at = raster.instants(self.time[0], self.time[-1])
        rows = np.searchsorted(self.time, at - near)
        inside = (rows < self.time.size) & (at > self.time[0] - raster.interval)
        rows, at = rows[inside], at[inside]
        flags = np.zeros(self.time.size, dtype=bool)
        flags[rows] = True
        if self.wide:
            flags[rows[(rows > 0) & (self.time[rows] > at + near)] - 1] = True
        return np.flatnonzero(flags)

    def surprise(self, raster: Raster) -> float:
        """Logarithm of (a bound of) the chance that so many marks stand at the clock without a reason."""
        rows, count = self.rows(raster), self.at.size
        seen, expected = float(np.sum(self.marks[rows])) / max(count, 1), rows.size / self.time.size
        if seen <= expected:
            return 0.0
        return -count * float(rel_entr(seen, expected) + rel_entr(1.0 - seen, 1.0 - expected))


# -- straight lines ----------------------------------------------------------------------------------------------------


def grain(values: Array) -> Array:
    """How finely each value [n] is written: the last of so many digits or decimals that all of them have, single precision, or
    the step of the sensor; the coarsest of these that holds for all."""
    size = np.abs(values)
    fine = np.full(values.size, RULES.double * np.max(size))
    single = values.astype(np.float32)
    if np.array_equal(single.astype(np.float64), values):
        fine = np.maximum(fine, np.spacing(np.abs(single)).astype(np.float64))
    some = values[:: max(1, values.size // 4096)]
    other = np.abs(some[some != 0.0])
    exponent = np.floor(np.log10(other))
    for digits in range(3, 16):
        scaled = other * 10.0 ** (digits - 1.0 - exponent)
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-12 * scaled + 1e-6):
            with np.errstate(divide="ignore"):
                last = 10.0 ** (np.floor(np.log10(np.where(size > 0.0, size, np.min(other)))) - digits + 1.0)
            fine = np.maximum(fine, last)
            break
    for decimals in range(-2, 16):
        scaled = some * 10.0**decimals
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-9 + 4e-16 * np.abs(scaled)):
            fine = np.maximum(fine, 10.0**-decimals)
            break
    found: Array = np.maximum(fine, quantisation(values))
    return found


def _unsure(time: Array) -> Array:
    """How far a time may be from that at which a line was taken: a time whose last digits are zeros is exact."""
    found: Array = np.minimum(grain(time), 1e-8 * max(abs(time[0]), abs(time[-1])))
    return found


def _joined(time: Array, values: Array) -> Samples | None:
    """The corners of straight lines through the rows, if these stand at instants of a clock: between them the rows lie on the lines
    to the last digit."""
    if values.size < 4 * RULES.fewest or np.ptp(values) == 0.0:
        return None
    slope = np.abs(np.gradient(values, time))
    fine = np.hypot(grain(values), np.maximum(slope, np.roll(slope, 1)) * _unsure(time))
    before, after = np.diff(time)[:-1], np.diff(time)[1:]
    bend = np.zeros(values.size)
    bend[1:-1] = values[1:-1] - (values[:-2] * after + values[2:] * before) / (before + after)
    marks = np.abs(bend) > 1.01 * np.maximum(fine, np.maximum(np.roll(fine, 1), np.roll(fine, -1)))
    for wide in (False, True):
        raster = regular(time, marks, wide)
        if raster is None or _of_one_size(bend[marks]):
            continue
        lines = _fitted(time, values, raster, fine)
        if lines is not None:
            return lines
    return None


def _fitted(time: Array, values: Array, raster: Raster, fine: Array) -> Samples | None:
    """Lines between instants near those of a clock, fitted to the rows; None if they miss them by more than rounding."""
    usual, best, size = _usual(time), raster, RULES.searched
    while True:
        part = slice(0, size)
        best, loss = _nearer(time[part], values[part], best, fine[part], 0.6 * usual)
        if loss > RULES.rounded:
            return None
        if size >= time.size:
            found = _Lines(time, values, best, fine).samples()
            return found if found.rows.size >= RULES.fewest else None
        size *= 2


def _nearer(time: Array, values: Array, raster: Raster, fine: Array, reach: float) -> tuple[Raster, float]:
    """The clock whose lines miss the rows least, both ends within `reach` [s] of those of the given one, and by how much."""
    best, loss, least = raster, _Lines(time, values, raster, fine).loss, 1e-10 * reach
    middle = time[0] + 0.5 * (time[-1] - time[0])
    span = (time[-1] - time[0]) / raster.interval
    while reach > least and loss > RULES.rounded:
        tries = []
        for move, turn in ((a, b) for a in (-1.0, 0.0, 1.0) for b in (-1.0, 0.0, 1.0) if a or b):
            interval = best.interval + turn * reach / span
            ticks = np.rint((middle - best.start) / best.interval)
            start = best.start + move * reach + ticks * (best.interval - interval)
            tries.append(Raster(start, interval, 0.0))
        losses = [_Lines(time, values, r, fine).loss for r in tries]
        k = int(np.argmin(losses))
        if losses[k] < loss:
            best, loss = tries[k], losses[k]
        else:
            reach *= 0.5
    return best, loss


class _Lines:
    """Straight lines between the instants of a clock, by least squares through all rows."""

    def __init__(self, time: Array, values: Array, raster: Raster, fine: Array):
        self.time, self.given, self.raster = time, values, raster
        self.at = raster.instants(time[0], time[-1])
        self.low = np.searchsorted(self.at, time + 1e-9 * raster.interval).clip(1, self.at.size - 1) - 1
        self.share = (time - self.at[self.low]) / raster.interval
        weight = 1.0 / fine**2
        diagonal, right = np.zeros(self.at.size), np.zeros(self.at.size)
        u = self.share
        middle = float(np.mean(values))
        size = self.at.size
        for k, share in ((self.low, 1.0 - u), (self.low + 1, u)):
            diagonal += np.bincount(k, weight * share**2, size)
            right += np.bincount(k, weight * share * (values - middle), size)
        beside = np.bincount(self.low + 1, weight * u * (1.0 - u), size)
        diagonal = np.where(diagonal > 0.0, diagonal * (1.0 + 1e-13), 1.0)  # corners that no row shows
        self.values = solveh_banded(np.stack([beside, diagonal]), right) + middle
        off = values - (1.0 - u) * self.values[self.low] - u * self.values[self.low + 1]
        self.loss = float(np.sqrt(np.mean((off / fine) ** 2)))  # RMS in last digits

    def samples(self) -> Samples:
        """The corners that rows show: in a row, or where two lines meet of which each has two rows."""
        usual = _usual(self.time)
        rows = np.searchsorted(self.time, self.at - 1e-3 * usual).clip(0, self.time.size - 1)
        exact = np.abs(self.time[rows] - self.at) <= 1e-3 * usual
        inner = (self.share > 1e-3) & (self.share < 1.0 - 1e-3)
        count = np.bincount(self.low[inner], minlength=self.at.size + 1)
        count = count[: self.at.size]
        met = np.concatenate(([False], (count[:-1] >= 2) & (count[1:] >= 2)))
        shown = exact | met
        values = np.where(exact, self.given[rows], self.values)
        every = self.raster.interval / usual
        return Samples("lines", rows[shown], self.at[shown], values[shown], self.raster.interval, every)
