# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the pages of a controller hold: names of known sets, by checksum, and values that differ."""

from __future__ import annotations

import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import Model

from ..errors import TargetError, WrongUse, hint
from .a2l_read import A2l, Entry
from .codes import Page, Who
from .link import Link


@dataclass(frozen=True, eq=False)
class ChosenSet:
    """A set to be written. `layout` is that of its model."""

    name: str
    layout: int
    values: NDArray[Any]

    @property
    def serial(self) -> bytes:
        """Its values in serial form: little endian."""
        return self.values.astype(self.values.dtype.newbyteorder("<")).tobytes()

    @property
    def checksum(self) -> int:
        return zlib.crc32(self.serial)


def segment(a2l: A2l) -> tuple[int, int, np.dtype[Any]]:
    """Address, bytes and type of the values of a set. Raises UserError."""
    kinds = {entry.type for entry in a2l.characteristics.values()}
    if a2l.segment is None or len(kinds) != 1:
        raise TargetError(
            f"the A2L of {a2l.name} has not one memory segment of one kind of numbers; export it with penode export --format a2l"
        )
    return *a2l.segment, kinds.pop()


def known_sets(model: Model, kind: np.dtype[Any]) -> dict[int, str]:
    """Checksum -> name, with its id, of all sets of a model file."""
    found: dict[int, str] = {}
    for name, chosen in model.sets.items():
        head = penode_gen.set_head(model, name, kind.type)
        found.setdefault(int(head[3]), f"{name} (set {chosen.id})")
    return found


def choose(text: str, kind: np.dtype[Any]) -> ChosenSet:
    """MODEL.toml:NAME, or a file in serial form. Raises UserError."""
    path, _, name = text.rpartition(":")
    if path.endswith(".toml") and Path(path).is_file():
        model = penode_gen.load(path)
        if name not in model.sets:
            raise WrongUse(f'{path}: it has no set "{name}"; {hint(name, model.sets)}')
        layout = penode_gen.set_head(model, name, kind.type)[0]
        return ChosenSet(f"{name} (set {model.sets[name].id})", int(layout), np.asarray(penode_gen.set_values(model, name, kind.type)))
    if text.endswith(".toml") and Path(text).is_file():
        raise WrongUse(f"{text}: which of its sets? Name it as {text}:NAME, one of: {', '.join(penode_gen.load(text).sets)}")
    if not Path(text).is_file():
        raise WrongUse(f"{text}: there is no such file; name a set as MODEL.toml:NAME, or a file in serial form")
    try:
        found = penode_gen.read_serial(Path(text).read_bytes())
    except ValueError as exc:
        raise WrongUse(f"{text}: {exc}; name a set as MODEL.toml:NAME, or a file in serial form") from exc
    if found.values.dtype != kind:
        raise WrongUse(
            f"{text}: its values have {found.values.dtype.itemsize} bytes, those of the controller {kind.itemsize}; write the set in "
            "that form"
        )
    return ChosenSet(f"{Path(text).name} (set {found.id})", found.layout, found.values)


@dataclass(frozen=True, eq=False)
class Pages:
    """What runs, and the reference page: checksums and values; `page` is that of the ECU."""

    page: Page
    running: tuple[int, NDArray[Any]]
    reference: tuple[int, NDArray[Any]]

    def differing(self, a2l: A2l, address: int) -> list[tuple[str, str, float, float]]:
        """Name, unit, running and reference value of each number that is not the same in both."""
        kind = self.running[1].dtype
        found = []
        for entry in a2l.characteristics.values():
            first = (entry.address - address) // kind.itemsize
            pair = [page[1][first : first + entry.count] for page in (self.running, self.reference)]
            for n in np.flatnonzero(pair[0].view(f"u{kind.itemsize}") != pair[1].view(f"u{kind.itemsize}")):
                found.append((entry.element(int(n)), entry.unit, float(entry.shown(pair[0][n])), float(entry.shown(pair[1][n]))))
        return found


def look(link: Link, a2l: A2l) -> Pages:
    """Both pages of a controller, whose tool page is the working page afterwards. A set that is open is not looked at: none is after
    CONNECT."""
    address, size, kind = segment(a2l)
    page = link.page(Who.ECU)
    whole = Entry("segment", "", address, kind, (size // kind.itemsize,))
    found = {}
    for tool in {page, Page.REFERENCE}:
        link.set_page(Who.TOOL, tool)
        found[tool] = (link.checksum(address, size), link.values(whole))
    link.set_page(Who.TOOL, Page.WORKING)
    return Pages(page, found[page], found[Page.REFERENCE])
