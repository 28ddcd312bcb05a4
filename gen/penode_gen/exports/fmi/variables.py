# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The variables of an FMU: names, places and start values, for FMI 2 and FMI 3 alike."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import TypedDict

import numpy as np

from ... import units
from ...model import Model
from ...sets import layout, packing
from ..interface import ExportError
from . import filtered
from .table import More, Table, Variable, number

__all__ = ["Variable", "groups", "identifier", "number", "unit_definitions", "variables"]

BETWEEN = ("held", "linear")  # choices of input_between_samples


def variables(model: Model, dtype: packing.RealType = np.float32) -> list[Variable]:
    """All variables by place. Raises ExportError where two have one name."""
    table = Table()
    _common(table, model)
    filtered.status(table, model)
    _signals(table, model)
    _jacobians(table, model)
    filtered.outputs(table, model)
    _tunables(table, model, dtype)
    _check_names(table.variables)
    return table.variables


def _common(table: Table, model: Model) -> None:
    """What every FMU has: time, choices, and what is known of the set in force."""
    table.add("time", "time", "independent", "continuous", "simulation time", unit="s")
    table.add(
        "parameter_set",
        "parameter_set",
        "parameter",
        "tunable",
        "named parameter set, selected without copying",
        kind="choice",
        choices=tuple(model.sets),
        start=(1.0,),
    )
    table.add(
        "between",
        "input_between_samples",
        "parameter",
        "fixed",
        "held: inputs keep their value over a step; linear: they reach their early.* at its end",
        kind="choice",
        choices=BETWEEN,
        start=(2.0 if model.sampled else 1.0,),
    )
    table.add("set_id", "set_id", "output", "discrete", "id of the set in force; 1000 and more: written by the master", kind="whole")
    table.add("status", "status", "output", "discrete", "flags of penode/pen_status.h of the last communication step", kind="whole")
    table.add("checksum", "set_checksum", "output", "discrete", "CRC-32 of the set in force", kind="whole")


def _signals(table: Table, model: Model) -> None:
    """Inputs, outputs, sensors, states and constants."""
    for i in model.inputs:
        start = min(max(0.0, i.minimum if i.minimum is not None else 0.0), i.maximum if i.maximum is not None else np.inf)
        more: More = {"unit": units.si(i.unit), "start": (float(start),), "minimum": i.minimum, "maximum": i.maximum}
        table.add("input", i.name, "input", "continuous", i.description, **more)
    for i in model.inputs:
        words = f"{i.name} at the end of the next communication step; read where input_between_samples is linear"
        same = table.variables[-len(model.inputs)].start
        table.add("early", f"early.{i.name}", "input", "continuous", words, unit=units.si(i.unit), start=same)
    filtered.inputs(table, model)
    shown = {o.name for o in model.outputs}
    for o in model.outputs:
        table.add("output", o.name, "output", "continuous", o.description, unit=units.si(o.unit))
    for o in model.sensors:  # as in an A2L
        name = f"sensor.{o.name}" if o.name in shown else o.name
        table.add("sensor", name, "output", "continuous", o.description, unit=units.si(o.unit))
    of = _state_units(model)
    for name, start in zip(model.states, model.start, strict=True):
        table.add("state", f"state.{name}", "local", "continuous", f"state {name}", unit=of[name], start=(float(start),))
    for p in model.parameters.values():
        if not p.tunable:
            table.add("constant", p.name, "local", "constant", p.description, unit=units.si(p.unit), start=(float(p.value),))


def _jacobians(table: Table, model: Model) -> None:
    """Derivatives of the state over a communication step."""
    n_x, n_u = len(model.states), len(model.inputs)
    if n_x:
        table.add(
            "state_state",
            "jacobian.state_state",
            "local",
            "continuous",
            "state at the end of the last communication step by the state at its start",
            shape=(n_x, n_x),
        )
    if n_x and n_u:
        table.add(
            "state_input",
            "jacobian.state_input",
            "local",
            "continuous",
            "state at the end of the last communication step by the inputs",
            shape=(n_x, n_u),
        )


def _tunables(table: Table, model: Model, dtype: packing.RealType) -> None:
    """The arrays of the layout table, with the values of the set default."""
    values = packing.set_values(model, "default", dtype)
    described = {p.name: p.description for p in model.tunable} | {n: p.description for n, p in model.networks.items()}
    for array in layout.arrays(model):
        start = tuple(map(float, np.ravel(layout.gather(array, values))))
        owner, _, part = array.name.partition(".")
        words = f"{part.replace('_', ' ')}: {described.get(owner, '')}" if part else described.get(owner, "")
        table.add(
            "tunable",
            array.name,
            "parameter",
            "tunable",
            words.strip(": "),
            unit=units.si(array.unit) if array.unit else "",
            shape=array.shape,
            start=start,
        )


def _state_units(model: Model) -> dict[str, str]:
    from ...algebra.mechanics import state_unit

    return {name: units.si(state_unit(model, name)) for name in model.states}


def _check_names(found: list[Variable]) -> None:
    seen: dict[str, Variable] = {}
    problems = []
    for v in found:
        if v.name in seen:
            problems.append(
                f"'{v.name}' would be two variables of the FMU, {v.causality} and {seen[v.name].causality}; "
                "rename one of them in the model file"
            )
        seen[v.name] = v
    if problems:
        raise ExportError(*problems)


class Group(TypedDict):
    """Variables of one kind, and the place of the first."""

    key: str
    first: int


def groups(found: list[Variable]) -> list[Group]:
    """First place of each group, in the order in which fmu_sets.c.j2 tells places apart."""
    keys = (
        "time",
        "parameter_set",
        "between",
        "set_id",
        "status",
        "checksum",
        "filter_status",
        "input",
        "early",
        "measured",
        "output",
        "sensor",
        "state",
        "constant",
        "state_state",
        "state_input",
        "filtered",
        "tunable",
    )
    first: dict[str, int] = {}
    at = found[-1].first + found[-1].count
    for key in reversed(keys):
        at = first[key] = next((v.first for v in found if v.key == key), at)
    return [{"key": key, "first": first[key]} for key in keys]


_BASE = {"[mass]": "kg", "[length]": "m", "[time]": "s", "[current]": "A", "[temperature]": "K", "[substance]": "mol", "[luminosity]": "cd"}


class UnitDefinition(TypedDict):
    """A unit, and its exponents of SI base units; None where one is no whole number."""

    name: str
    base: dict[str, int] | None
    type: str


def unit_definitions(texts: Iterable[str]) -> list[UnitDefinition]:
    """Each unit of `texts` once; "" is none."""
    definitions: list[UnitDefinition] = []
    for text in sorted({unit for unit in texts if unit}):
        powers = {_BASE[k]: p for k, p in units.exponents(units.dimension(text)).items() if k in _BASE}
        whole = all(p.is_integer() for p in powers.values())
        base = {k: int(p) for k, p in powers.items()} if whole else None
        definitions.append({"name": text, "base": base, "type": f"in {text}"})
    return definitions


def identifier(model: Model) -> str:
    """The model identifier: the model's name, which is one already."""
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", model.name):
        raise ExportError(f"the name '{model.name}' is no C identifier; rename the model")
    return model.name
