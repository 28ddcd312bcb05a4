# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Limits of a filter as sums of its states with constant coefficients, and models that cannot have a filter."""

from __future__ import annotations

from dataclasses import replace

import sympy as sp

from ..model import Filter, FilterLimit, Model, Signal
from . import augmented, expressions as ex
from .causalise import Causal, CausaliseError, Problem, causalise


def complete(model: Model) -> tuple[Model, list[Problem]]:
    """A checked model with the coefficients of its filter's limits, and what is wrong with the filter."""
    if model.filter is None:
        return model, []
    causal = causalise(model)
    found = _of_inputs(model, model.filter, causal) + augmented.problems(model, model.filter, causal)
    signals = tuple(Signal(limit.name, limit.text, limit.unit) for limit in model.filter.limits)
    try:
        causal = causalise(replace(model, sensors=signals))
    except CausaliseError as error:
        return model, found + [(("filter", "limits", where[-1]), what, remedy) for where, what, remedy in error.problems]
    limits = []
    for limit, value in zip(model.filter.limits, causal.sensors, strict=True):
        done, problems = _linear(causal, model.filter, limit, value)
        found += problems
        limits.append(done)
    whole = replace(model.filter, limits=(*_bounds(model.filter), *limits))
    found += _outside(model, whole)
    return replace(model, filter=whole), found


def _of_inputs(model: Model, given: Filter, causal: Causal) -> list[Problem]:
    """Inputs and parameters that are states are set in the step sample by sample, which restarts its memory of earlier samples."""
    names = [i.name for i in given.inputs]
    if not (names or given.parameters):
        return []
    where, kind = (("filter", "inputs"), "an input") if names else (("filter", "parameters"), "a parameter")
    found: list[Problem] = []
    if model.interpolation not in ("linear", "held"):
        what = f'{kind} of the filter, and input = "{model.interpolation}" of the step, which remembers more than one sample'
        found.append((where, what, 'write input = "linear" or "held" in [model]'))
    if causal.uses([*causal.rates, *causal.outputs, *causal.sensors], [ex.derivative(n) for n in names]):
        found.append((where, "the model uses the rate of an input of the filter", "make that input a state with an equation of its own"))
    if model.sampled:
        found.append((where, f"{kind} of the filter, and actuators that work on samples", "remove one of them"))
    return found


def _linear(causal: Causal, given: Filter, limit: FilterLimit, value: sp.Expr) -> tuple[FilterLimit, list[Problem]]:
    """The coefficients of a limit, the largest 1 or -1."""
    where = ("filter", "limits", limit.name)
    value = value.xreplace({ex.derivative(q.name): v for q, v in causal.kinematics.items()})
    for step in reversed(causal.needed([value])):
        if step.network and value.has(step.target):
            return limit, [(where, f"depends on the network {step.network}", "give a sum of states")]
        value = value.xreplace({step.target: step.value}) if step.value is not None else value
    varied = {p.name for p in given.parameters}
    tunable = sorted(p.name for p in causal.model.tunable if ex.symbol(p.name) in value.free_symbols and p.name not in varied)
    if tunable:
        return limit, [(where, f"depends on the tunable parameter {tunable[0]}", "a limit is fixed: give it by constants")]
    fixed = [p for p in causal.model.parameters.values() if p.name not in varied]
    value = sp.expand(value.xreplace({ex.symbol(p.name): sp.Float(p.value, 17) for p in fixed}))
    measured = {i.name for i in given.inputs if i.measured}
    own = [ex.symbol(n) for n in given.names if n not in measured]
    parts = [sp.diff(value, s) for s in own]
    rest = sp.expand(value - sp.Add(*(c * s for c, s in zip(parts, own, strict=True))))
    if any(c.free_symbols or not c.is_number for c in parts) or rest.free_symbols or not rest.is_number:
        return limit, [(where, "is no sum of states of the filter with constant coefficients", "give one; a measured input is no state")]
    numbers = {s.name: float(c) for s, c in zip(own, parts, strict=True) if float(c) != 0.0}
    if not numbers:
        return limit, [(where, "depends on no state of the filter", "remove it")]
    scale, offset = max(map(abs, numbers.values())), float(rest)
    least, most = (None if b is None else (b - offset) / scale for b in (limit.least, limit.most))
    return replace(limit, coefficients={n: c / scale for n, c in numbers.items()}, least=least, most=most), []


def _bounds(given: Filter) -> tuple[FilterLimit, ...]:
    """Bounds of states and parameters as limits."""
    bounds = [(s.name, s.least, s.most) for s in given.states] + [(p.name, p.least, p.most) for p in given.parameters]
    bounded = [(name, least, most) for name, least, most in bounds if least is not None or most is not None]
    return tuple(FilterLimit(name, name, "", least, most, {name: 1.0}) for name, least, most in bounded)


def _outside(model: Model, given: Filter) -> list[Problem]:
    """Limits that the start state does not keep: from there a state that breaks them is drawn back."""
    start = dict(zip(model.states, model.start, strict=True)) | model.sets["default"].parameters
    found: list[Problem] = []
    varied = {p.name for p in given.parameters}
    for limit in given.limits:
        value = sum(c * start.get(n, 0.0) for n, c in limit.coefficients.items())
        low, high = limit.least is not None and not value > limit.least, limit.most is not None and not value < limit.most
        stated = limit.unit or limit.name not in varied  # else each set is checked by itself
        if limit.coefficients and (low or high) and stated:
            part = "limits" if limit.unit else "states"
            found.append((("filter", part, limit.name), "the start state is not inside of it", "move the bound, or the start state"))
    return found
