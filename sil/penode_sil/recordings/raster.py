# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Clocks of recordings, and samples taken from them to the raster of a model."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from .resampling import Kernel
from .stamps import evened, sampled_evenly
from .table import GAP, Recording, more
from .uneven import held_rows, joined, longest, mean_interval, measured_near, regular_clock, row_numbers

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
BRIDGE = 3  # missing samples of an input that a straight line may bridge
SHORTEST = 100  # samples on the model's raster; fewer are no evidence about a model
SCATTER = 0.05  # of an interval: time stamps that are off by less are taken as those of a regular clock
SPILL = 0.1  # a filtered sample is bad if bad samples have more than this share of its weights


class TooShort(RecordingError):
    """A recording with less than SHORTEST samples."""


@dataclass(frozen=True, eq=False)
class Clock:
    """The rows of a table that have a time of their own, in order; parts [first, last) between gaps, which are longer than `bridge` [s].

    Where rows are not `even`, no regular clock was there; `interval` [s] is then the mean.
    """

    rows: NDArray[np.int64]
    time: Array
    interval: float
    parts: list[tuple[int, int]]
    bridge: float
    even: bool = True

    @property
    def uneven(self) -> Array | None:
        """The times of the rows [n, s], None if all are one interval apart."""
        return None if self.even and np.all(np.diff(self.time) <= GAP * self.interval) else self.time

    def one_by_one(self, step: float) -> bool:
        """Are its rows taken as they are on a raster `step` [s] apart, for they are about as fast, or uneven and not much faster?"""
        return abs(self.interval - step) <= SCATTER * step if self.even else GAP * self.interval >= step


def clock_of(table: Recording, notes: list[str]) -> Clock:
    """Rows in the order of time, each time once; what had to be done is noted. UserError if that makes no clock."""
    time = table.channel("time", "s", finite=False)
    rows = np.flatnonzero(np.isfinite(time))
    if rows.size < time.size:
        bad = np.flatnonzero(~np.isfinite(time))
        notes.append(f"{table.place(bad[0])}: channel time has no value there{more(bad.size)}; such rows are left out")
    found = table.ordered(rows)
    notes += [found.note] if found.note else []
    time = time.copy()
    time[rows[found.rows]] = found.time
    rows = rows[found.rows]
    if (even := evened(time[rows])) is not None:
        notes.append(f"{table.path}: {even.note}")
        time[rows] = even.time
    again = np.flatnonzero(np.diff(time[rows]) == 0.0)
    if again.size:
        notes.append(
            f"{table.place(rows[again[0] + 1])}: channel time has the same value as the row before{more(again.size)}; "
            "the first of such rows counts"
        )
        rows = np.delete(rows, again + 1)
    if rows.size < 2:
        raise TooShort(f"{table.path}: it has {rows.size} rows with a time of their own; record at least {SHORTEST}")
    clock = parted(rows, time[rows])
    steps = np.diff(clock.time)
    gaps = np.flatnonzero(steps > max(GAP * clock.interval, longest(steps, GAP)))
    if gaps.size:
        notes.append(
            f"{table.place(rows[gaps[0] + 1])}: channel time has a gap of {steps[gaps[0]]:.6g} s before that row "
            f"(rows are usually {clock.interval:.6g} s apart){more(gaps.size)}; no sample there is used"
        )
    return clock


def parted(rows: NDArray[np.int64], time: Array) -> Clock:
    """The clock of rows at increasing times [s], parted at its gaps."""
    between = np.diff(time)
    bridge = longest(between, BRIDGE + GAP)
    cuts = np.flatnonzero(between > bridge) + 1
    bounds = [0, *cuts.tolist(), rows.size]
    parts = [(a, b) for a, b in itertools.pairwise(bounds) if b - a > 1]
    usual = float(np.median(between))
    lengths = [int(row_numbers(time[a:b], usual)[-1]) for a, b in parts]
    interval = sum(float(time[b - 1] - time[a]) for a, b in parts) / sum(lengths) if sum(lengths) else usual
    found = Clock(rows, time, interval, parts, bridge)
    if scatter(found) > 0.5:  # whatever rows are lost
        return replace(found, interval=mean_interval(between, BRIDGE + GAP), even=False)
    return found


