# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What an A2L file lists of a program: characteristics out of the layout table, measurements out of the instance and other variables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ... import units
from ...flags import FLAGS
from ...model import Model
from ...sets import layout, packing
from .. import filtered
from ..interface import ExportError
from .elf_types import Place, Program, type_name

_LAST = 1  # PEN_ROW_LAST of penode/pen_step.h: the row of the last good sample
_FLOATS: dict[int, packing.RealType] = {4: np.float32, 8: np.float64}


@dataclass(frozen=True)
class Characteristic:
    """
    Values of a set that belong together: `size` is (), or (fastest, slowest) index as they lie in memory. `unit` is that of the model file,
    the number in memory is `factor` times as large: SI. `low` and `high` are in that unit.
    """

    name: str
    text: str
    address: int
    size: tuple[int, ...]
    type: str
    unit: str
    factor: float
    low: float
    high: float
    offset: int  # bytes from the start of the set


@dataclass(frozen=True)
class Measurement:
    """A number that may be read. `unit`, `factor`, `low` and `high` as in Characteristic."""

    name: str
    text: str
    address: int
    type: str
    unit: str
    factor: float
    low: float
    high: float
    link: str  # path in the program


def a2l_type(place: Place) -> str:
    """The name that A2L has for a number in memory."""
    if place.kind == "float":
        return f"FLOAT{8 * place.size}_IEEE"
    names = {1: "BYTE", 2: "WORD", 4: "LONG", 8: "_INT64"}
    return f"{'S' if place.kind == 'signed' else 'U'}{names[place.size]}".replace("U_", "A_U").replace("S_", "A_")


def limits(place: Place) -> tuple[float, float]:
    """Lowest and highest number of its type."""
    if place.kind == "float":
        most = float(np.finfo(_FLOATS[place.size]).max)
        return -most, most
    bits = 8 * place.size
    return (-(2.0 ** (bits - 1)), 2.0 ** (bits - 1) - 1) if place.kind == "signed" else (0.0, 2.0**bits - 1)


def page(model: Model, program: Program) -> Place:
    """The values of the reference set. Raises ExportError if the program was not made from this model."""
    names = f"{model.owner}_set_default", f"{model.owner}_value_default"
    try:
        head, values = (program.find(name) for name in names)
    except KeyError as exc:
        raise ExportError(
            f"{program.path}: it has no variable {exc.args[0]}; name a program with the C of {model.name} in it, compiled with -g"
        ) from exc
    size = program.find(f"{names[1]}[0]").size
    found = program.bytes_at(head.address, 8)
    order: Literal["little", "big"] = "little" if program.little_endian else "big"
    expected = (packing.layout(model, _FLOATS[size]), layout.length(model))
    if tuple(int.from_bytes(found[i : i + 4], order) for i in (0, 4)) != expected or values.size != expected[1] * size:
        raise ExportError(
            f"{program.path}: its sets are not those of {model.path.name}; generate the C of this model file again, and link it"
        )
    return values


def characteristics(model: Model, values: Place, number: Place) -> list[Characteristic]:
    """One for each block of the layout table. `number` is the first value."""
    low, high = limits(number)
    about = {p.name: p.description for p in model.tunable}
    written = {p.name: p.unit for p in model.tunable}  # networks take and give SI, whatever unit their ports are written in
    found = []
    for array in layout.arrays(model):
        columns = array.shape[1] if len(array.shape) > 1 else 1
        for b in array.blocks:
            several = len(array.blocks) > 1
            name = f"{array.name}.rows_{b.first_row}_{b.first_row + b.rows - 1}" if several else array.name
            text = about.get(array.name) or f"{array.text}{f', rows {b.first_row} to {b.first_row + b.rows - 1}' if several else ''}"
            size = (b.rows, columns) if array.shape else ()
            offset = b.at * number.size
            unit, factor = scaled(written.get(array.name) or (units.si(array.unit) if array.unit else ""))
            found.append(
                Characteristic(
                    name, text, values.address + offset, size, a2l_type(number), unit, factor, low / factor, high / factor, offset
                )
            )
    return found


def scaled(unit: str) -> tuple[str, float]:
    """A unit of the model file as a tool shows it, and how many SI units it is: the number in memory counts those."""
    plain = "" if unit.strip() == "1" else unit.strip()
    return plain, units.factor(plain)


