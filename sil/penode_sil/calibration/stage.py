# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode stage` and `penode compare` do: a set into a controller that runs, and what runs there."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from penode_gen.model import Model

from ..errors import TargetError, WrongUse
from . import pages
from .a2l_read import A2l
from .codes import Page, Who
from .link import Link
from .pages import ChosenSet, Pages


@dataclass(frozen=True)
class Staged:
    """What came of it: bytes written, seconds for that, the checksum that both sides agree on, the id that the controller gave."""

    set: str
    bytes: int
    seconds: float
    checksum: int
    id: int | None

    def sentence(self) -> str:
        """For people."""
        within = "" if self.id is None else f", as set {self.id} of the controller"
        return (
            f"{self.bytes} bytes written in {self.seconds:.3f} s, verified (CRC-32 0x{self.checksum:08x}), read back\n"
            f"in force: {self.set}{within}"
        )


def _running_id(link: Link, a2l: A2l) -> int | None:
    """The id of the set that runs; None if the A2L does not say where it lies."""
    names = ("set.active", "set.id_0", "set.id_1")
    if not all(name in a2l.measurements for name in names):
        return None
    active = int(link.number(a2l.measurements[names[0]]))
    return int(link.number(a2l.measurements[names[1 + (active & 1)]]))


def _await(link: Link, a2l: A2l, before: int | None, patience: float = 5.0) -> int | None:
    """The id of the new set, once a step has adopted it; any controller steps more often than every `patience` [s]. Raises UserError."""
    end = time.monotonic() + patience
    while (now := _running_id(link, a2l)) is not None and now == before:
        if time.monotonic() > end:
            raise TargetError(f"{link.address.text}: the set is committed, but no step adopts it; is the controller stepping?")
        time.sleep(0.002)
    return now


def write(link: Link, a2l: A2l, chosen: ChosenSet) -> tuple[int, float]:
    """Write a set into the working page and prove it: its checksum, and the seconds that it took. Raises UserError."""
    address, size, _ = pages.segment(a2l)
    expected = a2l.measurements.get("set.layout")
    layout = int(link.number(expected)) if expected else chosen.layout
    if chosen.values.nbytes != size or layout != chosen.layout:
        raise WrongUse(
            f"{chosen.name}: it is a set of another model (layout 0x{chosen.layout:08x}, the controller has 0x{layout:08x}); choose one "
            f"of {a2l.name}"
        )
    begin = time.perf_counter()
    link.write(address, chosen.values.astype(chosen.values.dtype.newbyteorder(link.order)).tobytes())
    seconds = time.perf_counter() - begin
    found = link.checksum(address, size)
    if found != chosen.checksum:
        raise TargetError(
            f"{chosen.name}: the set that arrived differs (CRC-32 0x{found:08x}, not 0x{chosen.checksum:08x}); the running set "
            "stays, stage it again"
        )
    return found, seconds


def stage_set(link: Link, a2l: A2l, chosen: ChosenSet) -> Staged:
    """Write, prove, switch, read back. Raises UserError; then the set that ran goes on."""
    address, size, kind = pages.segment(a2l)
    checksum, seconds = write(link, a2l, chosen)
    before = _running_id(link, a2l)
    link.set_page(Who.ECU, Page.WORKING)
    identity = _await(link, a2l, before)
    if link.read(address, size) != chosen.values.astype(kind.newbyteorder(link.order)).tobytes():
        raise TargetError(f"{chosen.name}: what was read back differs from what was written; compare the pages (penode compare)")
    return Staged(chosen.name, size, seconds, checksum, identity)


def what_runs(model: Model, kind: np.dtype[Any], found: Pages) -> tuple[str, str]:
    """What runs, and the reference, by name."""
    known = pages.known_sets(model, kind)
    name = {checksum: known.get(checksum, f"no known set (CRC-32 0x{checksum:08x})") for checksum, _ in (found.running, found.reference)}
    return name[found.running[0]], name[found.reference[0]]
