# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Clocks of recordings, and samples taken from them to the raster of a model."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from .order import ordered
from .resampling import Kernel
from .stamps import evened, sampled_evenly
from .table import GAP, Recording, more

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
BRIDGE = 3  # missing samples of an input that a straight line may bridge
SHORTEST = 100  # samples on the model's raster; less says nothing about a model
SCATTER = 0.05  # of an interval: time stamps that are off by less are taken as those of a regular clock
SPILL = 0.1  # a filtered sample is bad if bad samples have more than this share of its weights


@dataclass(frozen=True, eq=False)
class Clock:
    """The rows of a table that have a time of their own, in order; parts [first, last) between gaps."""

    rows: NDArray[np.int64]
    time: Array
    interval: float
    parts: list[tuple[int, int]]


def clock_of(table: Recording, notes: list[str]) -> Clock:
    """Rows in the order of time, each time once; what had to be done is noted. UserError if that makes no clock."""
    time = table.channel("time", "s", finite=False)
    rows = np.flatnonzero(np.isfinite(time))
    if rows.size < time.size:
        bad = np.flatnonzero(~np.isfinite(time))
        notes.append(f"{table.place(bad[0])}: channel time has no value there{more(bad.size)}; such rows are left out")
    found = ordered(time[rows], lambda k: table.place(int(rows[k])))
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
        raise RecordingError(f"{table.path}: it has {rows.size} rows with a time of their own; record at least {SHORTEST}")
    steps = np.diff(time[rows])
    interval = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * interval)
    if gaps.size:
        notes.append(
            f"{table.place(rows[gaps[0] + 1])}: channel time has a gap of {steps[gaps[0]]:.6g} s before that row "
            f"(rows are usually {interval:.6g} s apart){more(gaps.size)}; no sample there is used"
        )
    return parted(rows, time[rows])


def parted(rows: NDArray[np.int64], time: Array) -> Clock:
    """The clock of rows at increasing times [s], parted at its gaps."""
    interval = float(np.median(np.diff(time)))
    cuts = np.flatnonzero(np.diff(time) > (BRIDGE + GAP) * interval) + 1
    bounds = [0, *cuts.tolist(), rows.size]
    parts = [(a, b) for a, b in itertools.pairwise(bounds) if b - a > 1]
    lengths = [int(_ticks(time[a:b], interval)[-1]) for a, b in parts]
    if sum(lengths):
        interval = sum(float(time[b - 1] - time[a]) for a, b in parts) / sum(lengths)
    return Clock(rows, time, interval, parts)


def scatter(clock: Clock) -> float:
    """The largest distance of a stamp from a regular clock, in intervals."""
    return max((_line(clock.time[a:b], clock.interval)[2] for a, b in clock.parts), default=0.0)


def steadied(clock: Clock, place: str, columns: list[Array], notes: list[str]) -> Clock:
    """The clock on its regular instants if its stamps scatter by little, or if the columns [rows of the clock] were sampled there."""
    off = scatter(clock)
    even = clock.time.copy()
    for a, b in clock.parts:
        start, interval, _ = _line(clock.time[a:b], clock.interval)
        even[a:b] = start + _ticks(clock.time[a:b], clock.interval) * interval
    if off <= SCATTER:
        return Clock(clock.rows, even, clock.interval, clock.parts)
    text = f"{place}: time stamps are off a regular clock of {clock.interval:.6g} s by up to {100.0 * off:.2g} % of that"
    if off < 0.5 and sampled_evenly(clock.time, even, columns):
        notes.append(f"{text}; samples were taken by that clock, as their values show")
        return Clock(clock.rows, even, clock.interval, clock.parts)
    notes.append(f"{text}; samples are joined by straight lines at their own times")
    return clock


def _ticks(time: Array, interval: float) -> NDArray[np.int64]:
    """The number of each row on a regular clock, from 0."""
    steps = np.maximum(1, np.round(np.diff(time) / interval).astype(np.int64))
    return np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(steps)))


