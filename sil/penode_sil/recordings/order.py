# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rows whose clock goes back: written in another order than they were taken, or by a clock that was set back meanwhile.

Rows in another order fit between each other: sorted, their intervals are more even than as they stand. Where a clock was set back, two
stretches of the recording have the same times, and sorting would lay rows of one between rows of the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from .uneven import longest

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Ordered:
    """Rows in the order of time [n], their times [n, s], and what was done, "" for nothing."""

    rows: Index
    time: Array
    note: str = ""


def ordered(time: Array, place: Callable[[int], str], gap: float) -> Ordered:
    """Rows at finite times [n, s] in the order of time; `place` says where a row stands, intervals from `gap` times the usual one on are
    gaps. RecordingError where a clock was set back by what is no change of a time zone: nobody knows how long it stood still."""
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0) + 1
    if not back.size:
        return Ordered(np.arange(time.size), time)
    where = f"{place(int(back[0]))}: channel time goes back there" + (f" (and in {back.size - 1} more rows)" if back.size > 1 else "")
    onward = steps[steps > 0.0]
    first, last = np.concatenate(([0], back)), np.concatenate((back, [time.size])) - 1
    turn = np.argsort(time[first], kind="stable")
    joints = time[first][turn][1:] - time[last][turn][:-1]  # of the stretches, sorted
    seamless = onward.size and np.all((joints > 0.0) & (joints <= longest(onward, gap)))
    if not seamless and onward.size and (moved := _set_back(steps, back, longest(onward, gap))) is not None:
        hours = f"{moved[-1] / 3600.0:g} h" + (" in all" if back.size > 1 else "")
        note = f"{where}: the clock was set back by {hours}, as at the end of summer time; rows follow each other"
        return Ordered(np.arange(time.size), time + moved, note)
    order = np.argsort(time, kind="stable")
    far = not onward.size or -np.min(steps) > np.median(onward)  # by more than a row
    if far and np.any(joints <= 0.0) and _spread(onward) <= _spread(np.diff(time[order])):
        what = f"by {-steps[back[0] - 1]:.6g} s, to times that rows before have too"
        raise RecordingError(f"{where}, {what}; split the recording where its clock restarts")
    return Ordered(order, time[order], f"{where}; rows are sorted by time")


def _set_back(steps: Array, back: Index, most: float) -> Array | None:
    """What a clock that was set to other time zones lacks [n, s], if the next row then comes within `most` [s]; None if any of it is no
    such change."""
    zone = 900.0  # [s] all offsets from UTC are multiples of it
    moved = np.zeros(steps.size + 1)
    for k in back:
        zones = float(np.ceil(-steps[k - 1] / zone)) * zone
        if not 0.0 < steps[k - 1] + zones <= most:
            return None
        moved[k:] += zones
    return moved


def _spread(between: Array) -> float:
    """The standard deviation of intervals over their mean; infinite if there is none."""
    return float(np.std(between) / np.mean(between)) if between.size and np.any(between > 0.0) else np.inf
