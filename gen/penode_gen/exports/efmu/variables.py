# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The variables of an eFMI block: what its Algorithm Code declares, its manifest lists and the Production Code maps."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass
from math import prod

import numpy as np

from ... import units
from ...algebra.causalise import Causal
from ...algebra.mechanics import state_unit
from ...model import Model
from ...sets import layout, packing
from ..fmi.variables import unit_definitions
from ..interface import ExportError
from . import galec_text as text

STEP_SIZE, STARTED = "discrete.stepSize", "discrete.stepSize.active"  # what Dymola calls them
_MEMBERS = frozenset({"error_signal_status", "staged", "sets", "banks", "instance"})  # the structure's own
_KINDS = {"input": "input ", "output": "output ", "tunableParameter": "parameter ", "constant": "constant ", "state": ""}


@dataclass(frozen=True)
class Variable:
    """
    A variable of the block.

    `start` in the shape of the variable, () for a scalar; `causality` as the manifest calls it; `element` of the runtime's layout,
    if it is one.
    """

    label: str
    causality: str
    start: np.ndarray
    unit: str = ""
    description: str = ""
    boolean: bool = False
    element: layout.Array | None = None

    @property
    def name(self) -> str:
        """In the Algorithm Code, with quotes where it needs them."""
        return text.name(self.label)

    @property
    def own(self) -> str:
        """As a method of the block reads it."""
        return f"self.{self.name}"

    @property
    def shape(self) -> tuple[int, ...]:
        """() of a scalar."""
        return self.start.shape

    @property
    def count(self) -> int:
        """Number of its elements."""
        return prod(self.shape)

    @property
    def dimensions(self) -> str:
        """[16, 16], or nothing."""
        return f"[{', '.join(map(str, self.shape))}]" if self.shape else ""

    @property
    def declaration(self) -> str:
        """In the Algorithm Code."""
        return f"{_KINDS[self.causality]}{'Boolean' if self.boolean else 'Real'} {self.name}{self.dimensions};"

    @property
    def unit_id(self) -> str:
        """Its unit in the manifest's list of units."""
        return unit_id(self.unit)

    @property
    def starts(self) -> str:
        """Row by row, blanks between."""
        return "false" if self.boolean else " ".join(text.real(v) for v in np.ravel(self.start))

    @property
    def member(self) -> str:
        """Its member in the structure of the Production Code; no name of a model file ends in _."""
        found = re.sub(r"\W+", "_", self.label).strip("_")
        return f"{found}_" if found in _MEMBERS else found


def unit_id(unit: str) -> str:
    """An identifier of the standard has no * and no ^."""
    return f"[{(unit or '1').replace('*', '.').replace('^', '')}]"


def collect(model: Model, causal: Causal, used: Iterable[str]) -> list[Variable]:
    """In the order of the declarations; `used`: names of parameters that the block computes with. Raises ExportError."""

    def scalar(label: str, causality: str, value: float, unit: str = "1", description: str = "") -> Variable:
        return Variable(label, causality, np.array(float(value)), units.si(unit), description)

    found = [scalar(i.name, "input", _first(i.minimum, i.maximum), i.unit, i.description) for i in model.inputs]
    found += [scalar(o.name, "output", 0.0, o.unit, o.description) for o in model.outputs]
    found += _tunable(model)
    found.append(scalar(STEP_SIZE, "constant", model.sample_time, "s", "sample time"))
    taken, used = {v.label for v in found}, set(used)
    for p in model.parameters.values():
        if p.name in used and not p.tunable:
            found.append(scalar(constant(p.name, taken), "constant", p.value, p.unit, p.description))
    found += [scalar(f"state.{n}", "state", x, state_unit(model, n), f"state {n}") for n, x in zip(model.states, model.start, strict=True)]
    if model.states:
        found += [
            scalar(f"previous({i.name})", "state", float(v.start), i.unit, f"{i.name} of the sample before")
            for i, v in zip(model.inputs, found[: len(model.inputs)], strict=True)
        ]
        found.append(Variable(STARTED, "state", np.array(0.0), description="true from the first good sample on", boolean=True))
    _check(model, found)
    return found


def constant(label: str, taken: Iterable[str]) -> str:
    """What a parameter that is no tunable one is called, beside inputs and outputs."""
    return f"constant.{label}" if label in taken else label


def _first(minimum: float | None, maximum: float | None) -> float:
    """0, or what is nearest to it in the range."""
    return float(min(max(0.0, -np.inf if minimum is None else minimum), np.inf if maximum is None else maximum))


def _tunable(model: Model) -> list[Variable]:
    """Arrays of the parameter sets; a matrix of one column is a vector, as the public compliance checker knows no other."""
    values = packing.set_values(model, "default", np.float64) if model.sets or model.tunable else np.zeros(1)
    about = {p.name: p.description for p in model.tunable} | {n: p.description for n, p in model.networks.items()}
    found = []
    for a in layout.arrays(model):
        start = layout.gather(a, values)
        owner, _, part = a.name.partition(".")
        words = f"{part.replace('_', ' ')}: {about.get(owner, '')}".strip(": ") if part else about.get(owner, "")
        start = start[:, 0] if start.ndim == 2 and start.shape[1] == 1 else start
        found.append(Variable(a.name, "tunableParameter", np.asarray(start, float), units.si(a.unit) if a.unit else "", words, element=a))
    return found


def _check(model: Model, found: list[Variable]) -> None:
    """Every name once, in the block and in the structure of the Production Code."""
    problems = []
    for key in ("label", "member"):
        seen: set[str] = set()
        for v in found:
            if getattr(v, key) in seen:
                problems.append(f"{model.path.name}: '{v.label}' would be two variables of the eFMU; rename one of them in the model file")
            seen.add(getattr(v, key))
    if problems:
        raise ExportError(*dict.fromkeys(problems))


def unit_list(found: list[Variable]) -> list[dict[str, object]]:
    """Each unit once, with exponents of SI base units; always with those of time and of numbers."""

    definitions = unit_definitions([*(v.unit or "1" for v in found), "1", "s"])
    return [{**d, "id": unit_id(d["name"]), "base": {"rad": 1} if units.is_angle(d["name"]) else d["base"]} for d in definitions]
