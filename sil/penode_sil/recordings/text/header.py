# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Cells of a header as names and units: `z_road [m]`, `Weg / mm`, `"Accel. body (g)"`, `acc_w\\DEV:1`."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from .. import unit_text

BRACKET = re.compile(r"^(.*?)(\s*)\[([^\[\]]*)\]?$", re.DOTALL)
OTHER = re.compile(r"^(.*?)(\s*)(?:\(([^()]*(?:\([^()]*\)[^()]*)?)\)|\{([^{}]*)\}|<([^<>]*)>)$", re.DOTALL)
BEHIND = re.compile(r"^(.*?\S)(?:\s+/\s*|\s*,\s*|\s+in\s+|\s*;\s*|\s+-\s+|\s*:\s+)(\S+)$", re.DOTALL)


@dataclass(frozen=True)
class Cell:
    """A column's key, which no other column has; its name; the unit written with it, None if there is none; all its text."""

    key: str
    name: str
    unit: str | None
    text: str


def cells(texts: Sequence[str], below: Sequence[str] | None = None) -> list[Cell]:
    """The columns of a header; `below` is the row of units, if there is one. Empty cells get the name `column N`."""
    plain = [" ".join(text.replace("\0", " ").split()).strip("'\"").strip() for text in texts]
    indices = Counter(m[1] for m in map(BRACKET.match, plain) if m and not m[2] and m[3].isdigit() and m[3] != "1")
    found = []
    for k, text in enumerate(plain):
        name, unit = (text, None) if (m := BRACKET.match(text)) and m[3].isdigit() and m[1] in indices else _parted(text)
        if below is not None and unit is None:
            given = below[k].strip() if k < len(below) else ""
            unit = given.strip("[]()") if given else None
        found.append((name or f"column {k + 1}", unit, text))
    often, seen = Counter(name for name, *_ in found), Counter[str]()
    out = []
    for name, unit, text in found:
        seen[name] += 1
        out.append(Cell(f"{name}#{seen[name]}" if often[name] > 1 else name, name, unit, text))
    return out


def _parted(text: str) -> tuple[str, str | None]:
    """Name and unit of one cell. In square brackets there is always a unit, elsewhere only what can be one."""
    match = BRACKET.match(text)
    if match and match[1].strip(" _"):
        return match[1].strip().rstrip("_"), match[3].strip()
    match = OTHER.match(text)
    if match and match[1].strip():
        inside = next(group for group in match.groups()[2:] if group is not None).strip()
        if unit_text.is_unit(inside) and not (inside.isdigit() and not match[2]):
            return match[1].strip(), inside
    match = BEHIND.match(text)
    if match and not match[2].isdigit() and unit_text.is_unit(match[2]):
        return match[1].strip(), match[2]
    return text, None


def are_units(texts: Sequence[str], share: float = 1.0) -> bool:
    """Can this share of a row's cells be units, and at least one of them no placeholder?"""
    some = [text.strip() for text in texts if text.strip()]
    units = [text for text in some if unit_text.is_unit(text)]
    return any(text.strip("[]()- 1") for text in units) and len(units) >= share * len(some)
