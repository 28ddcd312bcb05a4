# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Variables of a linked program: where they lie and what they are, from the DWARF of its ELF file (pyelftools)."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..interface import ExportError

_QUALIFIERS = ("DW_TAG_typedef", "DW_TAG_const_type", "DW_TAG_volatile_type", "DW_TAG_atomic_type")
_STEP = re.compile(r"\.?([A-Za-z_]\w*)|\[(\d+)\]")
_ENCODINGS = {2: "bool", 4: "float", 5: "signed", 6: "signed", 7: "unsigned", 8: "unsigned"}  # DW_ATE_...
_OP_ADDR, _OP_ADDRX, _OP_PLUS = 0x03, 0xA1, 0x23
_SIZES = {"float": (4, 8)}  # bytes of numbers that A2L has a type for; of others 1, 2, 4, 8


@dataclass(frozen=True, eq=False)
class Place:
    """Something in memory: the path that names it, its address and its type (a DIE)."""

    path: str
    address: int
    type: Any

    @property
    def kind(self) -> str:
        """float, signed, unsigned, bool; "" if it is not a number, or one that A2L has no type for (long double, __int128)."""
        plain = bare(self.type)
        if plain.tag == "DW_TAG_enumeration_type":
            return "unsigned"
        kind = _ENCODINGS.get(plain.attributes["DW_AT_encoding"].value, "") if plain.tag == "DW_TAG_base_type" else ""
        return kind if self.size in _SIZES.get(kind, (1, 2, 4, 8)) else ""

    @property
    def size(self) -> int:
        """Bytes; those of the whole array of an array."""
        return size_of(self.type)


def bare(die: Any) -> Any:
    """A type without names and qualifiers."""
    while die.tag in _QUALIFIERS and "DW_AT_type" in die.attributes:
        die = die.get_DIE_from_attribute("DW_AT_type")
    return die


def _bounds(array: Any) -> list[int]:
    if isinstance(array, _Shorter):
        return list(array.bounds)
    found = []
    for child in array.iter_children():
        if child.tag == "DW_TAG_subrange_type":
            count, upper = child.attributes.get("DW_AT_count"), child.attributes.get("DW_AT_upper_bound")
            found.append(count.value if count is not None else upper.value + 1 if upper is not None else 0)
    return found


def size_of(die: Any) -> int:
    """Bytes of a type."""
    plain = bare(die)
    if plain.tag == "DW_TAG_array_type":
        size = size_of(plain.get_DIE_from_attribute("DW_AT_type"))
        for n in _bounds(plain):
            size *= n
        return size
    return int(plain.attributes["DW_AT_byte_size"].value) if "DW_AT_byte_size" in plain.attributes else 0


def type_name(die: Any) -> str:
    """The outermost name of a type, without qualifiers; "" if it has none."""
    while die.tag in _QUALIFIERS[1:] and "DW_AT_type" in die.attributes:
        die = die.get_DIE_from_attribute("DW_AT_type")
    name = die.attributes.get("DW_AT_name")
    return name.value.decode() if name is not None else ""


