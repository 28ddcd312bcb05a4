# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings as files: each kind goes to its reader, and names of the file become those of the model."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..errors import RecordingError, UserError, hint
from . import mdf, named, similar
from .table import Recording
from .text.csv_text import read_csv


def read(path: Path, names: Iterable[str] | None = None, pairs: Mapping[str, str] | None = None) -> list[Recording]:
    """Read a file of any known kind: one table per clock, each with a channel time. `pairs` are aliases.

    Of an MDF file only the channels `names` are read (default: all that are numbers). UserError says what is wrong.
    """
    pairs = dict(pairs or {})
    asked = None if names is None else list(names)
    try:
        with open(path, "rb") as file:
            start = file.read(8)
    except OSError as exc:
        raise RecordingError(f"{path}: {exc.strerror or exc}; name a CSV file that can be read") from exc
    rate = named.clock(pairs["time"]) if "time" in pairs else None
    if rate is not None:
        del pairs["time"]
    if start in (b"MDF     ", b"UnFinMF ") or path.suffix.lower() in (".mf4", ".mdf"):
        pairs.pop("time", None)  # each group has its own
        tables, known = _read_mdf(path, asked, pairs)
    else:
        tables = _by_clock(_clocked(read_csv(path), rate))
        known = [name for table in tables for name, _ in table.texts.values()]
    named.check(pairs, tables, path, asked, known)
    if not tables:
        what = f"none of the channels {', '.join(sorted({*asked} - {'time'}))}" if asked else "no channel with numbers"
        raise RecordingError(f"{path}: it holds {what}; {hint(min({*asked} - {'time'}, default='') if asked else '', known)}")
    return [replace(table, aliases=pairs) for table in tables]


def _clocked(table: Recording, rate: float | None) -> Recording:
    """The table with a time of so many seconds a row, if the user gives one."""
    if rate is None or table.lines is None:
        return table
    time = np.arange(table.lines.size, dtype=float) * rate
    columns = ChainMap({"time": time}, table.columns)  # type: ignore[arg-type]  # the maps behind the first are only read
    return replace(table, columns=columns, units={**table.units, "time": "s"}, texts={**table.texts, "time": ("time", "time")})


def _by_clock(table: Recording) -> list[Recording]:
    """A table for each column of time, with the columns right of it, if a file has several that differ."""
    keys = list(table.columns)
    times = [key for key in keys if table.name_of(key).casefold() in ("time", "t", "zeit", "timestamp")]
    if len(times) < 2 or keys[0] != times[0] or len({table.name_of(key) for key in times}) > 1 or table.lines is None:
        return [table]
    if all(np.array_equal(table.columns[times[0]], table.columns[key], equal_nan=True) for key in times[1:]):
        return [table]
    parts = []
    for first, last in zip(times, [*times[1:], None], strict=True):
        chosen = keys[keys.index(first) : keys.index(last) if last else None]
        some = np.flatnonzero(np.isfinite(table.columns[first]))
        columns = {("time" if key == first else key): table.columns[key][some] for key in chosen}
        units = {("time" if key == first else key): table.units[key] for key in chosen}
        texts = {("time" if key == first else key): table.texts[key] for key in chosen}
        parts.append(replace(table, columns=columns, units=units, texts=texts, lines=table.lines[some]))
    return parts


def pick(tables: list[Recording], name: str, unit: str) -> Recording:
    """The table that holds a channel, of several the one with the finest raster; UserError if none does, or in doubt."""
    holding = [table for table in tables if table.find(name, unit) is not None]
    if not holding:
        known = {c: table.units[c] for table in tables for c in sorted(table.columns) if c != "time"}
        raise RecordingError(
            f"{tables[0].path}: there is no channel {name}; {hint(name, known)}, or {similar.remedy(name, unit, known)}", channel=name
        )
    if len(holding) == 1:
        return holding[0]
    called = None
    if name in tables[0].aliases:
        called, _ = named.meant(tables[0].aliases[name], holding[0].units, holding[0].texts)
        if called.count is not None and 1 <= called.count <= len(holding):
            return holding[called.count - 1]
    rasters = [interval(table) for table in holding]
    column = called.name if called is not None else holding[0].name_of(str(holding[0].find(name, unit)))
    says = [named.option(name, f"{column}@{raster * 1e3:.4g}ms") for raster in rasters]
    if called is not None and called.raster is not None:
        near = [t for t, raster in zip(holding, rasters, strict=True) if abs(raster - called.raster) <= 0.1 * called.raster]
        if not near:
            raise RecordingError(
                f"{tables[0].path}: channel {name} has no raster of {called.raster * 1e3:g} ms; say {' or '.join(says)}", channel=name
            )
        holding, rasters = near, [interval(table) for table in near]
    finest = [t for t, raster in zip(holding, rasters, strict=True) if raster <= 1.01 * min(rasters)]
    if len(finest) > 1 and not all(_same(finest[0], table, name, unit) for table in finest[1:]):
        says = [named.option(name, f"{column}#{tables_of(tables, name, unit).index(t) + 1}") for t in finest]
        raise RecordingError(
            f"{tables[0].path}: channel {name} is there {len(finest)} times in one raster; say {' or '.join(says)}", channel=name
        )
    return finest[0]


def tables_of(tables: list[Recording], name: str, unit: str) -> list[Recording]:
    """The tables that hold a channel."""
    return [table for table in tables if table.find(name, unit) is not None]


def interval(table: Recording) -> float:
    """The usual time [s] between rows; infinite if there is none."""
    try:
        time = table.channel("time", "s", finite=False)
    except UserError:
        return float("inf")
    steps = np.diff(time[np.isfinite(time)])
    return float(np.median(steps)) if steps.size else float("inf")


def _same(a: Recording, b: Recording, name: str, unit: str) -> bool:
    one, other = (t.columns[str(t.find(name, unit))] for t in (a, b))
    return np.array_equal(one, other, equal_nan=True)


def _read_mdf(path: Path, names: list[str] | None, pairs: Mapping[str, str]) -> tuple[list[Recording], list[str]]:
    """Groups of an MDF file as tables, and the names of all its channels."""
    wanted = None
    if names is not None:
        wanted = frozenset(
            one.name for name in names for one in ([named.Called(name)] if name not in pairs else named.readings(pairs[name]))
        )
    groups, known = mdf.read(path, wanted)
    return [Recording(path, None, units, columns, {}, texts=texts) for units, columns, texts in groups], known
