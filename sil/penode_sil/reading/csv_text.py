# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""CSV text as a table: a header with units, then rows of numbers."""

from __future__ import annotations

import csv
import io
import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError
from .table import Recording

Array = NDArray[np.float64]
HEADER = re.compile(r"^\s*([A-Za-z_]\w*)\s*(?:\[(.*)\]|\((.*)\))?\s*$")


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
