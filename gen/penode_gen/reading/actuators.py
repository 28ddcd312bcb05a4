# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Actuators of a model file: between an input and the plant that it drives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from .. import model as m
from ..algebra import sampled
from .ends import EndTables

SOURCE = "{unit}"  # of an argument in the unit of the actuator's input
LAWS = {  # arguments with their units
    "gain": {"gain": "1"},
    "lag": {"time": "s"},
    "dead_zone": {"width": SOURCE},
    "saturation": {"limit": SOURCE},
}
STATES = {"lag"}  # laws with a state of their own, which may have a start
NOT_NEGATIVE = {"time": False, "width": True, "limit": False}  # arguments with a sign, and whether zero is allowed
KEYS = ("samples", "gain", "time", "width", "limit", "rate", "start")


@dataclass
class Actuated:
    """What actuators add to a model. Elements may act on points and states, equations may use all of them."""

    points: list[m.Point] = field(default_factory=list)
    states: list[m.State] = field(default_factory=list)
    variables: list[m.Variable] = field(default_factory=list)
    equations: list[m.Equation] = field(default_factory=list)
    sampled: list[m.Sampled] = field(default_factory=list)


class ActuatorTables(EndTables):
    """Reads [actuators]."""

    def actuators(self, inputs: tuple[m.Input, ...], parameters: dict[str, m.Parameter], sample_time: float) -> Actuated:
        """Actuated signals: a gain is a combination of its input, a lag a state with an equation, a dead zone or a saturation a variable
        with one; others work on samples."""
        of: dict[str, str] = {i.name: i.unit for i in inputs}
        made_by: dict[str, str] = {}
        found = Actuated()
        for name, entry in self.section("actuators").items():
            where = ("actuators", name)
            law, source = entry.get("law", ""), entry.get("input", "")
            if source not in of:
                if source:
                    self.problem((*where, "input"), f"'{source}' is no input or earlier actuator", f"known are {', '.join(of) or 'none'}")
                continue
            if law in sampled.LAWS:
                rate = self.quantity((*where, "rate"), entry["rate"], f"{of[source]}/s") if "rate" in entry else 0.0
                late = sampled.read(where, entry, of[source], made_by.get(source, ""), sample_time, rate, self.problem)
                found.sampled += [late] if late else []
            elif law in LAWS:
                arguments = self._arguments(where, entry, law, of[source], parameters)
                if len(arguments) < len(LAWS[law]):
                    continue
                start = self.quantity((*where, "start"), entry["start"], of[source]) if law in STATES and "start" in entry else 0.0
                _add(found, name, law, source, of[source], arguments, start)
            else:
                if law:
                    self.problem((*where, "law"), f"law '{law}' is unknown", f"known are {', '.join((*LAWS, *sampled.LAWS))}")
                continue
            of[name], made_by[name] = of[source], law
        bent = {v.name for v in found.variables}  # has no rate, which elements need
        self.measured({name: unit for name, unit in of.items() if name not in bent})
        return found

    def _arguments(
        self, where: tuple[str, str], entry: Mapping[str, Any], law: str, unit: str, parameters: dict[str, m.Parameter]
    ) -> dict[str, str]:
        """The parameters that are the arguments of a law; `unit` of the signal that it acts on."""
        arguments = {}
        for key, of in LAWS[law].items():
            if key in entry:
                arguments[key] = self.argument(where, key, entry[key], of.format(unit=unit), f"{where[1]}_{key}", parameters)
                value = parameters[arguments[key]].value if arguments[key] in parameters else 1.0
                if key in NOT_NEGATIVE and not (value > 0.0 or (NOT_NEGATIVE[key] and value == 0.0)):
                    wanted = f"{'' if NOT_NEGATIVE[key] else 'positive '}{key}" + " of zero or more" * NOT_NEGATIVE[key]
                    or_gain = ', or write law = "gain"' * (law == "lag")
                    self.problem(
                        (*where, key), "is not above zero" if not NOT_NEGATIVE[key] else "is below zero", f"give a {wanted}{or_gain}"
                    )
            else:
                self.problem(where, f"'{key}' is missing", f"add {key} = ...")
        allowed = {*LAWS[law], *(("start",) if law in STATES else ())}
        for key in sorted(set(KEYS) & set(entry) - allowed):
            self.problem((*where, key), f"the law '{law}' has no {key}", "remove it")
        return arguments


def _add(found: Actuated, name: str, law: str, source: str, unit: str, arguments: Mapping[str, str], start: float) -> None:
    """Adds the output of a law for a signal."""
    if law == "gain":
        found.points.append(m.Point(name, f"{arguments['gain']}*{source}", unit))
        return
    if law in STATES:
        found.states.append(m.State(name, unit, start, f"{source} behind a {law.replace('_', ' ')}"))
    else:
        found.variables.append(m.Variable(name, unit))
    found.equations.append(m.Equation(name, _equation(name, law, source, arguments)))


def _equation(name: str, law: str, source: str, arguments: Mapping[str, str]) -> str:
    match law:
        case "lag":
            return f"der({name})*{arguments['time']} = {source} - {name}"
        case "dead_zone":
            width = arguments["width"]
            return f"{name} = max({source} - {width}, 0) + min({source} + {width}, 0)"
    limit = arguments["limit"]
    return f"{name} = min(max({source}, -{limit}), {limit})"