class Program:
    """
    A linked program, or, if `shared`, a shared library, whose addresses count from where it is loaded.

    Raises ExportError if a file is none, or has no debug information.
    """

    def __init__(self, path: Path, shared: bool = False):
        from elftools.common.exceptions import DWARFError, ELFError
        from elftools.elf.elffile import ELFFile

        self.path = path
        try:
            self._elf = ELFFile(io.BytesIO(path.read_bytes()))
            if not self._elf.has_dwarf_info(strict=True):
                raise ExportError(f"{path}: the program has no debug information; compile and link it with -g, and do not strip it")
            self._dwarf = self._elf.get_dwarf_info()
            self._variables = dict(self._global_variables())
        except (ELFError, DWARFError, OSError) as exc:
            raise ExportError(f"{path}: it cannot be read as an ELF program ({exc}); name the linked program") from exc
        if self._elf["e_type"] != ("ET_DYN" if shared else "ET_EXEC"):
            raise ExportError(f"{path}: its addresses are not fixed; link the program with -no-pie")

    @property
    def little_endian(self) -> bool:
        return bool(self._elf.little_endian)

    def _global_variables(self) -> Iterator[tuple[str, Place]]:
        for unit in self._dwarf.iter_CUs():
            for die in unit.get_top_DIE().iter_children():
                if die.tag == "DW_TAG_variable":
                    address = self._address(unit, die)
                    named = die.get_DIE_from_attribute("DW_AT_specification") if "DW_AT_specification" in die.attributes else die
                    if address is not None and {"DW_AT_name", "DW_AT_type"} <= named.attributes.keys():
                        name = named.attributes["DW_AT_name"].value.decode()
                        yield (
                            name,
                            Place(name, address, (die if "DW_AT_type" in die.attributes else named).get_DIE_from_attribute("DW_AT_type")),
                        )

    def _address(self, unit: Any, die: Any) -> int | None:
        """Address of a static variable; None if it has none, or the linker has dropped it."""
        location = die.attributes.get("DW_AT_location")
        if location is None or location.form not in ("DW_FORM_exprloc", "DW_FORM_block1", "DW_FORM_block"):
            return None
        code = bytes(location.value)
        address = None
        if code[:1] == bytes([_OP_ADDR]):
            address = int.from_bytes(code[1:], "little" if self._elf.little_endian else "big")
        elif code[:1] == bytes([_OP_ADDRX]):
            address = int(self._dwarf.get_addr(unit, _uleb(code[1:])))
        return address if address and self._section(address) is not None else None

    def _section(self, address: int) -> Any:
        for section in self._elf.iter_sections():
            if section["sh_flags"] & 2 and section["sh_addr"] <= address < section["sh_addr"] + section["sh_size"]:  # SHF_ALLOC
                return section
        return None

    def names(self, type_: str = "") -> list[str]:
        """Variables, of that type if one is named."""
        return sorted(name for name, place in self._variables.items() if not type_ or type_name(place.type) == type_)

    def find(self, path: str) -> Place:
        """`variable.member[1].member`. Raises KeyError with the part that is not there."""
        steps = list(_STEP.finditer(path))
        if not steps or "".join(s[0] for s in steps) != path or steps[0][1] not in self._variables:
            raise KeyError(path)
        place = self._variables[steps[0][1]]
        for step in steps[1:]:
            place = _member(place, step[1]) if step[1] else _element(place, int(step[2]))
        return place

    def numbers(self, place: Place) -> Iterator[Place]:
        """The numbers in a place: itself, or those of its members and elements; pointers and bit fields are left out."""
        plain = bare(place.type)
        if plain.tag == "DW_TAG_structure_type":
            for name in _members(plain):
                yield from self.numbers(_member(place, name))
        elif plain.tag == "DW_TAG_array_type":
            for n in range(_bounds(plain)[0]):
                yield from self.numbers(_element(place, n))
        elif place.kind:
            yield place

    def member(self, place: Place, name: str) -> Place:
        """A member of a structure. Raises KeyError."""
        return _member(place, name)

    def number(self, place: Place) -> int:
        """The whole number, or the address, that the program's file holds there. Raises KeyError."""
        return int.from_bytes(self.bytes_at(place.address, place.size), "little" if self.little_endian else "big")

    def pointed(self, place: Place, n: int = 0) -> Place | None:
        """
        Element n of the array that a pointer in the program's file points to; None if it is NULL.

        Raises KeyError where it is no pointer to data.
        """
        plain = bare(place.type)
        if plain.tag != "DW_TAG_pointer_type" or "DW_AT_type" not in plain.attributes:
            raise KeyError(place.path)
        address, target = self.number(place), plain.get_DIE_from_attribute("DW_AT_type")
        return Place(f"{place.path}[{n}]", address + n * size_of(target), target) if address else None

    def bytes_at(self, address: int, n: int) -> bytes:
        """What the program's file holds for an address; zeros where it holds nothing. Raises KeyError outside of it."""
        section = self._section(address)
        if section is None or address + n > section["sh_addr"] + section["sh_size"]:
            raise KeyError(hex(address))
        at = address - section["sh_addr"]
        return bytes(n) if section["sh_type"] == "SHT_NOBITS" else bytes(section.data()[at : at + n])


@lru_cache(maxsize=1)
def _read(path: Path, changed: int, shared: bool) -> Program:
    return Program(path, shared)


def read_program(path: Path, shared: bool = False) -> Program:
    """A linked program, or a shared library; the last one is kept: reading it takes a second. Raises ExportError."""
    try:
        return _read(path, path.stat().st_mtime_ns, shared)
    except OSError as exc:
        raise ExportError(f"{path}: it cannot be read as an ELF program ({exc.strerror}); name the linked program") from exc


def _uleb(code: bytes) -> int:
    number = 0
    for n, byte in enumerate(code):
        number |= (byte & 0x7F) << (7 * n)
    return number


def _members(structure: Any) -> dict[str, Any]:
    """Members by name, without bit fields, which have no address of their own."""
    members = [child for child in structure.iter_children() if child.tag == "DW_TAG_member" and "DW_AT_name" in child.attributes]
    return {m.attributes["DW_AT_name"].value.decode(): m for m in members if "DW_AT_bit_size" not in m.attributes}


def _offset(member: Any) -> int:
    """Bytes from the start of the structure: a number, in DWARF 2 an expression that adds it."""
    value = member.attributes["DW_AT_data_member_location"].value
    if isinstance(value, int):
        return value
    code = bytes(value)
    if code[:1] != bytes([_OP_PLUS]):
        raise KeyError(member.attributes["DW_AT_name"].value.decode())
    return _uleb(code[1:])


def _member(place: Place, name: str) -> Place:
    plain = bare(place.type)
    member = _members(plain).get(name) if plain.tag == "DW_TAG_structure_type" else None
    if member is None:
        raise KeyError(f"{place.path}.{name}")
    return Place(f"{place.path}.{name}", place.address + _offset(member), member.get_DIE_from_attribute("DW_AT_type"))


class _Shorter:
    """An array type of several dimensions without the first of them: what its DIE would be."""

    tag = "DW_TAG_array_type"

    def __init__(self, array: Any, bounds: tuple[int, ...]):
        self.array, self.bounds, self.attributes = array, bounds, array.attributes

    def get_DIE_from_attribute(self, name: str) -> Any:
        return self.array.get_DIE_from_attribute(name)


def _element(place: Place, index: int) -> Place:
    plain = bare(place.type)
    if plain.tag != "DW_TAG_array_type":
        raise KeyError(f"{place.path}[{index}]")
    bounds = _bounds(plain)
    if index >= bounds[0]:
        raise KeyError(f"{place.path}[{index}]")
    inner = plain.get_DIE_from_attribute("DW_AT_type")
    size = size_of(inner)
    for n in bounds[1:]:
        size *= n
    rest: Any = inner if len(bounds) == 1 else _Shorter(plain, tuple(bounds[1:]))
    return Place(f"{place.path}[{index}]", place.address + index * size, rest)
