# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings: CSV whose header carries units, like `time [s],z_road [m],a_body [m/s^2]`, and MDF (.mf4).

Other habits are read where they leave no doubt: `z_road (mm)`; `force_N` and `v_m_s` for force and v, if what the model
asks for is measured in that unit; `t` for time; columns between semicolons or tabs, then also with decimal commas.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from . import mdf
from .errors import UserError, hint
from .units import UnitError, factor

Array = NDArray[np.float64]
HEADER = re.compile(r"^\s*([A-Za-z_]\w*)\s*(?:\[(.*)\]|\((.*)\))?\s*$")
ALIAS = re.compile(r"^\s*(\w+)\s*=\s*(.*?\S)\s*(?:\[(.*)\])?\s*$")
GAP = 1.5  # an interval longer than this many usual (median) intervals is a gap
TIME = ("time", "t", "Time")
# what a column's name may end in; what follows the first is divided by: m_s2 is m/s^2
SUFFIX = re.compile(r"(?:_(?:[mu]?s|[cmuk]?m|k?N|k?g|rad|deg|m?V|m?A|k?Pa|bar|K|Hz)\d?)+$")
STOP_BAND = 60.0  # [dB] what lies above the new raster's Nyquist frequency is damped by this
PASS_BAND = 0.8  # of the Nyquist frequency: what lies below stays as it is, within 0.1 %


@dataclass(frozen=True, eq=False)
class Recording:
    """A table as it was read, with one clock: per column its unit text (None if it has none) and values (NaN if empty).

    `lines` is the line of the file that each row came from, None if it has no lines; `aliases` gives, for names of the
    model, the names that the file uses instead.
    """

    path: Path
    lines: NDArray[np.int64] | None
    units: dict[str, str | None]
    columns: dict[str, Array]
    aliases: Mapping[str, str] = field(default_factory=dict)

    def place(self, row: int) -> str:
        """Where a row stands, for messages."""
        return f"{self.path}: sample {row + 1}" if self.lines is None else f"{self.path}:{self.lines[row]}"

    @property
    def header(self) -> str:
        """Where names and units stand, for messages."""
        return str(self.path) if self.lines is None else f"{self.path}:1"

    def find(self, name: str, unit: str) -> str | None:
        """The column that holds channel `name`, None if there is none; UserError if there are several."""
        wanted = self.aliases.get(name, name)
        if wanted in self.columns:
            return wanted
        stems = TIME if wanted == "time" else (wanted,)
        found = [c for c in self.columns if c in stems or any(self._spelt(c, stem, unit) for stem in stems)]
        if len(found) > 1:
            raise UserError(f"{self.header}: channel {name} may be {' or '.join(found)}; rename or remove one")
        return found[0] if found else None

    def _spelt(self, column: str, stem: str, unit: str) -> bool:
        """Is the column's name `stem`_UNIT with a unit that measures what `unit` does?"""
        ending = column.removeprefix(stem)
        return self.units[column] is None and ending != column and _suffix(ending, ending, unit) is not None

    def channel(self, name: str, unit: str, finite: bool = True) -> Array:
        """One channel in SI, which must measure what `unit` does and be finite; UserError names line and channel."""
        column = self.find(name, unit)
        if column is None:
            raise UserError(f"{self.path}: there is no channel {name}; {hint(name, self.columns)}")
        given = self.units[column]
        if given is None and column != name:
            given = next((u for u in (_suffix(column, e, unit) for e in _endings(column)) if u is not None), None)
        if given is None:
            where = f'"{name} [{unit or "1"}]" in the header' if self.lines is not None else "it into the file"
            raise UserError(f"{self.header}: channel {name} has no unit; write {where}")
        try:
            scale = _scale(given, unit)
        except UnitError as exc:
            raise UserError(f"{self.header}: channel {name}: {exc}") from exc
        values = self.columns[column]
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size and finite:
            raise UserError(
                f"{self.place(bad[0])}: channel {name} has no finite value there"
                f"{more(bad.size)}; cut the recording or fill the value in"
            )
        return values if scale == 1.0 else values * scale

    def time(self) -> Array:
        """The times [s], checked: increasing, without gaps. UserError lists each kind of trouble once."""
        time = self.channel("time", "s")
        if time.size < 2:
            raise UserError(f"{self.path}: it has {time.size} rows; at least 2 are needed")
        step = np.diff(time)
        usual = float(np.median(step[step > 0.0])) if np.any(step > 0.0) else 0.0
        problems = [
            f"{self.place(rows[0] + 1)}: channel time {what}{more(rows.size)}; {remedy}"
            for rows, what, remedy in (
                (np.flatnonzero(step < 0.0), "goes back", "sort the rows by time"),
                (np.flatnonzero(step == 0.0), "has the same value as the row before", "remove the duplicate"),
                (
                    np.flatnonzero(step > GAP * usual),
                    f"has a gap (rows are usually {usual:.6g} s apart)",
                    "split the recording there or fill the rows in",
                ),
            )
            if rows.size
        ]
        if problems:
            raise UserError(*problems)
        return time


