# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What of an A2L file the master needs: characteristics and measurements with addresses and units, the segment, the EPK."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import TargetError

_TOKEN = re.compile(r'/\*.*?\*/|//[^\n]*|"((?:[^"\\]|\\.|"")*)"|([^\s"]+)', re.S)
_TYPES = {
    "UBYTE": "u1",
    "SBYTE": "i1",
    "UWORD": "u2",
    "SWORD": "i2",
    "ULONG": "u4",
    "SLONG": "i4",
    "A_UINT64": "u8",
    "A_INT64": "i8",
    "FLOAT32_IEEE": "f4",
    "FLOAT64_IEEE": "f8",
}


@dataclass
class Block:
    """/begin NAME ... /end NAME: its words, and the blocks in it."""

    name: str
    words: list[str] = field(default_factory=list)
    blocks: list[Block] = field(default_factory=list)

    def all(self, name: str) -> list[Block]:
        """The blocks of that name, at any depth."""
        return [b for b in self.blocks if b.name == name] + [inner for b in self.blocks for inner in b.all(name)]

    def after(self, keyword: str, n: int) -> list[str]:
        """The n words behind a keyword; [] if it is not there."""
        at = self.words.index(keyword) + 1 if keyword in self.words else 0
        return self.words[at : at + n] if at else []

    def sizes(self) -> tuple[int, ...]:
        """MATRIX_DIM, of three numbers or, since ASAP2 1.70, of any."""
        found = []
        for word in self.after("MATRIX_DIM", len(self.words)):
            if not word[0].isdecimal():
                break
            found.append(int(word, 0))
        return tuple(found)


@dataclass(frozen=True)
class Method:
    """A conversion: a tool shows scale * number in memory + offset, in `unit`."""

    unit: str = ""
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Entry:
    """A characteristic or a measurement: numbers of `type` at an address, which `method` turns into what a tool shows."""

    name: str
    text: str
    address: int
    type: np.dtype[Any]
    sizes: tuple[int, ...]  # the fastest index first; () of a number
    method: Method = Method()

    @property
    def unit(self) -> str:
        """Unit that a tool shows."""
        return self.method.unit

    def shown(self, numbers: NDArray[Any]) -> NDArray[Any]:
        """What a tool shows: the numbers themselves where they are not scaled, else float64."""
        plain = self.method.scale == 1.0 and self.method.offset == 0.0
        return numbers if plain else np.asarray(numbers, dtype=np.float64) * self.method.scale + self.method.offset

    @property
    def count(self) -> int:
        """Numbers."""
        return int(np.prod(self.sizes)) if self.sizes else 1

    def element(self, index: int) -> str:
        """The name of one of its numbers: row, then column, of an array that lies in memory column by column."""
        used = [n for n in self.sizes if n > 1] or list(self.sizes[:1])
        places = []
        for n in used:
            places.append(index % n)
            index //= n
        return self.name + "".join(f"[{place}]" for place in places)

    @property
    def size(self) -> int:
        """Bytes."""
        return self.count * self.type.itemsize


@dataclass(frozen=True)
class A2l:
    """An A2L file. `segment`: address and bytes of the parameter set; `epk`: text and address, None if it has none."""

    name: str
    characteristics: dict[str, Entry]
    measurements: dict[str, Entry]
    segment: tuple[int, int] | None
    epk: tuple[str, int] | None


def _tree(text: str) -> Block:
    top = Block("")
    stack, opening = [top], ""
    for match in _TOKEN.finditer(text):
        if match[1] is None and match[2] is None:
            continue
        word = match[1] if match[2] is None else match[2]
        plain = match[2] is not None
        if opening == "/begin":
            stack.append(Block(word))
            stack[-2].blocks.append(stack[-1])
        elif opening == "/end":
            if len(stack) < 2 or stack[-1].name != word:
                raise ValueError(f"/end {word} without its /begin")
            stack.pop()
        elif not (plain and word in ("/begin", "/end")):
            stack[-1].words.append(word)
        opening = word if plain and not opening and word in ("/begin", "/end") else ""
    if len(stack) > 1:
        raise ValueError(f"/begin {stack[-1].name} without its /end")
    return top


def _method(block: Block) -> Method:
    """Conversion that is neither identical nor linear: shown as the number in memory, without a unit."""
    kind, unit = block.words[2], block.words[4]
    if kind == "LINEAR":
        scale, offset = (float(word) for word in block.after("COEFFS_LINEAR", 2))
        return Method(unit, scale, offset)
    if kind == "RAT_FUNC":  # number in memory = (a x^2 + b x + c) / (d x^2 + e x + f) with x the shown number
        a, b, c, d, e, f = (float(word) for word in block.after("COEFFS", 6))
        return Method() if a or d or e or not b else Method(unit, f / b, -c / b)
    return Method(unit if kind == "IDENTICAL" else "")


def _characteristic(block: Block, types: dict[str, str], methods: dict[str, Method]) -> Entry:
    name, text, _, address, record, _, method = block.words[:7]
    sizes = block.sizes() or tuple(int(word, 0) for word in block.after("NUMBER", 1))
    return Entry(name, text, int(address, 0), np.dtype(_TYPES[types[record]]), sizes, methods.get(method, Method()))


def _measurement(block: Block, methods: dict[str, Method]) -> Entry:
    name, text, kind, method = block.words[:4]
    (address,) = block.after("ECU_ADDRESS", 1) or ["0"]
    return Entry(name, text, int(address, 0), np.dtype(_TYPES[kind]), block.sizes(), methods.get(method, Method()))


def parse(text: str, origin: str) -> A2l:
    """Raises UserError if it is no A2L, or uses what is not known here."""
    try:
        modules = _tree(text).all("MODULE")
        if not modules:
            raise ValueError("it has no MODULE")
        module = modules[0]
        methods = {b.words[0]: _method(b) for b in module.all("COMPU_METHOD")}
        types = {b.words[0]: b.after("FNC_VALUES", 2)[1] for b in module.all("RECORD_LAYOUT") if b.after("FNC_VALUES", 2)}
        characteristics = [_characteristic(b, types, methods) for b in module.all("CHARACTERISTIC")]
        measurements = [_measurement(b, methods) for b in module.all("MEASUREMENT")]
        segments = [tuple(int(word, 0) for word in b.words[5:7]) for b in module.all("MEMORY_SEGMENT")]
        parts = module.all("MOD_PAR")
        epk = (parts[0].after("EPK", 1), parts[0].after("ADDR_EPK", 1)) if parts else ([], [])
        return A2l(
            module.words[0],
            {e.name: e for e in characteristics},
            {e.name: e for e in measurements},
            (segments[0][0], segments[0][1]) if len(segments) == 1 else None,
            (epk[0][0], int(epk[1][0], 0)) if all(epk) else None,
        )
    except (ValueError, IndexError, KeyError) as exc:
        raise TargetError(f"{origin}: it cannot be read as A2L ({exc}); export it again with penode export --format a2l") from exc
