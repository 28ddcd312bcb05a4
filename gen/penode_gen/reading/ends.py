# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Mechanisms of a model file: bodies that move or turn, points, and the ends of elements."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from typing import Any

from .. import model as m, units
from ..algebra import expressions as ex
from ..algebra.mechanics import combination
from ..laws import LAWS, for_angles
from .network_tables import UNKNOWN, NetworkTables
from .places import show
from .tables import NAME, same

INERTIA = {"mass": ("kg", "z", "v", "m"), "inertia": ("kg*m^2", "phi", "omega", "rad")}  # key: unit, names and unit of the states
LEVER = 'write a point with the lever arm in [points], such as tip = "arm*phi", and let the element act on it'


class EndTables(NetworkTables):
    """Reads [bodies] and [points], and the ends of elements."""

    made: dict[str, tuple[str, ...]]  # parameters made from quantities, and where
    kinds: dict[str, str]  # what elements may act on -> its unit, "m" or "rad"

    def argument(self, where: tuple[str, ...], key: str, text: str, unit: str, new: str, parameters: dict[str, m.Parameter]) -> str:
        """Name of the parameter that `text` names, or of a new one made from a quantity such as '35 N', which a file that extends this one
        may give another value."""
        where = (*where, key)
        if NAME.fullmatch(text):
            if text not in parameters:
                near = difflib.get_close_matches(text, parameters, 1)
                self.problem(
                    where,
                    f"'{text}' is not a parameter",
                    f"did you mean '{near[0]}'?" if near else f"add it to [parameters] or write a quantity in {unit}",
                )
            elif not same(parameters[text].unit, unit):
                self.problem(where, f"'{text}' is in {parameters[text].unit}, needed is {unit}", "use a parameter of that unit")
            return text
        value = self.quantity(where, text, unit)
        if new not in parameters:
            parameters[new] = m.Parameter(new, value, unit, description=f"{key} of {where[1]}")
            self.made[new] = where
        elif not (self.extended(("parameters", new), where) and same(parameters[new].unit, unit)):
            self.problem(where, f"this quantity would become the parameter '{new}', which there is already", "name that one, or rename it")
        return new

    # -- what moves -----------------------------------------------------------------------------------------------

    def bodies(self, parameters: dict[str, m.Parameter]) -> Iterable[m.Body]:
        for name, entry in self.section("bodies").items():
            where = ("bodies", name)
            given = [key for key in INERTIA if key in entry]
            if len(given) != 1:
                self.problem(
                    where,
                    "has both a mass and an inertia" if given else "'mass' is missing",
                    "add mass = ... for a body that moves, or inertia = ... for one that turns",
                )
                given = given or ["mass"]
            key = given[0]
            unit, z, v, length = INERTIA[key]
            mass = (
                self.argument(where, key, entry[key], unit, f"{'J' if key == 'inertia' else 'm'}_{name}", parameters)
                if key in entry
                else ""
            )
            if mass in parameters and parameters[mass].value <= 0.0:
                self.problem(
                    where, f"{key} '{entry[key]}' is not above zero", f"give a positive {key}; write a massless point as plain equations"
                )
            for part in ("position", "velocity"):
                if part in entry:
                    self.name((*where, part), entry[part])
            start, speed = (
                self.quantity((*where, part), entry[part], of) if part in entry else 0.0
                for part, of in (("start_position", length), ("start_velocity", f"{length}/s"))
            )
            self.kinds[name] = length
            yield m.Body(
                name, mass, entry.get("position", f"{z}_{name}"), entry.get("velocity", f"{v}_{name}"), (start, speed), key == "inertia"
            )

    def measured(self, unit_of: Mapping[str, str]) -> None:
        """Signals that elements may act on, of those with these units: positions and angles."""
        for name, unit in unit_of.items():
            if (same(unit, "m") and unit != UNKNOWN) or _angle(unit):
                self.kinds[name] = "rad" if _angle(unit) else "m"

    def points(
        self,
        bodies: tuple[m.Body, ...],
        inputs: tuple[m.Input, ...],
        states: Iterable[m.State | m.Sampled],
        earlier: list[m.Point],
        parameters: dict[str, m.Parameter],
    ) -> Iterable[m.Point]:
        """Linear combinations of positions; `earlier`: those that actuators are."""
        measured: tuple[m.Input | m.State | m.Sampled | m.Point, ...] = (*inputs, *states, *earlier)
        unit_of = {p.name: p.unit for p in parameters.values()} | {i.name: i.unit for i in measured}
        unit_of |= {b.position: b.unit for b in bodies if b.position}
        moving = {name: (ex.symbol(name),) * 2 for name in unit_of if name not in parameters}
        for name, text in self.entries("points").items():
            where = ("points", name)
            self.name(where, name)
            if not isinstance(text, str):
                self.problem(where, f"{show(text)} is not a text", 'write it as "z - a*theta"')
                continue
            try:
                position = combination(text, moving, set(parameters))[0]
                dimension = units.dimension_of(position, lambda leaf: units.dimension(unit_of[leaf.name])) or units.NONE
            except ex.ExpressionError as error:
                self.problem(where, str(error), 'write positions, inputs and points with parameters as coefficients, such as "z - a*theta"')
                continue
            except units.UnitError as error:
                self.problem(where, str(error), "correct the units: an arm in m times an angle in rad is a length")
                continue
            unit = {units.dimension("m"): "m", units.NONE: "rad"}.get(dimension)
            if unit is None:
                self.problem(
                    where, f"is measured in {units.describe(dimension)}", "a point is a length or an angle: correct the coefficients"
                )
                continue
            self.kinds[name] = unit_of[name] = unit
            moving[name] = (ex.symbol(name),) * 2
            yield m.Point(name, text, unit)

    # -- elements --------------------------------------------------------------------------------------------------

    def ends(self, where: tuple[str, ...], ends: list[Any], inputs: tuple[m.Input, ...]) -> tuple[str, str]:
        """The two ends of an element."""
        known = [*self.kinds, m.GROUND]
        if len(ends) != 2 or not all(isinstance(e, str) for e in ends) or ends[0] == ends[1]:
            self.problem(where, f"{show(ends)} does not name two different ends", 'write between = ["body", "wheel"]')
            return m.GROUND, m.GROUND
        for end in ends:
            if unfit := next((i for i in inputs if i.name == end and end not in self.kinds), None):
                if unfit.unit != UNKNOWN:
                    self.problem(where, f"input '{end}' is in {unfit.unit}, an end needs a position", "use an input in m or rad")
            elif end not in known:
                near = difflib.get_close_matches(end, known, 1)
                self.problem(
                    where,
                    f"end {show(end)} is no body, point, input or ground",
                    f"did you mean '{near[0]}'?" if near else f"known are {', '.join(known)}",
                )
        if {"m", "rad"} == {self.kinds[end] for end in ends if end in self.kinds}:
            turning = next(end for end in ends if self.kinds[end] == "rad")
            moves = next(end for end in ends if end != turning)
            self.problem(where, f"'{turning}' turns and '{moves}' moves along a line", LEVER)
        return ends[0], ends[1]

    def of_ends(self, ends: tuple[str, str], unit: str) -> str:
        """A law's unit between these ends."""
        return for_angles(unit) if any(self.kinds.get(end) == "rad" for end in ends) else unit

    def law_element(
        self, where: tuple[str, ...], ends: tuple[str, str], law: str, entry: dict[str, Any], parameters: dict[str, m.Parameter]
    ) -> m.Element:
        """An element with a named law."""
        arguments = {
            key: self.argument(where, key, entry[key], self.of_ends(ends, unit), f"{where[1]}_{key}", parameters)
            for key, unit in LAWS[law].arguments.items()
            if key in entry
        }
        return m.Element(where[1], ends, law, arguments)

    def law_states(self, elements: Iterable[m.Element]) -> Iterable[m.State]:
        """The states that the laws of elements bring along."""
        for e in elements:
            for name, state in LAWS[e.law].states.items() if e.law in LAWS else ():
                yield m.State(e.state(name), self.of_ends(e.ends, state.unit), description=f"{name} of {e.name}")

    def network_element(self, name: str, ends: tuple[str, str], entry: dict[str, Any], networks: dict[str, m.NetworkPort]) -> m.Element:
        where = ("elements", name)
        network = entry.get("network", "")
        if network not in networks:
            if "network" in entry:
                near = difflib.get_close_matches(network, networks, 1)
                self.problem(
                    (*where, "network"),
                    f"network {show(network)} is not declared",
                    f"did you mean '{near[0]}'?" if near else "add it to [networks]",
                )
            return m.Element(name, ends, "network")
        port = networks[network]
        length, force = self.of_ends(ends, "m"), self.of_ends(ends, "N")
        kinds = {"deflection": length, "rate": f"{length}/s"}
        takes = () if network in self.unsure else port.input_units
        inputs = entry.get("inputs")
        if inputs is None:  # the units say which is meant
            inputs = [next((k for k, u in kinds.items() if same(u, unit)), "") for unit in takes]
            for unit in (unit for unit, kind in zip(takes, inputs, strict=True) if not kind):
                self.problem(
                    where,
                    f"network '{network}' takes {unit or 'a number without unit'}, "
                    f"an element has a deflection in {length} and a rate in {length}/s",
                    "correct the unit in [networks]",
                )
        else:
            for kind, unit in zip(inputs, takes, strict=False):  # another number of inputs is reported below
                if kind not in list(kinds):
                    self.problem((*where, "inputs"), f"{show(kind)} is neither deflection nor rate", 'write inputs = ["deflection"]')
                elif not same(kinds[kind], unit):
                    self.problem(
                        (*where, "inputs"),
                        f"the network takes {unit or 'a number without unit'}, but {kind} is in {kinds[kind]}",
                        "correct the unit in [networks]",
                    )
            if takes and len(inputs) != len(takes):
                self.problem((*where, "inputs"), f"{len(inputs)} inputs for a network of {len(takes)}", "give one for each")
        if not same(port.output_unit, force):
            what = "a force" if force == "N" else "a torque"
            self.problem(where, f"network '{network}' gives {port.output_unit}, an element needs {what}", f"declare its output in {force}")
        return m.Element(name, ends, "network", network=network, network_inputs=tuple(inputs))


def _angle(unit: str) -> bool:
    """Does a unit measure an angle? Without a dimension alone it might be a share."""
    try:
        return units.is_angle(unit)
    except units.UnitError:
        return False