def more(count: int) -> str:
    """What follows the first of `count` places that have the same trouble."""
    return f" (and in {count - 1} more rows)" if count > 1 else ""


def _endings(column: str) -> list[str]:
    """v_m_s -> [_m_s, _s]: all that may be the unit in a column's name."""
    return [column[k:] for k, letter in enumerate(column) if letter == "_"]


def _suffix(column: str, ending: str, unit: str) -> str | None:
    """The unit that a name's ending stands for, if it measures what `unit` does: _m_s2 -> m/s^2."""
    if not column.endswith(ending) or not SUFFIX.fullmatch(ending):
        return None
    text = "/".join(re.sub(r"(\d)$", r"^\1", part) for part in ending[1:].split("_"))
    try:
        _scale(text, unit)
    except UnitError:
        return None
    return text


def _scale(given: str, unit: str) -> float:
    """How many SI units one `given` is; g is the acceleration of gravity where an acceleration is asked for."""
    if given.strip() == "g":
        try:
            return factor("g_n", unit)
        except UnitError:
            pass
    return factor(given, unit)


def aliases(texts: Iterable[str], known: Iterable[str]) -> dict[str, str]:
    """Texts like `x=pos_mm` or `x=Weg 1 [mm]`: the model's name, which must be known (or time), the file's name and, if
    need be, its unit."""
    pairs: dict[str, str] = {}
    known = list(known)
    for text in texts:
        match = ALIAS.match(text)
        if match is None:
            raise UserError(f"channel \"{text}\" is not understood; write the model's name = the file's name [unit]")
        if match[1] not in (*known, "time"):
            what = f'channel {match[1]}: the model has no input or sensor "{match[1]}"'
            raise UserError(f"{what}; {hint(match[1], known)}")
        pairs[match[1]] = match[2] if match[3] is None else f"{match[2]} [{match[3]}]"
    return pairs


def _named(pairs: Mapping[str, str], units: dict[str, str | None]) -> dict[str, str]:
    """Aliases without their units, which replace those in `units`."""
    plain = {}
    for name, text in pairs.items():
        column, bracket, unit = text.partition(" [")
        plain[name] = column
        if bracket and column in units:
            units[column] = unit.removesuffix("]")
    return plain


def read(path: Path, names: Iterable[str] | None = None, pairs: Mapping[str, str] | None = None) -> list[Recording]:
    """Read a file of any known kind: one table per clock, each with a channel time. `pairs` are aliases.

    Of an MDF file only the channels `names` are read (default: all that are numbers). UserError says what is wrong.
    """
    pairs = pairs or {}
    try:
        with open(path, "rb") as file:
            start = file.read(8)
    except OSError as exc:
        raise UserError(f"{path}: {exc.strerror or exc}; name a CSV file that can be read") from exc
    if start in (b"MDF     ", b"UnFinMF ") or path.suffix.lower() in (".mf4", ".mdf"):
        return _read_mdf(path, names, pairs)
    table = read_csv(path)
    plain = _named(pairs, table.units)
    return [Recording(table.path, table.lines, table.units, table.columns, plain)]


def pick(tables: list[Recording], name: str, unit: str) -> Recording:
    """The table that holds a channel; UserError if none or several do."""
    holding = [table for table in tables if table.find(name, unit) is not None]
    if len(holding) > 1:
        raise UserError(f"{tables[0].path}: channel {name} is there {len(holding)} times; keep one of them")
    if not holding:
        known = sorted({c for table in tables for c in table.columns} - {"time"})
        raise UserError(f"{tables[0].path}: there is no channel {name}; {hint(name, known)}")
    return holding[0]