def _line(time: Array, interval: float) -> tuple[float, float, float]:
    """Start [s] and interval [s] of the regular clock nearest to the times; the largest distance, in intervals."""
    ticks = _ticks(time, interval)
    if np.max(np.abs(time[0] + ticks * interval - time)) < 1e-3 * interval:
        return float(time[0]), interval, 0.0
    slope, start = np.polynomial.polynomial.polyfit(ticks, time - time[0], 1)[::-1]
    start += time[0]
    return float(start), float(slope), float(np.max(np.abs(start + ticks * slope - time)) / slope)


def held_on_raster(raster: Array, step: float, clock: Clock, si: Array, bad: Flags) -> tuple[Array, Flags]:
    """The last sample of a channel that is held until the next one; up to BRIDGE bad samples are passed over."""
    good = np.flatnonzero(~bad)
    last = np.searchsorted(clock.time[good], raster + 1e-3 * step, side="right") - 1
    last = good[np.maximum(last, 0)] if good.size else np.zeros(raster.size, dtype=np.int64)
    age = raster - clock.time[last]
    return si[last], (age > -1e-3 * step) & (age < (BRIDGE + GAP) * clock.interval)


def on_raster(raster: Array, step: float, clock: Clock, si: Array, bad: Flags, driving: bool, curved: bool = False) -> tuple[Array, Flags]:
    """Rows of one channel on the raster, NaN outside of them; True where a sound row stands behind the sample.

    Of a channel that drives the model, up to BRIDGE bad rows in a row are bridged. Rows faster than the raster, or
    beside it, are low-passed without phase. `curved`: slower rows are joined by a band-limited curve, not by straight lines.
    """
    bridge = BRIDGE if driving else 0
    values, usable = np.full(raster.size, np.nan), np.zeros(raster.size, dtype=bool)
    for a, b in clock.parts:
        start, interval, scatter = _line(clock.time[a:b], clock.interval)
        ticks = _ticks(clock.time[a:b], clock.interval)
        even, wrong = np.full(ticks[-1] + 1, np.nan), np.ones(ticks[-1] + 1, dtype=bool)
        if np.all(bad[a:b]):
            continue
        if scatter <= SCATTER:
            even[ticks], wrong[ticks] = si[a:b], bad[a:b]
        else:
            start, interval = float(clock.time[a]), float(clock.time[b - 1] - clock.time[a]) / ticks[-1]
            sound = ~bad[a:b]
            even = np.interp(start + np.arange(even.size) * interval, clock.time[a:b][sound], si[a:b][sound])
            near = np.searchsorted(clock.time[a:b], start + np.arange(even.size) * interval).clip(1, b - a - 1)
            gap = np.diff(clock.time[a:b])[near - 1] > GAP * clock.interval
            wrong = bad[a:b][near] | bad[a:b][near - 1] | gap
        for i, j in stretches(wrong):
            wrong[i:j] = not (j - i <= bridge and i > 0 and j < wrong.size)
        hole = ~np.isfinite(even) | (wrong if interval < 0.999 * step else False)
        if driving and scatter <= SCATTER:
            hole[ticks[bad[a:b]]] = True
        known = np.flatnonzero(~hole)
        if known.size < 2:
            continue
        unknown = np.ones(even.size, dtype=bool)
        unknown[known] = False
        even[unknown] = np.interp(np.flatnonzero(unknown), known, even[known])
        end = start + (even.size - 1) * interval
        inside = slice(*np.searchsorted(raster, (start - 1e-3 * step, end + 1e-3 * step)))
        values[inside], usable[inside] = _move(raster[inside], step, start, interval, even, wrong, driving, curved or not driving)
    return values, usable


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
        between = np.abs(place[usable] - nearest[usable]) > 1e-2
        values = np.interp(place, np.arange(even.size), even)
        if curved and between.any():  # rows beside the raster: by all of what they show, not by chords
            values[usable] = Kernel(raster[usable], start, interval, even.size, step).apply(even[:, None])[:, 0]
        return values, usable
    if interval > 0.999 * step and np.all(np.abs(place - nearest) < 1e-2):
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
