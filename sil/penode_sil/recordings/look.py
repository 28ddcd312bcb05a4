# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A first look into a recording: its channels, their clocks and quality, and the signals of a model that they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from ..errors import UserError
from . import named, quality, similar, unit_text
from .clocks import own_samples
from .files import pick, read
from .raster import Clock, clock_of, steadied
from .table import GAP, Recording
from .uneven import longest
from .units import UnitError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Channel:
    """A column of a file: values and faults in its own unit. `text`: it holds no numbers."""

    name: str
    unit: str | None
    text: str = ""
    rows: int = 0
    low: float = float("nan")
    high: float = float("nan")
    missing: int = 0
    held: int = 0
    clipped: int = 0
    spikes: int = 0
    quantum: float = 0.0
    constant: bool = False
    how: str = ""  # "held", "lines", "sparse": it has a clock of its own, and what the rows between its samples are
    interval: float = float("nan")  # [s] of that clock


@dataclass(frozen=True)
class Table:
    """Channels of one clock; `interval` [s] is 0 if it has none, `gaps` are intervals that are much longer."""

    rows: int
    start: float
    end: float
    interval: float
    gaps: int
    notes: tuple[str, ...]
    channels: tuple[Channel, ...]


@dataclass(frozen=True)
class Signal:
    """What a file has for a signal of the model: its column, or why there is none, and the option that helps."""

    kind: str  # time, input, sensor, output
    name: str
    unit: str
    column: str | None
    problem: str = ""
    option: str = ""
    why: str = ""


@dataclass(frozen=True)
class Look:
    """All of it. `form` says how the text is written."""

    path: Path
    form: str
    tables: tuple[Table, ...]
    model: str
    signals: tuple[Signal, ...]

    @property
    def options(self) -> list[str]:
        """The options to paste."""
        return [signal.option for signal in self.signals if signal.option]


def look(path: Path, model: Model | None = None, pairs: Mapping[str, str] | None = None) -> Look:
    """Look into a recording; UserError if it cannot be read at all."""
    tables = read(path, None, pairs)
    signals = _signals(tables, model) if model is not None else ()
    return Look(path, tables[0].form or "MDF", tuple(map(_table, tables)), model.name if model is not None else "", signals)


def _table(table: Recording) -> Table:
    notes: list[str] = []
    time, rows = None, 0
    channels = []
    start = end = interval = float("nan")
    gaps, clock = 0, None
    try:
        time = table.find("time", "s")
        clock = clock_of(table, notes)
        start, end, interval = float(clock.time[0]), float(clock.time[-1]), clock.interval
        if not clock.even:
            steadied(clock, str(table.path), [], notes)
        gaps = int(np.sum(np.diff(clock.time) > max(GAP * clock.interval, longest(np.diff(clock.time), GAP))))
    except UserError as exc:
        notes += exc.problems
    for key in table.columns:
        channel = _channel(table, key, clock)
        rows = max(rows, channel.rows)
        if key != time:
            channels.append(channel)
    return Table(rows, start, end, interval, gaps, tuple(notes), tuple(channels))


def _channel(table: Recording, key: str, clock: Clock | None) -> Channel:
    unit = table.units[key]
    try:
        values = table.columns[key]
    except UserError as exc:
        return Channel(key, unit, exc.problems[0])
    own = None if clock is None else own_samples(steadied(clock, "", [], []).time, values[clock.rows])
    if own is not None:
        faults = quality.examine(own.values)
    else:
        faults = quality.examine(*((values,) if clock is None else (values[clock.rows], clock.uneven)))
    good = values[np.isfinite(values)]
    low, high = (float(good.min()), float(good.max())) if good.size else (float("nan"), float("nan"))
    return Channel(
        key,
        unit,
        rows=values.size,
        low=low,
        high=high,
        missing=int(np.sum(faults.missing)),
        held=int(np.sum(faults.held)),
        clipped=int(np.sum(faults.saturated)),
        spikes=int(np.sum(faults.spikes)),
        quantum=faults.quantum,
        constant=faults.constant,
        how=own.how if own else "",
        interval=own.interval if own else float("nan"),
    )


def _signals(tables: Sequence[Recording], model: Model) -> tuple[Signal, ...]:
    """All signals of the model, found or not."""
    kinds = {s.name: ("output", s.unit) for s in model.outputs}
    kinds |= {s.name: ("sensor", s.unit) for s in model.sensors} | {s.name: ("input", s.unit) for s in model.inputs}
    found: dict[str, Signal] = {"time": _found(tables, "time", "time", "s")}
    found |= {name: _found(tables, kind, name, unit) for name, (kind, unit) in kinds.items()}
    missing = {name: signal.unit for name, signal in found.items() if signal.column is None and not signal.problem}
    taken = {signal.column for signal in found.values() if signal.column}
    known = {named.plain(name) for name in found}  # the same in another raster, or from another device
    names = {key: table.name_of(key) for table in tables for key in table.columns}
    names = {key: name for key, name in names.items() if key not in taken and named.plain(name) not in known}
    free = {key: table.units[key] for table in tables for key in table.columns if key in names}
    outputs = {name: unit for name, unit in missing.items() if found[name].kind == "output"}  # what is left over; they need not be recorded
    for wanted in ({name: unit for name, unit in missing.items() if name not in outputs}, outputs):
        for name, (column, why) in similar.proposals(wanted, free, names).items():
            unit, given = wanted[name], free.pop(column)
            called = column if given is not None else f"{column} [{unit or '1'}]"
            doubt = why if given is not None else f"{why}; the file has no unit, check it"
            found[name] = Signal(found[name].kind, name, unit, None, "", named.option(name, called), doubt)
    order = {"time": 0, "input": 1, "sensor": 2, "output": 3}
    return tuple(sorted(found.values(), key=lambda signal: order[signal.kind]))


def _found(tables: Sequence[Recording], kind: str, name: str, unit: str) -> Signal:
    """What the file has for one signal by its name or the user's alias."""
    try:
        holding = [table for table in tables if table.find(name, unit)]
        if not holding:
            return Signal(kind, name, unit, None)
        table = holding[0] if name == "time" else pick(list(tables), name, unit)
    except UserError as exc:
        return Signal(kind, name, unit, None, "; ".join(exc.problems))
    column = str(table.find(name, unit))
    try:
        given = table.unit_of(name, column, unit)
        if given is not None:
            unit_text.scale(given, unit)
        table.channel(name, unit, finite=False)
    except UnitError as exc:
        return Signal(kind, name, unit, column, str(exc), named.option(name, f"{column} [{unit or '1'}]"), "if that is its true unit")
    except UserError as exc:
        option = "" if given is not None else named.option(name, f"{column} [{unit or '1'}]")
        return Signal(kind, name, unit, column, "; ".join(exc.problems), option, "if that is its unit" if option else "")
    return Signal(kind, name, unit, column)
