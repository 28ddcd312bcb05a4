# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The explanation that moves the fewest values: is the model right with other values of some parameters, the rest as the file has them?

Motion shows forces over masses, so a common factor of all of them is invisible, and a fit in which all are free may end at any factor. Of
all values that follow the recordings equally well, those that differ from the file in the fewest parameters, by more than they may be
ROUNDED, are the explanation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, erfc

from penode_gen import units
from penode_gen.model import Model, Parameter

from ...compared import worsened
from ..catalogue import values as of_values
from ..evidence.prior import SHARE
from ..extend.entries import table
from ..reliability import trust
from ..result import Cause, Value
from ..search.worth import Z_95
from ..study.fit import Fit, Free, Problem
from ..study.study import uncertain
from .case import Case, End
from .figures import Table
from .leftover import CHANCE, only_noise, rows
from .written import heading


@dataclass(frozen=True, eq=False, repr=False)
class Few:
    """Parameters, and the fit in which they are free, and all others within their tolerances."""

    names: tuple[str, ...]
    fit: Fit
    nominal: float  # chi2 of the nominal model, fitted within the tolerances that its file states

    def __repr__(self) -> str:
        return " and ".join(self.names)


def few(case: Case, end: End, figures: Table) -> list[Few]:
    """The fewest parameters without a stated tolerance whose values make the nominal model follow the training as well as with all of them
    free, and as the extended model does; the best first: more than one set, and the recordings do not show which. All others are as the
    file has them, or, where that is not enough, ROUNDED, unless that alone is. None if it takes all of them, or if even all do not."""
    study, model = end.study, case.model
    unstated = [p for p in model.parameters.values() if _unstated(p)]
    if not unstated:
        return []
    known = {p.name: _within(p) for p in model.parameters.values() if p.tolerance > 0.0 and p.value}
    rounded = {p.name: _within(replace(p, tolerance=of_values.ROUNDED)) for p in unstated}
    starts = [f for f in study.null.free if f.target[0] == "start"]
    problem = Problem(model, study.experiments, study.metrics, study.set_name, study.linear.fastest)
    extended = [figures.predicted[e.name][1].at(e.time) for e in study.experiments]

    nominal = problem.solve([*known.values(), *starts]).chi2

    def fitted(names: Sequence[str], beside: Mapping[str, Free]) -> Few:
        others = [f for name, f in {**known, **beside}.items() if name not in names]
        return Few(tuple(names), problem.solve([*others, *(_free(model.parameters[n]) for n in names), *starts]), nominal)

    def good(x: Few) -> bool:
        sound = all(map(np.isfinite, (x.fit.cost, *_sizes(x)))) and not _behind(end, x.fit, extended)
        return sound and x.fit.cost - whole.fit.cost < _by_chance(len(unstated) - len(x.names))

    whole = fitted([p.name for p in unstated], {})
    if _behind(end, whole.fit, extended) or (end.answer.verdict == "unexplained" and not only_noise(study, whole.fit)):
        return []
    ways: list[dict[str, Free]] = [{}] if good(fitted((), rounded)) else [{}, rounded]
    for count, beside in product(range(1, max(len(unstated), 2)), ways):
        tried = (fitted(names, beside) for names in _promising(whole, count, bool(beside)))
        if found := sorted(filter(good, tried), key=lambda x: x.fit.cost):
            return [x for x in found if x.fit.cost - found[0].fit.cost < CHANCE * CHANCE]
    return []


def _by_chance(values: int) -> float:
    """Chi2 that as many values take by fitting noise, at CHANCE deviations (Wilks 1938)."""
    return float(chdtri(max(values, 1), erfc(CHANCE / np.sqrt(2.0))))


def _promising(whole: Few, count: int, rounded: bool) -> list[tuple[str, ...]]:
    """Sets of `count` of the parameters of a fit, as many as there are parameters at most: those that lose least of it, by a quadratic
    expansion, when all others are as the file has them, or as far from it as they are `rounded`. In logarithms of the parameters a common
    factor is a straight line."""
    free = list(whole.fit.free)
    own = [k for k, f in enumerate(free) if f.target in whole.names]
    rest = [k for k in range(len(free)) if k not in own]
    curvature = whole.fit.jacobian.T @ whole.fit.jacobian
    curvature = curvature[np.ix_(own, own)] - _absorbed(curvature, own, rest)
    off = np.array([np.log(free[k].value / free[k].origin) for k in own])
    lost = {}
    for chosen in combinations(range(len(own)), count):
        others = [k for k in range(len(own)) if k not in chosen]
        left = curvature[np.ix_(others, others)] - _absorbed(curvature, others, list(chosen))
        if rounded:  # what others lose and what their priors cost, at the values between where that is least
            left = left - left @ np.linalg.solve(left + np.eye(len(others)) / (of_values.ROUNDED * SHARE) ** 2, left)
        lost[tuple(str(free[own[k]].target) for k in chosen)] = float(off[others] @ left @ off[others])
    return sorted(lost, key=lambda names: lost[names])[: len(own)]


