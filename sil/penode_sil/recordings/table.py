# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A recording as it was read: one table with one clock, whose channels come in SI when they are asked for."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError, UserError, hint
from . import named, unit_text
from .order import Ordered, ordered
from .stamps import evened
from .uneven import longest
from .units import UnitError

Array = NDArray[np.float64]
GAP = 1.5  # an interval longer than this many usual (median) intervals is a gap
TIME = ("time", "t", "Time")
OTHER_TIMES = (
    "time",
    "t",
    "zeit",
    "timestamp",
    "timestamps",
    "time_stamp",
    "time_stamps",
    "zeitstempel",
    "elapsed_time",
    "time_axis",
    "x_value",
    "uhrzeit",
    "datetime",
    "date_time",
    "temps",
    "tiempo",
    "tempo",
)
# what a column's name may end in; signs between them part or multiply: m_s2 is m/s^2, N_s_m is N*s/m
PART = (
    r"(?:[mun]?s|[mu]?sec|mps|min|h|[cmuk]?m"
    r"|ft|mph|[mkM]?N|lbf|Nm|Ns|k?g|mg|rad|deg[CF]|deg|rpm|dps|kmh|kph|m?V|m?A|[kM]?Pa|psi|bar|K|k?Hz|kW|W|J|pct)\d?"
)
SUFFIX = re.compile(rf"(?:[ _]{PART})+$")
WRITTEN = re.compile(rf"[ _./,:-]+({PART}(?:[/*^]{PART})*)$|\s+(\S*[/^²³°%·*]\S*)$")