def on_raster(tables: list[Recording], wanted: Mapping[str, str], sample_time: float) -> tuple[Array, Array, list[str]]:
    """Channels (name -> unit) on one raster [s] over the time that all of them cover; values [n, channels], SI, notes.

    UserError lists every gap, missing value or missing channel: this is for input that must be complete.
    """
    problems: list[str] = []
    held: dict[int, tuple[Recording, list[str]]] = {}
    for name, unit in wanted.items():
        try:
            table = pick(tables, name, unit)
            table.channel(name, unit)
            held.setdefault(id(table), (table, []))[1].append(name)
        except UserError as exc:
            problems += exc.problems
    clocks = {}
    for key, (table, _) in held.items() or [(0, (tables[0], []))]:
        try:
            clocks[key] = table.time()
        except UserError as exc:
            problems += exc.problems
    if problems:
        raise UserError(*problems)
    first, last = max(t[0] for t in clocks.values()), min(t[-1] for t in clocks.values())
    if last <= first:
        raise UserError(f"{tables[0].path}: its channels share no time; record them together")
    columns: dict[str, Array] = {}
    notes: list[str] = []
    for key, (table, names) in held.items():
        time = clocks[key]
        values = np.column_stack([table.channel(name, wanted[name]) for name in names])
        raster, values, note = resample(time, values, sample_time, first, last)
        columns |= dict(zip(names, values.T))
        notes += [note] if note else []
    return raster, np.column_stack([columns[name] for name in wanted]), list(dict.fromkeys(notes))


def _read_mdf(path: Path, names: Iterable[str] | None, pairs: Mapping[str, str]) -> list[Recording]:
    wanted = None if names is None else frozenset(pairs.get(name, name).partition(" [")[0] for name in names)
    return [Recording(path, None, units, columns, _named(pairs, units)) for units, columns in mdf.read(path, wanted)]


def _number(text: str, decimal: str) -> float:
    return float(text.replace(decimal, ".")) if text.strip() else float("nan")


