# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a change of a parameter does to the rates and the sensors of a model, as expressions; and where a monitor cannot have it."""

from __future__ import annotations

import sympy as sp

from ..model import Filter, Model, MonitorCause
from . import expressions as ex
from .causalise import Causal, CausaliseError, Problem, causalise
from .jacobian import Derivatives


def effects(model: Model, cause: MonitorCause) -> tuple[list[sp.Expr], list[sp.Expr]]:
    """Changes by a cause of its full size: of the rates and the sensors of the filter, over states and inputs. CausaliseError."""
    causal = causalise(model)
    rows = {s.name: row for s, row in zip(model.sensors, causal.sensors, strict=True)}
    sensed = [rows[s.name] for s in _filter(model).sensors]
    total, changes = Derivatives(causal).total, {ex.symbol(name): sp.Float(change, 17) for name, change in cause.changes.items()}
    along = (sp.Add(*(change * total(value, p) for p, change in changes.items())) for value in (*causal.rates, *sensed))
    found = [_plain(causal, cause, value) for value in along]
    if all(value == 0 for value in found):
        raise CausaliseError([(_where(cause), "changes neither a rate nor a sensor of the filter", "remove it")])
    return found[: len(causal.rates)], found[len(causal.rates) :]


def problems(model: Model) -> list[Problem]:
    """What is wrong with the monitor of a checked model."""
    found: list[Problem] = []
    for cause in model.monitor.causes if model.monitor and model.filter else ():
        try:
            effects(model, cause)
        except CausaliseError as error:
            found += error.problems
    return found


def _filter(model: Model) -> Filter:
    assert model.filter is not None  # reading/monitor_table.py
    return model.filter


def _where(cause: MonitorCause) -> tuple[str, ...]:
    return ("monitor", "causes", cause.name)


def _plain(causal: Causal, cause: MonitorCause, value: sp.Expr) -> sp.Expr:
    """A derivative with values of parameters: over states and inputs alone."""
    varied = {p.name for p in _filter(causal.model).parameters}
    where, known = _where(cause), {*causal.states, *causal.inputs, *map(ex.symbol, varied)}
    for step in reversed(causal.needed([value])):
        if step.value is not None:
            value = value.xreplace({step.target: step.value})
    value = value.xreplace({ex.derivative(q.name): v for q, v in causal.kinematics.items()})
    fixed = [p for p in causal.model.parameters.values() if p.name not in varied]
    value = value.xreplace({ex.symbol(p.name): sp.Float(p.value, 17) for p in fixed})
    if value.free_symbols & set(causal.input_rates):
        raise CausaliseError([(where, "its effect depends on the rate of an input", "watch for another parameter")])
    if value.free_symbols - known:
        raise CausaliseError([(where, "its effect depends on a network", "watch for a parameter of a law beside the network")])
    if value.has(sp.zoo, sp.nan):
        raise CausaliseError([(where, "its effect is not finite at the parameters of the file", "change them")])
    return value
