# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a recorded channel tells about its sensor, before any model is asked: quantum, lost and held samples, spikes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Index = NDArray[np.int64]
CHANCE = 1e-3  # a run of equal samples counts if one as long is rarer than this in a whole recording
PILE = 30  # samples at the extreme of a channel that may be a rail
SPIKE = 12.0  # a sample is a spike beyond so many standard deviations; the noise of 1e9 samples reaches 6.2
HARM = 2.5  # quanta: a row that ends in a smaller step does no harm, and may be a flat turn
NEAR = 16  # samples on each side that say how a channel usually moves there


@dataclass(frozen=True, eq=False)
class Faults:
    """Per sample of a channel, what is wrong with it. `low`, `high`: where the sensor is cut off, None if it is not."""

    missing: Flags  # no finite value
    saturated: Flags  # the channel's extreme, held while the signal went on beyond it
    held: Flags  # the value before, repeated while the signal went on; or a row of zeros in between
    spikes: Flags  # one sample far off, both neighbours in line
    quantum: float  # step of the values, 0 if they have none
    constant: bool
    low: float | None = None
    high: float | None = None

    @property
    def any(self) -> Flags:
        """The samples that cannot be used."""
        return self.missing | self.saturated | self.held | self.spikes


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def examine(values: Array, time: Array | None = None) -> Faults:
    """Look at the samples [n] of one channel, in the file's units, at a constant interval, or at increasing times [n, s] if these are
    uneven; NaN where there is none."""
    missing = ~np.isfinite(values)
    good = values[~missing]
    quantum = quantisation(good)
    none = np.zeros(values.size, dtype=bool)
    if good.size < 4 or np.ptp(good) == 0.0:
        return Faults(missing, none, none, none, quantum, good.size > 0)
    grain = max(quantum, _grain(good))
    x = np.where(missing, np.nan, values)
    spikes = _spikes(x, grain) if time is None else _spikes_at(time, x, grain)
    x[spikes] = np.nan
    first, last, kink, jump = _runs(x, grain)
    saturated, held = none.copy(), none.copy()
    low, high = (_edge(x, first, last, kink, edge, grain) for edge in (np.nanmin(x), np.nanmax(x)))
    for edge in (low, high):
        if edge is not None:
            saturated |= x == edge
    for i, j in zip(first[jump], last[jump], strict=True):
        held[i + (x[i] != 0.0) : j + 1] = True  # the first of a held row was measured; zeros were not
    return Faults(missing, saturated, held & ~saturated, spikes, quantum, False, low, high)


