# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Static DAQ lists of a linked program (penode/pen_xcp_static.h), as its constants say."""

from __future__ import annotations

from dataclasses import dataclass

from ..interface import ExportError
from .elf_types import Place, Program, type_name

SYMBOL = "penode_daq_lists"
_TYPE = "pen_xcp_statics_t"
_NO_BIT = 0xFF


@dataclass(frozen=True)
class StaticList:
    """A list: sizes, the number of its first ODT, and of a predefined one what each ODT holds: (number of entry, address, bytes, bit)."""

    number: int
    odts: int
    entries: int
    first: int
    predefined: tuple[tuple[tuple[int, int, int, int], ...], ...]


def static_lists(program: Program) -> list[StaticList]:
    """The lists of the variable `penode_daq_lists`; [] if the program has none: its lists are dynamic. Raises ExportError."""
    try:
        whole = program.find(SYMBOL)
    except KeyError:
        return []
    if type_name(whole.type) != _TYPE:
        raise ExportError(
            f"{program.path}: {SYMBOL} is of the type {type_name(whole.type) or 'without a name'}; make it a constant of the type {_TYPE}"
        )
    try:
        found: list[StaticList] = []
        for n in range(program.number(program.find(f"{SYMBOL}.lists"))):
            place = _there(program.pointed(program.find(f"{SYMBOL}.list"), n))
            found.append(_list(program, place, n, sum(before.odts for before in found)))
    except KeyError as exc:
        raise ExportError(
            f"{program.path}: what {SYMBOL} points to is not in the file; make it, its lists and their entries constants"
        ) from exc
    return found


def _there(place: Place | None) -> Place:
    if place is None:
        raise KeyError("NULL")
    return place


def _list(program: Program, place: Place, number: int, first: int) -> StaticList:
    odts, entries = (program.number(program.member(place, name)) for name in ("odts", "entries"))
    pointer = program.member(place, "entry")
    constants = []
    for odt in range(odts if program.pointed(pointer) is not None else 0):
        held = []
        for n in range(entries):
            entry = _there(program.pointed(pointer, odt * entries + n))
            address, size = (program.number(program.member(entry, name)) for name in ("byte", "size"))
            if size:
                held.append((n, address, size, _NO_BIT))
        constants.append(tuple(held))
    return StaticList(number, odts, entries, first, tuple(constants))
