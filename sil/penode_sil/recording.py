# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings: CSV files whose header carries units, like `time [s],z_road [m],a_body [m/s^2]`."""

from __future__ import annotations

import csv
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import UserError, hint
from .units import UnitError, factor

Array = NDArray[np.float64]
HEADER = re.compile(r"^\s*([A-Za-z_]\w*)\s*(?:\[(.*)\])?\s*$")
GAP = 1.5  # an interval longer than this many usual (median) intervals is a gap


@dataclass(frozen=True, eq=False)
class Recording:
    """A file as it was read: per column its unit text (None if it has none) and its values (NaN where empty)."""

    path: Path
    lines: NDArray[np.int64]  # line of the file that each row came from
    units: dict[str, str | None]
    columns: dict[str, Array]

    def channel(self, name: str, unit: str) -> Array:
        """One channel in SI, which must measure what `unit` does and be finite; UserError names line and channel."""
        if name not in self.columns:
            raise UserError(f"{self.path}: there is no channel {name}; {hint(name, self.columns)}")
        given = self.units[name]
        if given is None:
            raise UserError(f'{self.path}:1: channel {name} has no unit; write "{name} [{unit or "1"}]" in the header')
        try:
            scale = factor(given, unit)
        except UnitError as exc:
            raise UserError(f"{self.path}:1: channel {name}: {exc}") from exc
        values = self.columns[name]
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise UserError(
                f"{self.path}:{self.lines[bad[0]]}: channel {name} has no finite value there"
                f"{_more(bad.size)}; cut the recording or fill the value in"
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
            f"{self.path}:{self.lines[rows[0] + 1]}: channel time {what}{_more(rows.size)}; {remedy}"
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


def _more(count: int) -> str:
    return f" (and in {count - 1} more rows)" if count > 1 else ""


def _number(text: str) -> float:
    return float(text) if text.strip() else float("nan")


def read_csv(path: Path) -> Recording:
    """Read a recording; UserError if the file cannot be read or is no table of numbers under a header."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = [
                (line, row) for line, row in enumerate(csv.reader(file), start=1) if any(cell.strip() for cell in row)
            ]
    except OSError as exc:
        raise UserError(f"{path}: {exc.strerror or exc}; name a CSV file that can be read") from exc
    except (UnicodeDecodeError, csv.Error) as exc:
        raise UserError(f"{path}: it is no CSV text ({exc}); give a comma-separated file") from exc
    if not rows:
        raise UserError(f'{path}: it is empty; the first row must be a header like "time [s],z_road [m]"')
    problems: list[str] = []
    units: dict[str, str | None] = {}
    for cell in rows[0][1]:
        match = HEADER.match(cell)
        if match is None:
            problems.append(f'{path}:1: "{cell.strip()}" is no channel; write a name and its unit, like "z_road [m]"')
        elif match[1] in units:
            problems.append(f"{path}:1: channel {match[1]} is there twice; rename or remove one")
        else:
            units[match[1]] = match[2]
    if problems:
        raise UserError(*problems)
    names, values = list(units), np.empty((len(rows) - 1, len(units)))
    for k, (line, row) in enumerate(rows[1:]):
        if len(row) != len(names):
            raise UserError(
                f"{path}:{line}: {len(row)} values for {len(names)} channels; "
                "give one value a channel, separated by commas"
            )
        try:
            values[k] = [_number(cell) for cell in row]
        except ValueError:
            for name, cell in zip(names, row):
                try:
                    _number(cell)
                except ValueError:
                    problems.append(f'{path}:{line}: channel {name}: "{cell.strip()}" is no number; correct the cell')
            raise UserError(*problems) from None
    lines = np.array([line for line, _ in rows[1:]], dtype=np.int64)
    return Recording(path, lines, units, {name: values[:, i] for i, name in enumerate(names)})


def resample(time: Array, values: Array, sample_time: float) -> tuple[Array, Array, str]:
    """Put rows [n, channels] on the raster time[0] + k*sample_time, by straight lines.

    Returns raster, values, and a note that is empty if the rows lay on the raster already (within 1/1000 sample).
    """
    count = int((time[-1] - time[0]) / sample_time + 1e-3) + 1
    raster = time[0] + np.arange(count) * sample_time
    if count == time.size and np.all(np.abs(time - raster) <= 1e-3 * sample_time):
        return raster, values, ""
    usual = float(np.median(np.diff(time)))
    note = (
        f"resampled by straight lines from {time.size} rows {usual * 1e3:.6g} ms apart "
        f"to {count} samples {sample_time * 1e3:.6g} ms apart"
    )
    if usual < 0.999 * sample_time:
        note += "; nothing was filtered, so that what is faster than the new raster is aliased"
    return raster, np.column_stack([np.interp(raster, time, column) for column in values.T]), note
