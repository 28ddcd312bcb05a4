# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings as files: each kind goes to its reader, and names of the file become those of the model."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from ..errors import UserError, hint
from . import mdf
from .csv_text import read_csv
from .table import Recording

ALIAS = re.compile(r"^\s*(\w+)\s*=\s*(.*?\S)\s*(?:\[(.*)\])?\s*$")


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


def _read_mdf(path: Path, names: Iterable[str] | None, pairs: Mapping[str, str]) -> list[Recording]:
    wanted = None if names is None else frozenset(pairs.get(name, name).partition(" [")[0] for name in names)
    return [Recording(path, None, units, columns, _named(pairs, units)) for units, columns in mdf.read(path, wanted)]
