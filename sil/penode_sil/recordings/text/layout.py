# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where things stand in the text of a table: separator, decimal sign, header, row of units, first row of values."""

from __future__ import annotations

import csv
import itertools
import re
from collections import Counter
from collections.abc import Sequence, Sized
from dataclasses import dataclass

from .. import named
from . import header
from .cells import NUMBER, decimal_sign, is_number

BLANKS = " "  # the separator of tables whose columns stand between blanks
SEPARATORS = (";", "\t", "|", ",", BLANKS)  # where two part a text equally well, the first
NAMED = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars", BLANKS: "blanks"}
STATED = re.compile(r'^\s*"?sep=([^\w"\'.+\-]|\\t)"?\s*$', re.IGNORECASE)
COMMENT = re.compile(r"^\s*(?:#|%|//|!)+\s*")
HEAD, TAIL = 400, 60  # lines looked at from both ends
TIMES = frozenset(
    "time t zeit timestamp timestamps time_stamp time_stamps zeitstempel elapsed_time time_axis x_value uhrzeit datetime "
    "date_time temps tiempo tempo seconds".split()
)


@dataclass(frozen=True)
class Layout:
    """Lines are counted from 0. `units` is None if there is no row of units, `body` the first line of values."""

    separator: str
    decimal: str
    names: list[str]
    header: int
    units: list[str] | None
    units_line: int
    body: int
    width: int  # cells in most rows of values


def split(line: str, separator: str) -> list[str]:
    """The cells of one line; csv.Error if it cannot be split."""
    if separator == BLANKS:
        return line.split()
    return next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])


def find(lines: Sequence[str]) -> Layout | None:
    """The layout of a text; None if it has nothing but blank lines. csv.Error if a line cannot be split."""
    first = next((k for k, line in enumerate(lines) if line.strip()), None)
    if first is None:
        return None
    stated = STATED.match(lines[first])
    if stated:
        first = next((k for k in range(first + 1, len(lines)) if lines[k].strip()), first)
        if first + 1 > len(lines) or STATED.match(lines[first]):
            return None
    some = [line for line in lines[max(first, len(lines) - 2 * TAIL) :] if line.strip() and not COMMENT.match(line)]
    sample = some[-min(TAIL, max(2, (3 * len(some) + 4) // 5)) :]
    sample = sample[: -1 if len(sample) > 20 else None]  # the last line of a file that broke off
    tab = stated[1].replace("\\t", "\t") if stated else None
    separator = tab or _separator(lines[first], sample)
    decimal = decimal_sign([split(line, separator) for line in sample])
    return _placed(lines, first, separator, decimal, sample)


def _separator(head: str, sample: Sequence[str]) -> str:
    """The sign that parts most lines into the same number of cells, most of them values."""
    best = max(SEPARATORS, key=lambda separator: _score(separator, sample))
    if _score(best, sample) > 0.0:
        return best
    return next((s for s in ";\t" if s in head and "," not in head), ",")


def _score(separator: str, sample: Sequence[str]) -> float:
    """0 to 1, and less than half for a table of one column."""
    rows = [split(line, separator) for line in sample]
    if not rows:
        return 0.0
    width, often = Counter(map(len, rows)).most_common(1)[0]
    values = [_values(row) for row in rows if len(row) == width]
    share = sum(values) / len(values) * often / len(rows)
    return share * (1.0 if width > 1 else 0.4)


def _values(row: Sequence[str]) -> float:
    """The share of values among the cells of a row that are not empty; the last one may be."""
    some = [cell for cell in row if cell.strip()]
    return sum(map(is_number, some)) / len(some) if some else 0.0


def _placed(lines: Sequence[str], first: int, separator: str, decimal: str, sample: Sequence[str]) -> Layout:
    rows = [split(line, separator) for line in sample] or [[]]
    width = Counter(map(len, rows)).most_common(1)[0][0]
    valued = [values for row in rows if len(row) == width and any(values := [is_number(cell) or not cell.strip() for cell in row])]
    share = [sum(column) / len(valued) for column in zip(*valued, strict=True)]
    columns = {k for k, part in enumerate(share) if part >= min(0.9, max(share))}
    upto = min(len(lines), first + HEAD)
    body = next((k for k in range(first, upto) if _is_body(lines[k], separator, width, columns)), None)
    if body is None:  # no values
        return Layout(separator, decimal, _cells(lines[first], separator), first, None, first, first + 1, width)
    above = [k for k in range(first, body) if lines[k].strip() and _values(_cells(lines[k], separator)) < 1.0]
    grid = {k: _cells(lines[k], separator, width) for k in above}
    fitting = [k for k in above if abs(len(grid[k]) - width) <= 1 and any(c.strip() for c in grid[k])]
    if not fitting:
        fitting = above[-1:]
    if not fitting:
        return Layout(separator, decimal, [""] * width, body, None, body, body, width)
    fitting = _together(fitting, above)
    at = _names(fitting, grid)
    units = next((k for k in fitting if k > at and header.are_units(grid[k], 0.5)), None)
    if units is None and at != fitting[0] and header.are_units(grid[fitting[fitting.index(at) - 1]]):
        units = fitting[fitting.index(at) - 1]
    return Layout(separator, decimal, grid[at], at, None if units is None else grid[units], at if units is None else units, body, width)


def _together(fitting: list[int], above: list[int]) -> list[int]:
    """The last of the lines that follow each other without another one between them."""
    kept = [fitting[-1]]
    for k in reversed(fitting[:-1]):
        if above.index(kept[0]) - above.index(k) > 1:
            break
        kept.insert(0, k)
    return kept


def _names(fitting: list[int], grid: dict[int, list[str]]) -> int:
    """The row of names: the last one that names a time, else the row above the units, else the last one."""
    for k in reversed(fitting):
        if any(_is_time(cell) for cell in grid[k]) and not header.are_units(grid[k]):
            return k
    for below, k in itertools.pairwise(reversed(fitting)):
        if header.are_units(grid[below]):
            return k
    return fitting[-1]


def _is_time(cell: str) -> bool:
    (found,) = header.cells([cell])
    name = named.plain(found.name)
    return name in TIMES or (name.split("_")[0] in ("time", "t", "zeit") and len(name) < 12)


def _cells(line: str, separator: str, width: int = 0) -> list[str]:
    """Cells of a line above the values, without the sign of a comment; between blanks, names and units stay together."""
    plain = COMMENT.sub("", line)
    if separator != BLANKS:
        return split(plain, separator)
    wide = re.split(r"\s{2,}|\t", plain.strip())
    if len(wide) == width:
        return wide
    close = re.findall(r"[^\s\[(]+(?:\s?(?:\[[^\]]*\]|\([^)]*\)))*|[\[(][^\])]*[\])]", plain)
    return close if len(close) == width else plain.split()


def _is_body(line: str, separator: str, width: int, columns: set[int]) -> bool:
    """Is a line a row of values: as many cells as most rows, and values in the columns that have values elsewhere?"""
    if COMMENT.match(line) or not line.strip():
        return False
    row = split(line, separator)
    if not columns or not (width - 1 <= len(row) <= width + 1):
        return False
    known = [row[k] for k in columns if k < len(row)]
    return any(map(is_number, known)) and all(is_number(cell) or not cell.strip() for cell in known)


def looks_unseparated(names: Sized, row: Sequence[str]) -> bool:
    """Has a row more values than there are names, most of them whole numbers: do commas part both cells and decimals?"""
    return len(names) < len(row) <= 2 * len(names) and all(NUMBER.fullmatch(cell) for cell in row) and "." not in "".join(row)