def scatter(clock: Clock) -> float:
    """The largest distance of a stamp from a regular clock, in intervals."""
    return max((regular_clock(clock.time[a:b], clock.interval)[2] for a, b in clock.parts), default=0.0)


def steadied(clock: Clock, place: str, columns: list[Array], notes: list[str]) -> Clock:
    """The clock on its regular instants if its stamps scatter by little, or if the columns [rows of the clock] were sampled there."""
    if not clock.even:
        low, high = 1e3 * np.quantile(np.diff(clock.time), (0.01, 0.99))
        notes.append(
            f"{place}: rows are unevenly {low:.4g} to {high:.4g} ms apart, {1e3 * clock.interval:.4g} ms in the mean; sensors count where "
            "they were measured, inputs are joined between their rows"
        )
        return clock
    off = scatter(clock)
    time = clock.time.copy()
    for a, b in clock.parts:
        start, interval, _ = regular_clock(clock.time[a:b], clock.interval)
        time[a:b] = start + row_numbers(clock.time[a:b], clock.interval) * interval
    if off <= SCATTER:
        return replace(clock, time=time)
    text = f"{place}: time stamps are off a regular clock of {clock.interval:.6g} s by up to {100.0 * off:.2g} % of that"
    if sampled_evenly(clock.time, time, columns):
        notes.append(f"{text}; samples were taken by that clock, as their values show")
        return replace(clock, time=time)
    notes.append(f"{text}; sensors count at their own times, inputs are joined between these")
    return replace(clock, even=False)


def held_on_raster(raster: Array, clock: Clock, si: Array, bad: Flags) -> tuple[Array, Flags]:
    """The last sample of a channel that is held until the next one; up to BRIDGE bad samples are passed over."""
    good = np.flatnonzero(~bad)
    held = held_rows(clock.time[good], raster)
    last = good[held.clip(0)] if good.size else np.zeros(raster.size, dtype=np.int64)
    return si[last], (held >= 0) & (raster - clock.time[last] < _bridged(clock, good))


def _bridged(clock: Clock, good: NDArray[np.int64]) -> float:
    """How far [s] sound rows may be apart for an input to be known in between: lost at random, more than BRIDGE may be missing in a row."""
    return max(clock.bridge, longest(np.diff(clock.time[good]), BRIDGE + GAP))


def on_raster(raster: Array, step: float, clock: Clock, si: Array, bad: Flags, driving: bool, curved: bool = False) -> tuple[Array, Flags]:
    """Rows of one channel on the raster, NaN outside of them; True where a sound row stands behind the sample.

    Of a channel that drives the model, up to BRIDGE bad rows in a row are bridged, or as many as are lost at random. Rows faster than the
    raster are low-passed without phase; those about as fast, or uneven, are taken one by one. `curved`: slower rows are joined by a
    band-limited curve, not by straight lines.
    """
    values, usable = np.full(raster.size, np.nan), np.zeros(raster.size, dtype=bool)
    bridge = _bridged(clock, np.flatnonzero(~bad)) if driving else 0.0
    for a, b in clock.parts:
        good = a + np.flatnonzero(~bad[a:b])
        if good.size < 2:
            continue
        inside = slice(*np.searchsorted(raster, (clock.time[a] - 1e-3 * step, clock.time[b - 1] + 1e-3 * step)))
        if not clock.one_by_one(step) or _on_rows(raster[inside], clock, (a, b)):
            values[inside], usable[inside] = _filtered(raster[inside], step, clock, (a, b), si, bad, bridge, curved or not driving)
        elif driving:
            values[inside] = joined(clock.time[good], si[good], raster[inside])
            usable[inside] = _between(clock.time[good], raster[inside], bridge, 1e-3 * step)
        else:
            values[inside], usable[inside] = measured_near(raster[inside], step, clock.time[good], si[good], 1e-2 * step)
    return values, usable


def _on_rows(raster: Array, clock: Clock, part: tuple[int, int]) -> bool:
    """Do all samples of a raster lie on the regular instants of a part of a clock?"""
    start, interval, off = regular_clock(clock.time[slice(*part)], clock.interval)
    return off <= SCATTER and not np.any(_beside((raster - start) / interval))


def _beside(place: Array) -> Flags:
    """Which places [m], in intervals, are beside a row."""
    found: Flags = np.abs(place - np.rint(place)) > 1e-2
    return found