def _edge(x: Array, first: Index, last: Index, kink: Flags, edge: float, grain: float) -> float | None:
    """The channel's extreme if the signal is cut off there: in most of its long rows, or in a pile of noisy samples."""
    at = np.flatnonzero(x == edge)
    three = at[2:][at[2:] - at[:-2] == 2]
    rows = np.sum(np.diff(three, prepend=-2) > 1)  # of at least three samples
    cut = np.sum((x[first] == edge) & (last - first >= 2) & kink)
    if edge != 0.0 and cut and cut >= 0.2 * rows:
        return float(edge)
    beside = np.sum((x != edge) & (np.abs(x - edge) < 2.5 * grain))
    if edge != 0.0 and rows >= 3 and at.size > max(PILE, 5 * beside, 5 * np.sum(np.diff(at, prepend=-2) > 1)):
        before = x[at[np.diff(at, prepend=-2) > 1] - 1]  # a sine that stays for several samples has 2.4 times as many at its peak
        if np.nanmedian(np.abs(before - edge)) < 0.1 * np.nanmax(np.abs(x - edge)):  # not switched to it
            return float(edge)
    if edge != 0.0 and at.size >= 8 and at.size > 3 * beside:
        some = at[:: max(1, at.size // 256)]
        bend, twist = (_median(np.append(np.diff(x, n), [np.nan] * n), _near(some, some, x.size)) for n in (2, 3))
        if np.mean((twist > bend) & (bend > 1.5 * grain)) > 0.5:
            return float(edge)
    return None


@np.errstate(over="ignore", invalid="ignore", divide="ignore")
def quantisation(values: Array) -> float:
    """The step that all differences of repeated values are multiples of; 0 if there is none, or too few to tell."""
    levels, count = np.unique(values, return_counts=True)
    luck = max(levels.size, 1) ** 2 * 0.2**levels.size  # that all lie on steps: each does with 0.2, and two of them are the step
    if luck < CHANCE and (step := _step_of(levels)):
        return step  # whatever is there often: a standstill repeats one value
    often = count > 1
    often &= count > 0.05 * (np.median(count[often]) if often.any() else 0.0)
    if np.sum(often) > 2 and np.sum(count[often]) > 0.5 * values.size:  # a sensor that holds a few values is no coarse one
        levels = levels[often]  # outliers need not lie on a step
    return 0.0 if levels.size < 2 or (values.size < 4 * levels.size and levels.size < 32) else _step_of(levels)


def _step_of(levels: Array) -> float:
    """The step that all differences of values in order are multiples of, 0 if there is none."""
    steps = np.diff(levels)
    for step in np.quantile(steps, (0.0, 0.05)):
        if step > 1e-9 * np.max(np.abs(levels)):
            whole = np.round(steps / step)
            step = float(steps.sum() / whole.sum())
            if np.mean(np.abs(steps / step - whole) < 0.1) > 0.98:
                return step
    return 0.0


def _grain(values: Array) -> float:
    """How finely the largest values are written: in single precision, with up to 7 decimal digits, else in double."""
    some = values[:: max(1, values.size // 512)]
    largest = float(np.max(np.abs(some)))
    single = some.astype(np.float32)
    if np.array_equal(single.astype(np.float64), some):
        return float(np.spacing(np.float32(largest)))
    size = np.floor(np.log10(np.abs(some[some != 0.0])))
    for digits in range(3, 8):
        scaled = some[some != 0.0] * 10.0 ** (digits - 1.0 - size)
        if np.all(np.abs(scaled - np.round(scaled)) < 1e-6):
            return float(10.0 ** (np.floor(np.log10(largest)) - digits + 1.0))
    return float(np.spacing(largest))


def _near(index: Index, last: Index, size: int) -> Index:
    """Per run index..last the NEAR places before and after it, not touching it; -1 outside of the recording."""
    aside = np.arange(2, NEAR + 2)
    places = np.concatenate((index[:, None] - aside, last[:, None] + aside), axis=1)
    return np.where((places < 0) | (places >= size), -1, places)


def _median(values: Array, places: Index) -> Array:
    """Median of abs(values) at each row of places; NaN and places outside do not count; 0 where none does."""
    taken = np.where(places < 0, np.nan, np.abs(values[np.clip(places, 0, values.size - 1)]))
    count = np.sum(~np.isnan(taken), axis=1)
    taken.sort(axis=1)  # NaN last
    rows = np.arange(len(taken))
    middle: Array = np.nan_to_num(0.5 * (taken[rows, np.maximum(count - 1, 0) // 2] + taken[rows, count // 2]))
    return middle


def _runs(x: Array, quantum: float) -> tuple[Index, Index, Flags, Flags]:
    """First and last places of the runs of equal samples that the signal cannot have made by itself.

    A signal repeats a value by itself where it rests, at a turning point, where it is slow or where its noise is small
    against the quantum. So a run counts only if its length is improbable for increments as they are around it (normal,
    of that size, in steps of the quantum), and if a step at its end is none of a parabola that stays within one quantum
    over the length of the run. Where the signal around it is smooth, it may still have come to rest. So the last two
    results say which runs begin and end with a kink (cut off), and which end in a jump (held).
    """
    same = np.concatenate(([False], np.diff(x) == 0.0, [False]))
    change = np.diff(same.astype(np.int8))
    first, last = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    length = last - first + 1
    step = np.abs(np.concatenate(([np.nan] * 2, np.diff(x), [np.nan] * 3)))  # step[i + 1]: from sample i - 1 to i
    big = np.fmax(step[first + 1], step[last + 2]) > quantum * (HARM + 4.0 * length / (length - 1.0) ** 2)
    first, last, length = first[big], last[big], length[big]
    places = _near(first, last, x.size)
    slope, bend, twist = (_median(np.append(np.diff(x, n), [np.nan] * n), places) for n in (1, 2, 3))
    around = np.where(places < 0, np.nan, np.abs(np.append(np.diff(x), np.nan))[places])
    count, still = np.sum(~np.isnan(around), axis=1), np.sum(around == 0.0, axis=1)
    repeat = np.fmin(1.0, quantum / (2.5066 * 1.4826 * slope))  # the normal density at 0, times the quantum
    repeat = np.where(still > 0, np.fmax(repeat, (still + 3.0) / (count + 4.0)), repeat)  # and not less than is seen
    rare = (slope > 0.0) & (x.size * repeat ** (length - 1.0) < CHANCE)
    rough = rare & (twist > bend) & (bend > 1.5 * quantum)  # rounding bends by up to 2 quanta, mostly by 0 or 1
    before, after = (np.fmax(step[a], step[b]) for a, b in ((first, first + 1), (last + 2, last + 3)))
    out = step[last + 2]
    kink = rough | (rare & (np.fmin(before, after) > 4.0 * bend))
    jump = rough | (rare & (out > 1.5 * step[last + 3]) & (out > 4.0 * bend))
    largest = np.fmax.reduce(around, axis=1)
    leap = 4.0 * np.fmax(quantum, largest)
    usual = count / (count - still).clip(1)  # samples to the next step
    jump |= (out > leap) & ((step[first + 1] > leap) | (length > 4.0 * usual))
    fall = np.fmax(step[first + 1], out)
    rests = _rests(x, first, last, leap, quantum)
    jump |= (x[first] == 0.0) & (fall > 4.0 * quantum) & (fall > 2.0 * largest)  # what a lost sample is mostly set to
    return first, last, kink, jump & ~rests


def _rests(x: Array, first: Index, last: Index, leap: Array, quantum: float) -> Flags:
    """Runs of equal samples from which the signal sets off step by step, or, at an end of a recording, in which it rests before it moves
    or has come to rest: what a sensor missed while it repeated a value comes in one step, or in a `leap` at the beginning."""
    change = np.concatenate(([np.nan] * 2, np.diff(x), [np.nan] * 4))  # change[i + 1]: from sample i - 1 to i
    out, on, further = change[last + 2], change[last + 3], change[last + 4]
    into, before = change[first + 1], change[first]
    sets_off = (out * on > 0.0) & (on * further > 0.0) & (np.abs(out) <= np.abs(on))
    begins = (first == 0) & (np.abs(out) <= leap)
    stops = (last == x.size - 1) & (into * before > 0.0) & (np.abs(into) <= np.abs(before) + HARM * quantum)
    found: Flags = sets_off | begins | stops
    return found


def _spikes(x: Array, grain: float) -> Flags:
    """Single samples far from the line between their neighbours, measured by how far others around them are."""
    found = np.zeros(x.size, dtype=bool)
    off = np.full(x.size, np.nan)  # beside what is lost, nothing is known
    off[1:-1] = x[1:-1] - 0.5 * (x[:-2] + x[2:])
    same = np.diff(x) == 0.0
    off[1:-1][same[:-1] & same[1:]] = np.nan  # where it rests, nothing shows how it moves
    if np.all(np.isnan(off)):
        return found
    size, sign = np.abs(off), np.sign(off)
    alone = np.minimum(-sign[1:-1] * off[:-2], -sign[1:-1] * off[2:]) > 0.25 * size[1:-1]  # 1/2 if it is one sample
    peak = 1 + np.flatnonzero(alone & (size[1:-1] > max(4.0 * grain, SPIKE * np.nanmedian(size))))
    found[peak[size[peak] > SPIKE * 1.4826 * _median(off, _near(peak, peak, x.size))]] = True
    return found


def _spikes_at(time: Array, x: Array, grain: float) -> Flags:
    """The same of samples at uneven times: far from the line between their neighbours as others in such intervals are, where lines miss a
    curve by the product of both."""
    before, after = np.diff(time)[:-1], np.diff(time)[1:]
    usual = float(np.median(np.diff(time)))
    off = np.full(x.size, np.nan)
    off[1:-1] = x[1:-1] - (x[:-2] * after + x[2:] * before) / (before + after)
    room = np.ones(x.size)
    room[1:-1] = np.maximum(1.0, before * after / usual**2)
    found = _spikes(x, grain)
    far = SPIKE * 1.4826 * room * _median(off, _near(np.arange(x.size), np.arange(x.size), x.size))
    found &= np.abs(off) > far
    return found
