# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rows whose clock goes back: written in another order than they were taken, or by a clock that was set back meanwhile.

Rows in another order fit between each other: sorted, they are as far apart as they were. Where a clock was set back, two stretches of
the recording have the same times, and sorting would lay rows of one between rows of the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Rules:
    """What tells rows in another order from a clock that was set back."""

    dense: float = 0.75  # of the usual interval: two stretches with the same times are half of it apart on average, sorted rows all of it
    apart: float = 4.0  # usual intervals; what is farther apart lies in two such stretches
    rows: int = 3  # intervals that say how dense rows are
    all: float = 0.9  # share of the rows that have times of others, if a logger writes several sources by blocks
    many: int = 10  # blocks of such a logger
    short: float = 12.0  # rows from one time that the clock goes back to the next: nobody sets it so often
    sources: float = 5.0  # of such a logger, at most; laps of a clock that starts anew are as many as it starts
    zone: float = 900.0  # [s] all offsets from UTC are multiples of it, so wall clocks are set by these
    near: float = 0.5  # of an interval (or a tenth of a second) by which the next row may be off where a clock that was set back goes on
    least: float = 0.1  # [s]


RULES = Rules()


@dataclass(frozen=True, eq=False)
class Ordered:
    """Rows in the order of time [n], their times [n, s], and what was done, "" for nothing."""

    rows: Index
    time: Array
    note: str = ""


def ordered(time: Array, place: Callable[[int], str]) -> Ordered:
    """Rows at finite times [n, s] in the order of time; `place` says where a row stands. RecordingError where a clock was set back by what
    is no change of a time zone: nobody knows how long it stood still."""
    rows = np.arange(time.size)
    back = np.flatnonzero(np.diff(time) < 0.0) + 1
    if not back.size:
        return Ordered(rows, time)
    where = f"{place(int(back[0]))}: channel time goes back there{_more(back.size)}"
    first, last = np.concatenate(([0], back)), np.concatenate((back, [time.size])) - 1
    turn = np.argsort(time[first], kind="stable")
    joints = time[first][turn][1:] - time[last][turn][:-1]
    if np.all((joints > 0.0) & (joints <= RULES.apart * _usual(time))):
        return _sorted(time, where)  # blocks that fit together in another order
    if (moved := _set_back(time, back)) is not None:
        hours = f"{moved[-1] / 3600.0:g} h" + (" in all" if back.size > 1 else "")
        return Ordered(
            rows, time + moved, f"{where}: the clock was set back by {hours}, as at the end of summer time; rows follow each other"
        )
    if np.any(joints <= 0.0) and _twice(time, back, float(np.sum(time[last] - time[first]))):
        what = f"by {time[back[0] - 1] - time[back[0]]:.6g} s, to times that rows before have too"
        raise RecordingError(f"{where}, {what}; split the recording where its clock starts anew")
    return _sorted(time, where)


def _sorted(time: Array, where: str) -> Ordered:
    order = np.argsort(time, kind="stable")
    return Ordered(order, time[order], f"{where}; rows are sorted by time")


def _set_back(time: Array, back: Index) -> Array | None:
    """What a clock that was set to other time zones lacks [n, s], if the rows then go on as before; None if any of it is no such change."""
    steps, usual = np.diff(time), _usual(time)
    moved = np.zeros(time.size)
    for k in back:
        missing = usual - float(steps[k - 1])
        zones = np.rint(missing / RULES.zone) * RULES.zone
        if zones <= 0.0 or abs(missing - zones) > max(RULES.near * usual, RULES.least):
            return None
        moved[k:] += zones
    return moved


def _twice(time: Array, back: Index, spans: float) -> bool:
    """Do rows from before and after the clock went back have the same times, and not because a logger writes them as they arrive, or several
    sources by blocks? `spans` [s] are all stretches in which it goes on, added up."""
    inside = _repeated(time, back)
    deep, length = spans / max(float(np.ptp(time)), 1e-300), time.size / (back.size + 1)
    if back.size >= RULES.many and deep < RULES.sources and (np.mean(inside) > RULES.all or length < RULES.short):
        return False
    usual, between = _usual(time), np.diff(np.sort(time[inside]))
    between = between[between <= RULES.apart * usual]
    return usual == 0.0 or (between.size >= RULES.rows and float(np.mean(between)) < RULES.dense * usual)


def _repeated(time: Array, back: Index) -> NDArray[np.bool_]:
    """The rows at times between one that goes back and the latest before it."""
    change = np.zeros(time.size + 1)
    before = np.maximum.accumulate(time)[back - 1]
    order = np.argsort(time, kind="stable")
    np.add.at(change, np.searchsorted(time[order], time[back], side="left"), 1.0)
    np.add.at(change, np.searchsorted(time[order], before, side="right"), -1.0)
    inside = np.zeros(time.size, dtype=bool)
    inside[order] = np.cumsum(change)[:-1] > 0.0
    return inside


def _usual(time: Array) -> float:
    """The usual interval [s] between a row and the next one."""
    steps = np.diff(time)
    return float(np.median(steps[steps > 0.0])) if np.any(steps > 0.0) else 0.0


def _more(count: int) -> str:
    return f" (and in {count - 1} more rows)" if count > 1 else ""