def _between(time: Array, at: Array, bridge: float, near: float) -> Flags:
    """Which instants [m, s] lie between times [n, s] that are no farther apart than `bridge`, or at one of them."""
    after = np.searchsorted(time, at).clip(1, time.size - 1)
    found: Flags = (time[after] - time[after - 1] <= bridge) | (np.abs(time[after] - at) <= near) | (np.abs(time[after - 1] - at) <= near)
    return found


def _filtered(
    raster: Array, step: float, clock: Clock, part: tuple[int, int], si: Array, bad: Flags, bridge: float, curved: bool
) -> tuple[Array, Flags]:
    """Rows of a part of the clock as even samples, then on the raster within them; `bridge` [s] is 0 for a sensor."""
    a, b = part
    time, rows, wrong_row, driving = clock.time[a:b], si[a:b], bad[a:b], bridge > 0.0
    start, interval, off = regular_clock(time, clock.interval)
    ticks = row_numbers(time, clock.interval)
    even, wrong = np.full(ticks[-1] + 1, np.nan), np.ones(ticks[-1] + 1, dtype=bool)
    if off <= SCATTER:
        even[ticks], wrong[ticks] = rows, wrong_row
    else:
        start, interval = float(time[0]), float(time[-1] - time[0]) / ticks[-1]
        sound = ~wrong_row
        instants = start + np.arange(even.size) * interval
        even = np.interp(instants, time[sound], rows[sound])
        near = np.searchsorted(time, instants).clip(1, b - a - 1)
        wrong = wrong_row[near] | wrong_row[near - 1] | (np.diff(time)[near - 1] > max(GAP * clock.interval, clock.bridge))
    for i, j in stretches(wrong):
        wrong[i:j] = not ((j - i + 1) * interval <= bridge and i > 0 and j < wrong.size)
    hole = ~np.isfinite(even) | (wrong if interval < 0.999 * step else False)
    if driving and off <= SCATTER:
        hole[ticks[wrong_row]] = True
    known = np.flatnonzero(~hole)
    if known.size < 2 or not raster.size:
        return np.full(raster.size, np.nan), np.zeros(raster.size, dtype=bool)
    unknown = np.flatnonzero(hole)
    even[unknown] = (joined if driving else _lines)(known.astype(float), even[known], unknown.astype(float))
    return _move(raster, step, start, interval, even, wrong, driving, curved)


def _lines(time: Array, values: Array, at: Array) -> Array:
    return np.interp(at, time, values)


def _move(
    raster: Array, step: float, start: float, interval: float, even: Array, wrong: Flags, driving: bool, curved: bool
) -> tuple[Array, Flags]:
    """Evenly spaced samples to a raster within them."""
    place = (raster - start) / interval
    nearest = np.round(place).astype(np.int64).clip(0, even.size - 1)
    if interval > 1.001 * step:
        before, after = np.floor(place + 1e-3).astype(np.int64), np.ceil(place - 1e-3).astype(np.int64)
        usable = ~(wrong[before.clip(0, even.size - 1)] | wrong[after.clip(0, even.size - 1)])
        if not driving:  # one sample of the raster for each row
            usable &= np.abs(place - nearest) <= 0.5 * step / interval + 1e-9
        between = _beside(place[usable])
        values = np.interp(place, np.arange(even.size), even)
        if curved and between.any():  # rows beside the raster: by the whole curve, not by chords
            values[usable] = Kernel(raster[usable], start, interval, even.size, step).apply(even[:, None])[:, 0]
        return values, usable
    if interval > 0.999 * step and not np.any(_beside(place)):
        return even[nearest], ~wrong[nearest]
    kernel = Kernel(raster, start, interval, even.size, step)
    spilt = kernel.apply(wrong[:, None].astype(float), magnitude=True)[:, 0] if wrong.any() else np.zeros(raster.size)
    return kernel.apply(even[:, None])[:, 0], spilt <= SPILL


def stretches(flags: Flags) -> list[tuple[int, int]]:
    """[first, last) of each run of True."""
    change = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return list(zip(change[::2].tolist(), change[1::2].tolist(), strict=True))


def filled(values: Array, usable: Flags) -> Array:
    """Straight lines where a sample is not usable."""
    good = np.flatnonzero(usable & np.isfinite(values))
    return np.interp(np.arange(values.size), good, values[good]) if good.size else np.zeros(values.size)
