# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Text as a table: whatever stands around them, columns of cells under names, with a unit where one is written."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ...errors import RecordingError
from ..table import Recording
from . import cells, dates, header, layout, notation
from .decode import read_text

Array = NDArray[np.float64]
Lines = NDArray[np.int64]
Flags = NDArray[np.bool_]


def read_csv(path: Path) -> Recording:
    """Read a recording; UserError if the file cannot be read or is no table. Cells are judged when a channel is asked for."""
    text, encoding = read_text(path)
    lines = _joined(text).split("\n")
    try:
        found = layout.find(lines)
        if found is None:
            raise RecordingError(f'{path}: it is empty; the first row must be a header like "time [s],z_road [m]"')
        between, decimals = layout.NAMED.get(found.separator, found.separator), "commas" if found.decimal == "," else "points"
        form = f"{encoding}, columns between {between}, decimal {decimals}"
        named = _named(found)
        values = _fast(lines[found.body :], found, len(named))
        if values is not None:
            columns = dict(zip((c.key for c in named), values.T.copy(), strict=True))
            return _table(path, found, named, np.arange(found.body, found.body + len(values)) + 1, columns, form)
        return _slow(path, lines, found, named, form)
    except csv.Error as exc:
        raise RecordingError(f"{path}: it is no CSV text ({exc}); give a comma-separated file") from exc


def _joined(text: str) -> str:
    """The text with line ends inside of quoted cells of its first lines made blanks, as Excel has them in headers."""
    head = text[:20000]
    if '"' not in head or "\n" not in head:
        return text
    inside, opened, out = False, 0, []
    for k, c in enumerate(head):
        if c == '"':
            inside = not inside
            opened = k if inside else opened
        out.append(" " if c == "\n" and inside else c)
    closed = opened if inside else len(head)
    return "".join(out[:closed]) + text[closed:]


def _named(found: layout.Layout) -> list[header.Cell]:
    """The columns; names without any column at the end of the header are left out, as a separator at the line's end makes them."""
    names, units = list(found.names) or [""], found.units
    while len(names) > max(1, found.width) and not names[-1].strip() and found.header < found.body:
        names.pop()
    while len(names) > max(1, found.width - 1) and not names[-1].strip() and found.header < found.body:
        names.pop()
    return header.cells(names, units)


def _table(
    path: Path,
    found: layout.Layout,
    named: Sequence[header.Cell],
    lines: Lines,
    columns: Mapping[str, Array],
    form: str,
    stamped: frozenset[str] = frozenset(),
) -> Recording:
    units = {cell.key: "s" if cell.key in stamped else cell.unit for cell in named}
    texts = {cell.key: (cell.name, cell.text) for cell in named}
    return Recording(path, lines, units, columns, {}, found.header + 1, texts, form)


def _fast(body: Sequence[str], found: layout.Layout, width: int) -> Array | None:
    """The numbers [rows, channels] if there is nothing else, five times sooner than row by row; None if there is."""
    text = "\n".join(body).rstrip()
    if found.decimal == ",":
        if "." in text or found.separator == ",":
            return None
        text = text.replace(",", ".")
    if not text or "_" in text:
        return None
    delimiter = None if found.separator == layout.BLANKS else found.separator
    try:
        values = np.loadtxt(io.StringIO(text), delimiter=delimiter, comments=None, ndmin=2)
    except ValueError:
        return None
    if values.shape != (text.count("\n") + 1, width):
        return None
    return values if all(_is_clear(body, found, k) for k in np.flatnonzero(_may_be_thousands(values)).tolist()) else None


def _may_be_thousands(values: Array) -> Flags:
    """The columns of numbers [rows, channels] in which none has more than three decimals, or is larger than 999.999, and some have any."""
    with np.errstate(over="ignore", invalid="ignore"):
        thousandths = values * 1e3
        fine = np.isclose(thousandths, np.rint(thousandths), rtol=0.0, atol=1e-6) & (np.trunc(thousandths * 1e-6) == 0.0)
        parted = np.abs(values - np.rint(values)) > 0.0
    found: Flags = np.all(fine | np.isnan(values), axis=0) & np.any(parted, axis=0)
    return found


def _is_clear(body: Sequence[str], found: layout.Layout, column: int) -> bool:
    """Has a column a number that can only be one with a fraction? Looked for up to the first one."""
    for line in body:
        row = layout.split(line, found.separator)
        if column < len(row) and found.decimal in notation.seen(row[column : column + 1]).fractions:
            return True
    return False


def _slow(path: Path, lines: Sequence[str], found: layout.Layout, named: Sequence[header.Cell], form: str) -> Recording:
    """The same cell by cell."""
    width = len(named)
    rows: list[list[str]] = []
    where: list[int] = []
    for line, row in _rows(lines, found):
        if len(row) > width and any(cell.strip() for cell in row[width:]) and cells.is_number(row[width - 1]):  # no text with commas
            what = f"{path}:{line}: {len(row)} values for {width} channels"
            if found.separator == "," and found.width > width and layout.looks_unseparated(named, row):
                raise RecordingError(f"{what}: commas part columns and decimals; export with semicolons or decimal points")
            raise RecordingError(f"{what}; give one value a channel, separated by {layout.NAMED.get(found.separator, found.separator)}")
        rows.append(row)
        where.append(line)
    numbers = np.array(where, dtype=np.int64)
    short = {k: len(row) for k, row in enumerate(rows) if len(row) < width}
    texts = {c.key: [row[k] if k < len(row) else None for row in rows] for k, c in enumerate(named)}
    first = {key: next((cell for cell in column if cell and cell.strip()), "") for key, column in texts.items()}
    stamped = frozenset(key for key, cell in first.items() if dates.STAMP.fullmatch(cell))
    columns = cells.Columns(texts, found.decimal, stamped, lambda row: f"{path}:{numbers[row]}", short)
    return _table(path, found, named, numbers, columns, form, stamped)


def _rows(lines: Sequence[str], found: layout.Layout) -> list[tuple[int, list[str]]]:
    """Rows of cells with the lines [1, ...] that they end in; without blank lines and comments."""
    first = found.body
    if found.separator == layout.BLANKS:
        some = [(k, line.split()) for k, line in enumerate(lines[first:], first + 1)]
    else:
        reader = csv.reader([line + "\n" for line in lines[first:]], delimiter=found.separator, skipinitialspace=True)
        some = [(reader.line_num + first, row) for row in reader]
    return [(k, row) for k, row in some if any(map(str.strip, row)) and not (row[0][:1] in "#%" and row[0])]