@dataclass(frozen=True, eq=False)
class Recording:
    """A table as it was read, with one clock: per column its unit text (None if it has none) and values (NaN if empty).

    `lines` is the line of the file that each row came from, None if it has no lines; `aliases` gives, for names of the
    model, what the user calls them: `column`, `column [unit]`, `column@10ms`. `texts` gives for a column its name and all
    the text of its header cell; a name that stands there several times has the keys name#1, name#2.
    """

    path: Path
    lines: NDArray[np.int64] | None
    units: dict[str, str | None]
    columns: Mapping[str, Array]
    aliases: Mapping[str, str] = field(default_factory=dict)
    header_line: int = 1
    texts: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    form: str = ""  # encoding and signs, for people

    def place(self, row: int) -> str:
        """Where a row stands, for messages."""
        return f"{self.path}: sample {row + 1}" if self.lines is None else f"{self.path}:{self.lines[row]}"

    @property
    def header(self) -> str:
        """Where names and units stand, for messages."""
        return str(self.path) if self.lines is None else f"{self.path}:{self.header_line}"

    def name_of(self, key: str) -> str:
        """The name of a column as the file has it, without its unit."""
        return self.texts.get(key, (key, key))[0]

    def find(self, name: str, unit: str) -> str | None:
        """The column that holds channel `name`, None if there is none; UserError if there are several."""
        if name in self.aliases:
            return self._only(name, named.columns(self.aliases[name], self.units, self.texts), unit)
        for found in self._candidates(name, unit):
            if found:
                return self._only(name, found, unit)
        return None

    def _candidates(self, name: str, unit: str) -> Iterator[list[str]]:
        """Columns that may be a channel, the closest first: its name; with a unit behind it; in other letters."""
        yield [key for key in self.columns if name in (key, self.name_of(key))]
        stems: tuple[str, ...] = TIME if name == "time" else (name,)
        yield [c for c in self.columns if self.name_of(c) in stems or any(self._spelt(c, stem, unit) for stem in stems)]
        stems = OTHER_TIMES if name == "time" else (named.plain(name),)
        yield [c for c in self.columns if named.plain(self.name_of(c)) in stems]
        low = {c: named.plain(self.name_of(c)) for c in self.columns if self.units[c] is None}
        yield [c for c, text in low.items() if any(text.startswith(s + "_") and self._behind(c, len(s), unit) for s in stems)]
        if name == "time":
            yield self._rising()

    def _behind(self, key: str, size: int, unit: str) -> bool:
        return _suffix(self.name_of(key)[size:], unit) is not None

    def _rising(self) -> list[str]:
        """Columns with a unit of time that increase from row to row."""
        found = []
        for key, unit in self.units.items():
            try:
                if unit is not None and unit_text.scale(unit, "s") > 0.0 and np.all(np.diff(self.columns[key]) > 0.0):
                    found.append(key)
            except (UnitError, UserError):
                continue
        return found

    def _only(self, name: str, found: list[str], unit: str) -> str | None:
        """The only one of several columns, the first if they hold the same; UserError in doubt."""
        if len(found) < 2:
            return found[0] if found else None
        if len({self.name_of(key) for key in found}) == 1:
            first = self.columns[found[0]]
            if all(np.array_equal(first, self.columns[key], equal_nan=True) for key in found[1:]):
                return found[0]
            says = " or ".join(named.option(name, key) for key in found)
            often = "twice" if len(found) == 2 else f"{len(found)} times"
            raise RecordingError(f"{self.header}: channel {name} is there {often}; rename or remove one, or say {says}", channel=name)
        says = " or ".join(named.option(name, self.name_of(key)) for key in found)
        raise RecordingError(
            f"{self.header}: channel {name} may be {' or '.join(found)}; rename or remove one, or say {says}", channel=name
        )

    def _spelt(self, column: str, stem: str, unit: str) -> bool:
        """Is the column's name `stem`_UNIT with a unit that measures what `unit` does?"""
        ending = self.name_of(column).removeprefix(stem)
        return self.units[column] is None and ending != self.name_of(column) and _suffix(ending, unit) is not None

    def unit_of(self, name: str, key: str, unit: str) -> str | None:
        """The unit text of a column that holds channel `name`: the user's, the header's, the user's for another channel in the
        same column, or the end of its name."""
        alias = self.aliases.get(name)
        given = None if alias is None else named.unit(alias, self.units, self.texts)
        given = self.units[key] if given is None else given
        given = named.unit_of(key, self.aliases, self.units, self.texts) if given is None else given
        if given is None and self.name_of(key) != name:
            endings = _endings(self.name_of(key))
            given = next((u for u in (_suffix(e, unit) for e in endings) if u is not None), None)
        return given

    def conversion(self, name: str, unit: str) -> tuple[float, float]:
        """How many SI units one unit of a channel of this table is, and how many 0 of it is; UserError names line and channel."""
        column = self.find(name, unit)
        return (1.0, 0.0) if column is None else self._conversion(name, column, unit)

    def _conversion(self, name: str, column: str, unit: str) -> tuple[float, float]:
        given = self.unit_of(name, column, unit)
        called = self.aliases.get(name, column)
        option = named.option(name, named.with_unit(called, unit, self.units, self.texts))
        if given is None or (given.strip() in ("", "-", "?") and not _plain(unit)):
            where = f'"{self.name_of(column)} [{unit or "1"}]" in the header' if self.lines is not None else "it into the file"
            raise RecordingError(f"{self.header}: channel {name} has no unit; write {where}, or say {option}", channel=name)
        try:
            return unit_text.conversion(given, unit)
        except UnitError as exc:
            raise RecordingError(f"{self.header}: channel {name}: {exc}, or say its true unit, like {option}", channel=name) from exc

    def channel(self, name: str, unit: str, finite: bool = True) -> Array:
        """One channel in SI, which must measure what `unit` does and be finite; UserError names line and channel."""
        column = self.find(name, unit)
        if column is None:
            clock = f", or say {named.option('time', '@1ms')} if rows are 1 ms apart" if name == "time" else ""
            raise RecordingError(f"{self.path}: there is no channel {name}; {hint(name, self.columns)}{clock}", channel=name)
        scale, zero = self._conversion(name, column, unit)
        values = self.columns[column]
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size and finite:
            raise RecordingError(
                f"{self.place(bad[0])}: channel {name} has no finite value there{more(bad.size)}; cut the recording or fill the value in",
                channel=name,
            )
        with np.errstate(over="ignore"):
            return values if (scale, zero) == (1.0, 0.0) else values * scale + zero

    def ordered(self, rows: NDArray[np.int64]) -> Ordered:
        """These rows in the order of time; UserError where the clock was set back."""
        return ordered(self.channel("time", "s", finite=False)[rows], lambda k: self.place(int(rows[k])), GAP)

    def time(self, notes: list[str] | None = None) -> Array:
        """The times [s], checked: increasing, without gaps; coarse stamps are spread evenly, which goes to the notes. UserError lists
        each kind of trouble once."""
        time = self.channel("time", "s")
        if np.any(np.diff(time) < 0.0):
            found = self.ordered(np.arange(time.size))
            if np.all(np.diff(found.rows) > 0):
                time = found.time
                if notes is not None:
                    notes.append(found.note.removeprefix(f"{self.path}: "))
        if np.all(np.diff(time) >= 0.0) and (even := evened(time)) is not None:
            time = even.time
            if notes is not None:
                notes.append(even.note)
        if time.size < 2:
            raise RecordingError(f"{self.path}: it has {time.size} rows; at least 2 are needed")
        step = np.diff(time)
        usual = float(np.median(step[step > 0.0])) if np.any(step > 0.0) else 0.0
        problems = [
            f"{self.place(rows[0] + 1)}: channel time {what}{more(rows.size)}; {remedy}"
            for rows, what, remedy in (
                (np.flatnonzero(step < 0.0), "goes back", "sort the rows by time"),
                (np.flatnonzero(step == 0.0), "has the same value as the row before", "remove the duplicate"),
                (
                    np.flatnonzero(step > max(GAP * usual, longest(step[step > 0.0], GAP))),
                    f"has a gap (rows are usually {usual:.6g} s apart)",
                    "split the recording there or fill the rows in",
                ),
            )
            if rows.size
        ]
        if problems:
            raise RecordingError(*problems)
        return time


def more(count: int) -> str:
    """What follows the first of `count` places that have the same trouble."""
    return f" (and in {count - 1} more rows)" if count > 1 else ""


def _plain(unit: str) -> bool:
    return unit.strip() in ("", "-", "1", "%")


def _endings(column: str) -> list[str]:
    """v_m_s -> [_m_s, _s]: all that may be the unit in a column's name."""
    return [column[k:] for k, letter in enumerate(column) if letter in "_ ./,:-"]


def _suffix(ending: str, unit: str) -> str | None:
    """The unit that a name's ending stands for, if it measures what `unit` does: _m_s2 -> m/s^2; None if none or several do."""
    ending = re.sub(r"(?<=s)_2$", "2", ending.rstrip("_"))  # _m_s_2_ as MATLAB makes it of [m/s^2]
    if SUFFIX.fullmatch(ending):
        words = [re.sub(r"(?<=\D)(\d)$", r"^\1", part) for part in re.split("[ _]", ending[1:])]
        texts = ["/".join(words)] + ["*".join(words[:k]) + "/" + "/".join(words[k:]) for k in range(2, len(words))]
    elif match := WRITTEN.fullmatch(ending):
        texts = [match[1] or match[2]]
    else:
        return None
    fitting: dict[float, str] = {}
    for text in texts:
        try:
            fitting.setdefault(unit_text.scale(text, unit), text)
        except UnitError:
            continue
    return next(iter(fitting.values())) if len(fitting) == 1 else None
