# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The filter of a model file: [filter], and the tables in it."""

from __future__ import annotations

import difflib
import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

from .. import model as m
from .actuators import ActuatorTables

NUMBER = (int, float)
TABLES: dict[str, dict[str, Any]] = {
    "sensors": {"noise": NUMBER, "gate": NUMBER},
    "states": {"start": NUMBER, "noise": NUMBER, "min": NUMBER, "max": NUMBER},
    "inputs": {"noise": NUMBER, "walk": NUMBER, "start": NUMBER, "correlation": str},
    "parameters": {"start": NUMBER, "walk": NUMBER, "min": NUMBER, "max": NUMBER},
    "limits": {"value": str, "unit": str, "min": NUMBER, "max": NUMBER},
}
KINDS = {"sensors": "sensor", "states": "state", "inputs": "input", "parameters": "parameter"}
MOST = 32  # sensors: bits of the mask
ROUNDING = 2.0**-24  # of a float


class FilterTables(ActuatorTables):
    """Reads [filter]."""

    def filter(
        self,
        sensors: Collection[m.Signal],
        state_units: Mapping[str, str],
        inputs: Collection[m.Input],
        parameters: Mapping[str, m.Parameter],
        sample_time: float,
    ) -> m.Filter | None:
        """The filter; None if the file has none. Limits are still without coefficients (algebra/limits.py)."""
        if "filter" not in self.data:
            return None
        head = self.table(("filter",), {"gate": NUMBER} | dict.fromkeys(TABLES, dict), self.data["filter"], ("sensors", "states"))
        gate = self.above_zero(("filter", "gate"), head["gate"]) if "gate" in head else None
        known = {"sensors": [s.name for s in sensors], "states": list(state_units), "inputs": [i.name for i in inputs]}
        known["parameters"] = list(parameters)
        entries = {part: dict(self.known(part, head.get(part, {}), known.get(part))) for part in TABLES}
        if not state_units:
            self.problem(("filter",), "the model has no states, and a filter estimates states", "remove [filter]")
        if "sensors" in head and not 1 <= len(head["sensors"]) <= MOST:
            self.problem(("filter", "sensors"), f"{len(head['sensors'])} sensors", f"name 1 to {MOST} sensors of the model")
        return m.Filter(
            tuple(self.used(s, gate, entries["sensors"][s.name]) for s in sensors if s.name in entries["sensors"]),
            tuple(self.states_of(state_units, entries["states"], sample_time)),
            tuple(self.input_of(i, entries["inputs"][i.name], sample_time) for i in inputs if i.name in entries["inputs"]),
            tuple(self.limit(name, entry) for name, entry in entries["limits"].items()),
            tuple(self.parameter(parameters[name], entry, sample_time) for name, entry in entries["parameters"].items()),
        )

    def known(self, part: str, given: dict[str, Any], names: list[str] | None) -> Iterator[tuple[str, dict[str, Any]]]:
        """The entries of a table of the filter; those that name nothing of the model are problems."""
        for name, entry in given.items():
            where = ("filter", part, name)
            if names is not None and name not in names:
                near = difflib.get_close_matches(name, names, 1)
                remedy = f"did you mean '{near[0]}'?" if near else f"known are {', '.join(names) or 'none'}"
                self.problem(where, f"the model has no {KINDS[part]} '{name}'", remedy)
            else:
                self.label(where, name)
                yield name, self.table(where, TABLES[part], entry, ("value", "unit") if part == "limits" else ())

    def above_zero(self, where: tuple[str, ...], given: float, scale: float = 1.0) -> float:
        """A number above zero; what else stands there is a problem."""
        found = self.number(where, given, scale)
        if found <= 0.0:
            self.problem(where, f"{given} is not above zero", "give a standard deviation, or a number of them")
        return found

    def not_below_zero(self, where: tuple[str, ...], given: float, scale: float) -> float:
        found = self.number(where, given, scale)
        if found < 0.0:
            self.problem(where, f"{given} is below zero", "give a standard deviation")
        return found

    def bounds(self, where: tuple[str, ...], entry: dict[str, Any], scale: float) -> tuple[float | None, float | None]:
        """Both bounds in SI, None for one that is not stated."""
        low, high = (self.number((*where, key), entry[key], scale) if key in entry else None for key in ("min", "max"))
        if low is not None and high is not None and low >= high:
            self.problem(where, "min is not below max", "exchange them")
        return low, high

    def used(self, sensor: m.Signal, gate: float | None, entry: dict[str, Any]) -> m.FilterSensor:
        where, noise = ("filter", "sensors", sensor.name), sensor.noise
        if "noise" in entry:
            noise = self.above_zero((*where, "noise"), entry["noise"], self.unit(where, sensor.unit))
        elif not noise > 0.0:
            self.problem(where, "has no noise", "add noise = ..., a standard deviation, here or in [sensors]")
        return m.FilterSensor(sensor.name, noise, self.above_zero((*where, "gate"), entry["gate"]) if "gate" in entry else gate)

    def states_of(self, state_units: Mapping[str, str], entries: dict[str, Any], sample_time: float) -> Iterable[m.FilterState]:
        """All states; each needs its standard deviation at the start."""
        for name, unit in state_units.items():
            where, entry = ("filter", "states", name), entries.get(name, {})
            scale = self.unit(where, unit)
            if "start" not in entry:
                self.problem(where, "'start' is missing", f"add {name} = {{ start = ... }}, its standard deviation at the start")
            start = self.above_zero((*where, "start"), entry["start"], scale) if "start" in entry else 1.0
            noise = self.not_below_zero((*where, "noise"), entry.get("noise", 0.0), scale)
            yield m.FilterState(name, start, noise * math.sqrt(sample_time), *self.bounds(where, entry, scale))

    def input_of(self, signal: m.Input, entry: dict[str, Any], sample_time: float) -> m.FilterInput:
        """White errors of a measured input; or an input that is not measured, as a walk or with a correlation time."""
        where, scale = ("filter", "inputs", signal.name), self.unit((), signal.unit)
        if ("noise" in entry) == ("walk" in entry):
            self.problem(where, "needs exactly one of noise and walk", "noise: a standard deviation; walk: how far it moves in a second")
        noise = self.above_zero((*where, "noise"), entry["noise"], scale) if "noise" in entry else 1.0
        if "walk" in entry:
            walk = self.above_zero((*where, "walk"), entry["walk"], scale)
            if "start" not in entry:
                self.problem(where, "'start' is missing", "add start = ..., its standard deviation at the start")
            start = self.above_zero((*where, "start"), entry["start"], scale) if "start" in entry else 1.0
            if "correlation" in entry:
                self.problem((*where, "correlation"), "a walk has none", "remove it, or give noise instead of walk")
            return m.FilterInput(signal.name, start, walk * math.sqrt(sample_time), 1.0, False)
        if "start" in entry:
            self.problem((*where, "start"), "is that of noise already", "remove it")
        if "correlation" not in entry:
            return m.FilterInput(signal.name, noise, noise, 0.0, True)
        time = self.quantity((*where, "correlation"), entry["correlation"], "s")
        if not time > 0.0:
            self.problem((*where, "correlation"), f"{entry['correlation']} is not above zero", "give a time such as '0.5 s'")
            time = 1.0
        decay = math.exp(-sample_time / time)
        return m.FilterInput(signal.name, noise, noise * math.sqrt(-math.expm1(-2.0 * sample_time / time)), decay, False)

    def parameter(self, given: m.Parameter, entry: dict[str, Any], sample_time: float) -> m.FilterParameter:
        """A walk within bounds. What a float does not resolve from one sample to the next would be no walk."""
        where, scale = ("filter", "parameters", given.name), self.unit((), given.unit)
        if not given.tunable:
            self.problem(where, "is not tunable, and the C has it as a constant", "add tunable = true to it in [parameters]")
        needs = {"start": "its standard deviation at the start", "walk": "how far it moves in a second"}
        for key, meaning in (needs | {"min": "its lower bound", "max": "its upper bound"}).items():
            if key not in entry:
                self.problem(where, f"'{key}' is missing", f"add {key} = ..., {meaning}")
        start, walk = (self.above_zero((*where, key), entry[key], scale) if key in entry else math.inf for key in needs)
        step, least = walk * math.sqrt(sample_time), ROUNDING * abs(given.value)
        if 0.0 < step < least:
            shown = f"{least / math.sqrt(sample_time) / scale:.2g}"
            self.problem((*where, "walk"), f"{entry['walk']} is lost in the rounding of a float", f"give at least {shown}")
        low, high = self.bounds(where, entry, scale)
        return m.FilterParameter(given.name, start, step, -math.inf if low is None else low, math.inf if high is None else high)

    def limit(self, name: str, entry: dict[str, Any]) -> m.FilterLimit:
        where = ("filter", "limits", name)
        low, high = self.bounds(where, entry, self.unit(where, entry.get("unit")))
        if low is None and high is None:
            self.problem(where, "has neither min nor max", "add one of them")
        return m.FilterLimit(name, entry.get("value", "0"), entry.get("unit", "1"), low, high)

    def units_of_states(self, bodies: Iterable[m.Body], states: Iterable[m.State]) -> dict[str, str]:
        """Unit of each state, in order: of those of [states] the unit of the file."""
        bodies = list(bodies)
        found = {b.position: b.unit for b in bodies} | {b.velocity: f"{b.unit}/s" for b in bodies}
        return found | {s.name: s.unit for s in states}