def read_csv(path: Path) -> Recording:
    """Read a recording; UserError if the file cannot be read or is no table of numbers under a header."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            text = file.read()
        first = next((line for line in io.StringIO(text) if not line.isspace()), "")
        separator = next((s for s in ";\t" if s in first and "," not in first), ",")
        numbers = _numbers(text, separator)
        reader = csv.reader(io.StringIO(text, newline="") if numbers is None else [first], delimiter=separator)
        rows, lines = [], []
        for row in reader:
            if any(map(str.strip, row)):
                rows.append(row)
                lines.append(reader.line_num)
    except OSError as exc:
        raise UserError(f"{path}: {exc.strerror or exc}; name a CSV file that can be read") from exc
    except (UnicodeDecodeError, csv.Error) as exc:
        raise UserError(f"{path}: it is no CSV text ({exc}); give a comma-separated file") from exc
    if not rows:
        raise UserError(f'{path}: it is empty; the first row must be a header like "time [s],z_road [m]"')
    problems: list[str] = []
    units: dict[str, str | None] = {}
    for cell in rows[0]:
        match = HEADER.match(cell)
        if match is None:
            problems.append(f'{path}:1: "{cell.strip()}" is no channel; write a name and its unit, like "z_road [m]"')
        elif match[1] in units:
            problems.append(f"{path}:1: channel {match[1]} is there twice; rename or remove one")
        else:
            units[match[1]] = match[2] if match[2] is not None else match[3]
    if problems:
        raise UserError(*problems)
    names, decimal = list(units), "." if separator == "," else ","
    if numbers is not None:
        return Recording(path, np.arange(2, len(numbers) + 2), units, dict(zip(names, numbers.T.copy())))
    del rows[0], lines[0]
    for line, row in zip(lines, rows):
        if len(row) != len(names):
            raise UserError(
                f"{path}:{line}: {len(row)} values for {len(names)} channels; "
                f"give one value a channel, separated by {'commas' if separator == ',' else 'the same sign'}"
            )
    try:
        columns = [_column(cells, decimal) for cells in zip(*rows)] or [np.empty(0) for _ in names]
    except ValueError:
        raise UserError(*_no_numbers(path, lines, rows, names, decimal)) from None
    return Recording(path, np.array(lines, dtype=np.int64), units, dict(zip(names, columns)))


def _numbers(text: str, separator: str) -> Array | None:
    """The numbers [rows, channels] under a header in the first line, five times sooner than row by row; None if there is anything
    else in a text, which is then looked at closely."""
    head, _, body = text.partition("\n")
    if not head.strip() or not body.strip():
        return None
    try:
        found = np.loadtxt(io.StringIO(body), delimiter=separator, comments=None, ndmin=2)
    except ValueError:
        return None
    return found if found.shape == (body.rstrip().count("\n") + 1, head.count(separator) + 1) else None


def _column(cells: tuple[str, ...], decimal: str) -> Array:
    try:
        return np.fromiter(map(float, cells), np.float64, len(cells))
    except ValueError:  # an empty cell, a decimal comma or no number
        return np.fromiter((_number(cell, decimal) for cell in cells), np.float64, len(cells))


def _no_numbers(path: Path, lines: list[int], rows: list[list[str]], names: list[str], decimal: str) -> list[str]:
    """What is wrong in the first row that holds anything else than numbers."""
    for line, row in zip(lines, rows):
        problems = []
        for name, cell in zip(names, row):
            try:
                _number(cell, decimal)
            except ValueError:
                problems.append(f'{path}:{line}: channel {name}: "{cell.strip()}" is no number; correct the cell')
        if problems:
            return problems
    raise AssertionError("a cell failed before")


def resample(
    time: Array, values: Array, sample_time: float, first: float | None = None, last: float | None = None
) -> tuple[Array, Array, str]:
    """Put rows [n, channels] on the raster first + k*sample_time <= last; default is all of `time`.

    Rows slower than the raster are joined by straight lines; faster ones are low-passed without phase first. Returns
    raster, values, and a note that is empty if the rows lay on the raster already (within 1/1000 sample).
    """
    first = float(time[0]) if first is None else first
    count = int(((time[-1] if last is None else last) - first) / sample_time + 1e-3) + 1
    raster = first + np.arange(count) * sample_time
    begin = int(np.searchsorted(time, first - 1e-3 * sample_time))
    inside = time[begin : begin + count]
    if inside.size == count and np.all(np.abs(inside - raster) <= 1e-3 * sample_time):
        return raster, values[begin : begin + count], ""
    usual = float(np.median(np.diff(time)))
    how = "by straight lines"
    if usual < 0.999 * sample_time:
        grid = time[0] + np.arange(round((time[-1] - time[0]) / usual) + 1) * usual
        even = values
        if grid.size != time.size or np.max(np.abs(grid - time)) > 1e-2 * usual:
            even = np.column_stack([np.interp(grid, time, column) for column in values.T])
        moved = Kernel(raster, float(grid[0]), usual, grid.size, sample_time).apply(even)
        how = f"by a low-pass without phase ({PASS_BAND * 0.5 / sample_time:.4g} Hz)"
    else:
        moved = np.column_stack([np.interp(raster, time, column) for column in values.T])
    note = (
        f"resampled {how} from {time.size} rows {usual * 1e3:.6g} ms apart "
        f"to {count} samples {sample_time * 1e3:.6g} ms apart"
    )
    return raster, moved, note


class Kernel:
    """Band-limited interpolation from samples start + k*interval, k < count, to the times of a raster.

    A sinc under a Kaiser window, symmetric (no phase), each row of weights with the sum 1: passes what lies below
    PASS_BAND of the Nyquist frequency of the raster, and stops what lies above that frequency.
    """

    def __init__(self, raster: Array, start: float, interval: float, count: int, sample_time: float):
        wide = max(sample_time, interval)
        self.half = int(np.ceil((STOP_BAND - 7.95) / 14.36 / (0.5 * (1.0 - PASS_BAND)) / 2.0 * wide / interval))
        place = (raster - start) / interval
        self.base = np.floor(place + 1e-6).astype(np.int64)
        self.part = place - self.base
        self.count, self.cut = count, 0.5 * (1.0 + PASS_BAND) * interval / wide
        self.same = bool(np.ptp(self.part) < 1e-6)  # one row of weights serves all

    def _weights(self, part: Array) -> Array:
        offset = np.arange(1 - self.half, self.half + 1) - part[:, None]
        inside = np.sqrt(np.maximum(0.0, 1.0 - (offset / self.half) ** 2))
        weights = np.sinc(self.cut * offset) * np.i0(0.1102 * (STOP_BAND - 8.7) * inside) * (inside > 0.0)
        return weights / weights.sum(axis=1, keepdims=True)

    def apply(self, values: Array, magnitude: bool = False) -> Array:
        """Rows [count, channels] on the raster, turned round at both ends; `magnitude`: by the weights' shares."""
        out = np.empty((self.base.size, values.shape[1]))
        for first in range(0, self.base.size, 16384):  # bounded memory
            rows = slice(first, first + 16384)
            weights = self._weights(self.part[rows][:1] if self.same else self.part[rows])
            if magnitude:
                weights = np.abs(weights) / np.abs(weights).sum(axis=1, keepdims=True)
            index = self.base[rows, None] + np.arange(1 - self.half, self.half + 1)
            near = np.clip(index, 0, self.count - 1)
            mirror = np.clip(2 * near - index, 0, self.count - 1)
            for k, column in enumerate(values.T):
                taken = column[near] if magnitude else 2.0 * column[near] - column[mirror]
                out[rows, k] = np.einsum("ij,ij->i", np.broadcast_to(weights, index.shape), taken)
        return out