class Measurements:
    """All measurements of a program; a name that is taken gets its group before it: `state.z_b`."""

    def __init__(self, program: Program):
        self.program = program
        self.groups: dict[str, list[str]] = {}
        self.found: dict[str, Measurement] = {}

    def add(
        self, group: str, name: str, path: str, unit: str = "", text: str = "", low: float | None = None, high: float | None = None
    ) -> None:
        """One number. Raises KeyError if the program has it not."""
        place = self.program.find(path)
        shown, factor = scaled(unit)
        lowest, highest = (limit if told is None else told for limit, told in zip(limits(place), (low, high), strict=True))  # in SI
        name = name if name not in self.found else f"{group}.{name}"
        self.found[name] = Measurement(name, text, place.address, a2l_type(place), shown, factor, lowest / factor, highest / factor, path)
        self.groups.setdefault(group, []).append(name)

    def of_model(self, model: Model, instance: str) -> None:
        """Signals, status, counters and sets of an instance."""
        for n, output in enumerate(model.outputs):
            self.add("output", output.name, f"{instance}.row[{_LAST}][{len(model.states) + n}]", output.unit, output.description)
        for n, i in enumerate(model.inputs):
            self.add("input", i.name, f"{instance}.u[0][{n}]", i.unit, i.description, i.minimum, i.maximum)
        for n, (name, unit) in enumerate(zip(model.states, _state_units(model), strict=True)):
            self.add("state", name, f"{instance}.row[{_LAST}][{n}]", unit)
        for n, flag in enumerate(FLAGS):
            self.add("count", f"count.{flag}", f"{instance}.head.log.count[{n}]", text=f"how often {flag} was raised since the start")
        self.add("set", "set.layout", f"{instance}.head.ready", text="layout of the model's sets")
        self.add("set", "set.active", f"{instance}.head.tuning.active", text="slot that runs")
        for n in range(2):
            self.add("set", f"set.id_{n}", f"{instance}.head.tuning.slot[{n}].head.id", text=f"id of the set in slot {n}")

    def of_variable(self, model: Model, variable: str) -> None:
        """The numbers of another variable of the program, by the names of its members. Raises KeyError if it has none of that name."""
        whole = self.program.find(variable)
        for place in self.program.numbers(whole):
            member = place.path[len(whole.path) :].lstrip(".")
            if not self._of_estimate(model, place) and not self._of_sensors(model, place):
                self.add("program", _plain(member) if member else variable, place.path)

    def _of_sensors(self, model: Model, place: Place) -> bool:
        """Is it a member of what NAME_sensors writes? Then it is measured as that sensor."""
        struct, _, name = place.path.rpartition(".")
        found = (
            [sensor for sensor in model.sensors if sensor.name == name]
            if struct and type_name(self.program.find(struct).type) == f"{model.name}_z_t"
            else []
        )
        for sensor in found:
            self.add("sensor", sensor.name, place.path, sensor.unit, sensor.description)
        return bool(found)

    def _of_estimate(self, model: Model, place: Place) -> bool:
        """Is it a number of what NAME_ekf_estimate writes? Then it is an estimate or a standard deviation; each quantity is one once."""
        whole, part, member = ("", "", *place.path.rsplit(".", 2))[-3:]
        if not whole or type_name(self.program.find(whole).type) != f"{model.name}_ekf_estimate_t":
            return False
        for e in filtered.estimates(model):
            if (part, member) == (e.part, e.member):
                self.add("filter", e.name, place.path, e.unit, e.text)
            elif (part, member) == (f"{e.part}_deviation", e.member):
                self.add("filter", filtered.deviation(e.name), place.path, e.unit, f"standard deviation of {e.text}")
        return True


def _plain(path: str) -> str:
    """A path as an identifier of A2L."""
    return path.replace("[", "._").replace("]", "_")


def _state_units(model: Model) -> Iterator[str]:
    yield from (b.unit for b in model.bodies)
    yield from (f"{b.unit}/s" for b in model.bodies)
    yield from (s.unit for s in model.extra_states)


def instance_of(model: Model, program: Program, named: str | None) -> str:
    """The instance: the variable that is named, or the only one of its type; that of a filter is `model` in it. Raises ExportError."""
    kind = f"{model.name}_t"
    known = [*program.names(kind), *(f"{name}.model" for name in program.names(f"{model.name}_ekf_t"))]
    if named is None and len(known) == 1:
        return known[0]
    if named is None:
        several = (
            f"it has several variables of the type {kind} ({', '.join(known)})"
            if known
            else f"it has no variable of the type {kind} outside of functions"
        )
        raise ExportError(f"{program.path}: {several}; name one by --instance")
    try:
        place = program.find(named)
    except KeyError as exc:
        raise ExportError(f"--instance: {program.path} has no variable {exc.args[0]}; {_one_of(known)}") from exc
    if type_name(place.type) not in (kind, f"{model.stepped}_t"):
        raise ExportError(f"--instance: {named} is of the type {type_name(place.type) or 'without a name'}, not {kind}; {_one_of(known)}")
    return named


def _one_of(known: Iterable[str]) -> str:
    names = ", ".join(known)
    return f"name one of: {names}" if names else "it has none of that type"
