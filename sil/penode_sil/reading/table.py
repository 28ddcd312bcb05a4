# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A recording as it was read: one table with one clock, whose channels come in SI when they are asked for."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError, hint
from ..units import UnitError, factor

Array = NDArray[np.float64]
GAP = 1.5  # an interval longer than this many usual (median) intervals is a gap
TIME = ("time", "t", "Time")
# what a column's name may end in; what follows the first is divided by: m_s2 is m/s^2
SUFFIX = re.compile(r"(?:_(?:[mu]?s|[cmuk]?m|k?N|k?g|rad|deg|m?V|m?A|k?Pa|bar|K|Hz)\d?)+$")


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