def _absorbed(curvature: NDArray[np.float64], kept: list[int], free: list[int]) -> NDArray[np.float64]:
    """What free values take of the curvature of those kept."""
    cross = curvature[np.ix_(kept, free)]
    return cross @ np.linalg.pinv(curvature[np.ix_(free, free)], rcond=1e-10, hermitian=True) @ cross.T


def taken(end: End, x: Few) -> float:
    """Share that values take of the chi2 beyond noise of the nominal model."""
    noise = rows(end.study)
    return float(np.clip(1.0 - (x.fit.chi2 - noise) / max(x.nominal - noise, 1e-300), 0.0, 1.0))


def moved(case: Case, model: Model) -> set[str]:
    """Parameters without a stated tolerance that have another value in a model."""
    return {p.name for p in case.model.parameters.values() if _unstated(p) and model.parameters[p.name].value != p.value}


def _unstated(p: Parameter) -> bool:
    return not p.exact and not p.tolerance and bool(p.value)


def _within(p: Parameter) -> Free:
    """A parameter within its tolerance, in logarithms as those that are free: a common factor of all is a straight line then."""
    return replace(uncertain(p), unit=abs(p.value), log=True)


def _free(p: Parameter) -> Free:
    """A parameter of any size, of its own sign."""
    return Free(p.name, p.value, abs(p.value), log=True, origin=p.value)


def _behind(end: End, fit: Fit, extended: list[NDArray[np.float64]]) -> bool:
    """Does a fit follow a sensor in training worse than the extended model?"""
    for e, z, own in zip(end.study.experiments, extended, fit.simulated, strict=True):
        for j in range(e.y.shape[1]):
            good = e.good[:, j]
            errors = [float(np.sqrt(np.mean((e.y - x)[good, j] ** 2))) if good.any() else 0.0 for x in (z, own)]
            if worsened(*errors):
                return True
    return False


def _sizes(x: Few) -> list[float]:
    """Values of the parameters, then their standard deviations."""
    at = [next(k for k, f in enumerate(x.fit.free) if f.target == name) for name in x.names]
    values, covariance = [float(x.fit.free[k].value) for k in at], x.fit.covariance()
    return [*values, *(abs(v) * float(np.sqrt(max(covariance[k, k], 0.0))) for v, k in zip(values, at, strict=True))]


def posterior(end: End, found: Sequence[Few]) -> list[float]:
    """The probability of each of them; what is not in the catalogue has the rest."""
    likely = np.exp([0.5 * (found[0].fit.cost - x.fit.cost) for x in found])
    return [float(p) for p in trust(taken(end, found[0])) * likely / likely.sum()]


def caused(case: Case, end: End, found: Sequence[Few]) -> tuple[Cause, ...]:
    """The best set as causes, each with the parameters of the other sets as its alternatives."""
    sizes, names = _sizes(found[0]), found[0].names
    others = list(dict.fromkeys(n for x in found[1:] for n in x.names if n not in names))
    causes = []
    for name, value, sd in zip(names, sizes[: len(names)], sizes[len(names) :], strict=True):
        interval = Value(value, units.si(case.model.parameters[name].unit), (value - Z_95 * sd, value + Z_95 * sd))
        causes.append(of_values.cause(name, interval, posterior(end, found)[0], others))
    return tuple(causes)


def explanations(end: End, found: Sequence[Few]) -> tuple[dict[str, object], ...]:
    """All sets with their posterior."""
    return tuple(
        {"causes": [asdict(of_values.named(n)) for n in x.names], "posterior": p} for x, p in zip(found, posterior(end, found), strict=True)
    )


def text(case: Case, causes: Sequence[Cause], x: Few) -> str:
    """The model file with the values of a fit in it, which has these causes."""
    model = case.model
    fitted = {f.target: f.value for f in x.fit.free if isinstance(f.target, str)}
    lines = heading(model, f"{causes[0].kind} at {', '.join(c.where for c in causes)}")
    for p in model.parameters.values():
        if fitted.get(p.name, p.value) != p.value:
            lines.append(f"{p.name} = {table(entry(p, fitted[p.name]))}")
    return "\n".join([*lines, ""])


def entry(p: Parameter, value: float) -> dict[str, object]:
    """A parameter of the model file with another value [SI]."""
    entry: dict[str, object] = {"value": value / units.factor(p.unit), "unit": p.unit}
    entry |= {"tolerance": p.tolerance if np.isfinite(p.tolerance) else "unknown"} if p.tolerance else {}
    entry |= {"tunable": True} if p.tunable else {}
    return entry | ({"description": p.description} if p.description else {})
