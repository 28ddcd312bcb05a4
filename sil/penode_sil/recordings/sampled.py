# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The channels of a table as they were measured: each on its own clock, whatever the rows in between show."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Input, Signal

from . import clocks
from .raster import Clock, parted, steadied
from .table import Recording

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Own:
    """A channel's samples as they were measured: its clock, values in the file's units and in SI, SI per unit of the file and at its 0."""

    clock: Clock
    raw: Array
    rows: Array
    scale: float
    zero: float = 0.0
    how: str = ""
    every: float = 1.0  # rows per sample


def own_of(signal: Input | Signal, table: Recording, base: Clock, driving: bool) -> Own:
    """A channel on its own clock, if its table has another one."""
    si = table.channel(signal.name, signal.unit, finite=False)[base.rows]
    raw = table.columns[str(table.find(signal.name, signal.unit))][base.rows]
    scale, zero = table.conversion(signal.name, signal.unit)
    even = steadied(base, "", [], [])
    found = clocks.own_samples(even.time, raw, driving)
    if found is not None:
        clock = parted(base.rows[found.rows], found.time)
        return Own(clock, found.values, found.values * scale + zero, scale, zero, found.how, found.every)
    finite = np.flatnonzero(np.isfinite(raw))
    if even is base and 1 < finite.size < raw.size:  # stamps of several clocks: no cell is missing
        return Own(parted(base.rows[finite], base.time[finite]), raw[finite], si[finite], scale, zero, "sparse", raw.size / finite.size)
    return Own(base, raw, si, scale, zero)


def steady(own: dict[str, Own], names: list[str], base: Clock, path: Path, notes: list[str]) -> None:
    """Channels that share a table's clock, and those with one of their own, on its regular instants if they were sampled there."""
    shared = [name for name in names if own[name].clock is base]
    groups = [shared] * bool(shared) + [[name] for name in names if name not in shared]
    for group in groups:
        clock = own[group[0]].clock
        place = str(path) if group is shared else f"{path}: channel {group[0]}"
        even = steadied(clock, place, [own[name].rows for name in group], notes)
        for name in group:
            own[name] = replace(own[name], clock=even)


def origin(table: Recording, name: str, own: Own, driving: bool) -> str:
    """What rows between a channel's samples are, and what is made of them."""
    clock = f"{1e3 * own.clock.interval:.6g} ms, every {own.every:.4g} rows"
    if own.how == "held":
        text, done = (
            "repeats its last value between samples",
            "held or smooth, as the sensors show" if driving else "each sample counts once",
        )
    elif own.how == "lines":
        text, done = "is joined by straight lines between samples", "only the samples count"
    else:
        text, done = "has empty cells between samples", "joined by straight lines" if driving else "only the samples count"
    return f"{table.path}: channel {name} {text} ({clock}); {done}"
