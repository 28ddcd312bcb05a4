# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The model that a filter steps if it estimates parameters: each of them is an input, behind those of the file. So the derivatives of the
step along them are the exact ones that it has along inputs, whatever the method, and the sets of parameters are only read.
"""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from ..model import Filter, Input, Model
from . import expressions as ex
from .causalise import Causal, Problem, causalise


def augmented(model: Model, given: Filter) -> tuple[Model, Causal]:
    """The model and its equations. They are ordered before a parameter becomes an input: its rate counts nowhere."""
    causal, names = causalise(model), [p.name for p in given.parameters]
    inputs = (*model.inputs, *(Input(n, model.parameters[n].unit, description="a parameter that the filter estimates") for n in names))
    whole = replace(model, name=model.stepped, inputs=inputs, set_owner=model.owner, filter=None, monitor=None)
    return whole, replace(causal, model=whole, inputs=(*causal.inputs, *map(ex.symbol, names)))


def problems(model: Model, given: Filter, causal: Causal) -> list[Problem]:
    """What is wrong with the parameters of a filter."""
    found: list[Problem] = []
    rows = {s.name: row for s, row in zip(model.sensors, causal.sensors, strict=True)}
    seen = [*causal.rates, *(rows[s.name] for s in given.sensors)]
    for p in given.parameters:
        where = ("filter", "parameters", p.name)
        if not causal.uses(seen, [ex.symbol(p.name)]):
            found.append((where, "changes neither a rate nor a sensor of the filter", "remove it"))
        if p.least <= 0.0 <= p.most and _divides(causal, ex.symbol(p.name)):
            found.append((where, "the model divides by it, and its bounds reach 0", "give bounds of one sign"))
        outside = [f"'{name}'" for name, chosen in model.sets.items() if not p.least < chosen.parameters[p.name] < p.most]
        if outside:
            found.append((where, f"its value in {', '.join(outside)} of [sets] is not inside of its bounds", "move a bound, or the value"))
        for cause in model.monitor.causes if model.monitor else ():
            if p.name in cause.changes:
                what = f"the filter follows its changes, and the cause '{cause.name}' of [monitor] would not be seen"
                found.append((where, what, "remove one of them"))
    return found


def _divides(causal: Causal, parameter: sp.Symbol) -> bool:
    """Is there a quotient whose divisor is zero where the parameter is?"""
    parts = [part for step in causal.steps for part in step.parts] + [*causal.outputs, *causal.sensors]
    divisors = {power.base for part in parts for power in part.atoms(sp.Pow) if power.exp.is_negative}
    return any(base.xreplace({parameter: sp.Integer(0)}).is_zero for base in divisors)
