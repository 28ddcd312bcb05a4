# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The explanation that moves the fewest values: is the model right with another value of one parameter?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from penode_gen import units
from penode_gen.model import Parameter

from ..entries import table
from ..explanation import CHANCE
from ..fit import Fit, Free, Problem
from ..result import Cause, Named, Value, worsened
from ..study import uncertain
from ..worth import RIGHT, Z_95
from .case import Case, End
from .figures import Table
from .written import heading


@dataclass(frozen=True, eq=False)
class Lone:
    """A parameter, and the fit in which it is free beside what the file states tolerances of."""

    name: str
    fit: Fit


def lone(case: Case, end: End, figures: Table) -> list[Lone]:
    """Parameters without a stated tolerance of which each alone makes the nominal model follow the training as well as the extended one
    does, the best first: more than one, and the recordings do not tell which."""
    study, model = end.study, case.model
    stated = [uncertain(p) for p in model.parameters.values() if p.tolerance > 0.0 and p.value]
    starts = [f for f in study.null.free if f.target[0] == "start"]
    problem = Problem(model, study.experiments, study.metrics, study.set_name, study.linear.fastest)
    extended = [figures.predicted[e.name][1].at(e.time) for e in study.experiments]
    fits = [Lone(p.name, problem.solve([*stated, _free(p), *starts])) for p in model.parameters.values() if _unstated(p)]
    good = [x for x in fits if all(map(np.isfinite, (x.fit.cost, *_size(x)))) and not _behind(end, x.fit, extended)]
    good = sorted(good, key=lambda x: x.fit.cost)
    return [x for x in good if x.fit.cost - good[0].fit.cost < CHANCE * CHANCE]


def _unstated(p: Parameter) -> bool:
    return not p.exact and not p.tolerance and bool(p.value)


def _free(p: Parameter) -> Free:
    """A parameter of any size, of its own sign."""
    return Free(p.name, p.value, abs(p.value), log=True, origin=p.value)


def _behind(end: End, fit: Fit, extended: list[np.ndarray]) -> bool:
    """Does a fit follow a sensor in training worse than the extended model?"""
    for e, z, own in zip(end.study.experiments, extended, fit.simulated, strict=True):
        for j in range(e.y.shape[1]):
            good = e.good[:, j]
            errors = [float(np.sqrt(np.mean((e.y - x)[good, j] ** 2))) if good.any() else 0.0 for x in (z, own)]
            if worsened(*errors):
                return True
    return False


def _size(x: Lone) -> tuple[float, float]:
    """Value of the parameter, and its standard deviation."""
    i = next(k for k, f in enumerate(x.fit.free) if f.target == x.name)
    value = x.fit.free[i].value
    return value, abs(value) * float(np.sqrt(max(x.fit.covariance()[i, i], 0.0)))


def posterior(found: list[Lone]) -> list[float]:
    """How likely each of them is; what is not among them has the rest."""
    likely = np.exp([0.5 * (found[0].fit.cost - x.fit.cost) for x in found])
    return [float(p) for p in RIGHT * likely / likely.sum()]


def caused(case: Case, found: list[Lone]) -> Cause:
    """The best of them as a cause, with the others as its alternatives."""
    value, sd = _size(found[0])
    name, unit = found[0].name, units.si(case.model.parameters[found[0].name].unit)
    others = tuple(Named("wrong_parameter", x.name) for x in found[1:])
    interval = Value(value, unit, (value - Z_95 * sd, value + Z_95 * sd))
    return Cause("wrong_parameter", name, {name: interval}, posterior(found)[0], others)


def text(case: Case, cause: Cause, x: Lone) -> str:
    """The model file with the values of a fit in it, which has this cause."""
    model = case.model
    values = {f.target: f.value for f in x.fit.free if isinstance(f.target, str)}
    lines = heading(model, cause.kind, cause.where)
    for p in model.parameters.values():
        if p.name in values and values[p.name] != p.value:
            lines.append(f"{p.name} = {table(entry(p, values[p.name]))}")
    return "\n".join([*lines, ""])


def entry(p: Parameter, value: float) -> dict[str, object]:
    """A parameter of the model file with another value [SI]."""
    entry: dict[str, object] = {"value": value / units.factor(p.unit), "unit": p.unit}
    entry |= {"tolerance": p.tolerance if np.isfinite(p.tolerance) else "unknown"} if p.tolerance else {}
    entry |= {"tunable": True} if p.tunable else {}
    return entry | ({"description": p.description} if p.description else {})
