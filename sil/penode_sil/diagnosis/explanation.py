# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An explanation of recordings: some causes, fitted, and what it is worth.

Explanations are compared by their likelihood, each with the noise that suits it, so that slow noise and a cause compete like any two
causes. A cause is a curve, not a formula: kinds of one family at one place are one curve with one name.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import constants

from penode_gen.model import Model

from .build import Extended, Term
from .catalogue import drives, lines, loads, masses, values
from .catalogue.others import DRIFTING
from .fit import Fit, Problem
from .hypotheses import CLOCK, VALUED, Basis, Fault
from .score import Candidate
from .study import Study

CHANCE = 3.0  # deviations of chi2
COST = 10.0  # chi2 that an elementary law must gain for each of its numbers, and the choice among many
NEW = 50.0  # chi2 that a further kind must gain beyond that
FORM = 7e-4  # of the total gain: what one more number must gain, or it only adapts the form
LEAST = 1e-3  # of the total gain: less, together with a curve, is a detail of its memory that no family has
CURVES = {  # kinds of one family at one place are one curve with one name
    "coulomb_friction": "friction",
    "stribeck_friction": "friction",
    "bouc_wen": "friction",
    "degressive_damper": "damper",
    "quadratic_damper": "damper",
    "asymmetric_damper": "damper",
    "damper_fading": "damper",
    "cubic_spring": "spring",
    "asymmetric_spring": "spring",
    "bump_stop": "spring",
    "backlash": "spring",
    "network_extrapolation": "spring",
    "tyre_nonlinear": "tyre",
    "tyre_liftoff": "tyre",
}
EXACT = (values.KIND, *loads.KINDS, *masses.KINDS, *lines.KINDS, CLOCK)  # a formula after all
FORMULAS = (values.KIND, *loads.KINDS, *DRIFTING, *drives.SENSORS, *lines.KINDS)  # and of one number
LOADS = {"constant_force", "sensor_bias"}  # one looks like the other
Group = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Explanation:
    """Some causes, fitted. `gain`: fall of the loss against the null fit, `formulas` the part of it that causes had taken which are
    formulas and leave no form to correct; `score`: gain less what the freedom is worth."""

    terms: tuple[Term, ...]
    built: Extended
    problem: Problem
    fit: Fit
    gain: float
    formulas: float = 0.0

    def whole(self) -> Explanation:
        """With all derivatives."""
        return replace(self, fit=self.problem.complete(self.fit))

    @property
    def groups(self) -> tuple[Group, ...]:
        return tuple(dict.fromkeys(t.group for t in self.terms))

    @property
    def freedom(self) -> float:
        """What its numbers are worth in chi2."""
        return sum(cost(t.candidate) - COST * bool(t.own) for t in self.terms)

    @property
    def price(self) -> float:
        """And its causes."""
        return self.freedom + NEW * len(self.groups)

    @property
    def score(self) -> float:
        form = 0.0
        plain = len(self.terms) == len(self.groups) and all(kind in (*EXACT, *FORMULAS) for kind, _ in self.groups)
        slow = all(kind in (*EXACT, *DRIFTING) for kind, _ in self.groups)
        filtering = sum(t.candidate.kind == "hidden_resonance" for t in self.terms) > 1  # a second mass may be any form of the first
        if (not plain and not slow) or filtering:
            bent = self.gain - (0.0 if filtering else self.formulas)
            numbers = self.freedom / COST - sum(t.candidate.kind == "constant_force" for t in self.terms)  # see cost
            form = (FORM * numbers + LEAST * (len(self.groups) - 1)) * bent
        return self.gain - self.price - max(form, 0.0)


def rows(study: Study) -> float:
    """Chi2 that noise leaves."""
    return len(study.null.residual) * float(np.mean([np.mean(e.good) for e in study.experiments]))


def only_noise(study: Study, fit: Fit) -> bool:
    """Does a fit leave no more than noise? Of few chi2 it is, what a wrong form leaves is hundreds of deviations more."""
    return fit.chi2 < rows(study) + CHANCE * np.sqrt(2.0 * rows(study))


def exact(groups: Sequence[Group]) -> bool:
    """Are all of them formulas, that leave nothing of themselves to others?"""
    return all(kind in EXACT for kind, _ in groups)


def cost(c: Candidate) -> float:
    """What the freedom of an elementary law is worth in chi2."""
    if isinstance(c.what, tuple):
        return 4.0 * COST  # three numbers, found among hundreds of places in the spectrum
    own = 2.0 if c.kind == "constant_force" else 1.0  # where a bias explains as much, it is the bias
    return COST * (own + (len(c.what.shapes) if isinstance(c.what, Basis) else 0))


def loaded(e: Explanation) -> float:
    """What the loads of an explanation are at most, all together [N]: some that nearly cancel each other count in full."""
    return sum(abs(t.gain) for t in e.terms if t.candidate.kind == "constant_force")


def numbers(e: Explanation) -> int:
    """How many numbers are of its loads: a size each, and when and how long one grows."""
    return sum(1 + len(t.candidate.what.shapes) for t in e.terms if t.candidate.kind == "constant_force")


def weight(model: Model) -> float:
    """Weight of all bodies [N], inf without bodies. A larger load stands for a start in motion."""
    return constants.g * sum(model.parameters[b.mass].value for b in model.bodies) or np.inf


def related(groups: Sequence[Group]) -> set[str]:
    """All kinds that are of one curve with some groups, wherever."""
    own = {CURVES.get(kind, kind) for kind, _ in groups}
    return own | {kind for kind, its in CURVES.items() if its in own}


def curve(c: Candidate) -> tuple[str, object]:
    """The curve at a place, the fault of a sensor or the parameter that a candidate is about."""
    return CURVES.get(c.kind, c.kind), c.what.place if isinstance(c.what, Basis) else c.where


def distinct(found: Sequence[Explanation]) -> list[Explanation]:
    """The best explanation by each choice of causes, from best to worst."""
    best: dict[frozenset[Group], Explanation] = {}
    for e in sorted(found, key=lambda e: -e.score):
        best.setdefault(frozenset(e.groups), e)
    return list(best.values())


def spared(found: Sequence[Explanation]) -> list[Explanation]:
    """Explanations with the gain by formulas of those that have more causes beside the same: what a formula takes there leaves no form
    here either, and in which order causes came in does not count."""
    most = {frozenset(e.groups): max(o.formulas for o in found if set(e.groups) <= set(o.groups)) for e in found}
    return [replace(e, formulas=most[frozenset(e.groups)]) for e in found]


def unloaded(e: Explanation) -> frozenset[Group]:
    """Its causes but for a load or a bias."""
    return frozenset(g for g in e.groups if g[0] not in LOADS)


def level(found: Sequence[Explanation]) -> list[Explanation]:
    """Explanations with the same gain by formulas where all but a load or a bias is the same: one of these is no more a formula
    than the other."""
    beside = [unloaded(e) for e in found]
    most = {rest: max(e.formulas for e, own in zip(found, beside, strict=True) if own == rest) for rest in beside}
    return [replace(e, formulas=most[rest]) for e, rest in zip(found, beside, strict=True)]


def fault_of(c: Candidate) -> tuple[str, float] | None:
    """What a fault is, so that none comes twice; the size of a bend is the unit of its gain only."""
    return (c.what.what, 0.0 if c.what.what == "scale_bend" else c.what.shape) if isinstance(c.what, Fault) else None


def law_of(c: Candidate) -> str:
    return getattr(c.what, "law", "")


def missing(e: Explanation, group: Group) -> Fit:
    """The fit as it would be without a cause, to first order."""
    names = {f"{n}_" for t, n in zip(e.terms, e.built.names, strict=True) if t.group == group}
    shrinking = [("gap", "relaxation") if t.own else ("mass",) for t in e.terms]  # what goes to nothing with a cause
    sizes = {f"{n}_{key}" for n, keys in zip(e.built.names, shrinking, strict=True) for key in keys}
    faults = [t.candidate.what for t in e.terms if t.group == group and isinstance(t.candidate.what, Fault)]
    own = []
    for i, f in enumerate(e.fit.free):
        if isinstance(f.target, str):
            own += [i] if f.target == group_parameter(e, group) or any(f.target.startswith(n) for n in names) else []
        elif f.target[0] in VALUED:
            own += [i] if any(f.target == (x.what, x.sensor) for x in faults) else []
        elif f.target[0] == "fault":
            own += [i] if e.built.faults[f.target[1]] in faults else []
    effect = np.zeros(len(e.fit.residual))
    for i in own:
        f = e.fit.free[i]
        if f.log:
            effect += e.fit.jacobian[:, i] if f.target in sizes else 0.0
        else:
            effect += e.fit.jacobian[:, i] * (f.value - f.origin) / f.unit
    rest = [i for i in range(len(e.fit.free)) if i not in own]
    return replace(
        e.fit, free=tuple(e.fit.free[i] for i in rest), residual=e.fit.residual + effect, jacobian=e.fit.jacobian[:, rest], whole=False
    )


def group_parameter(e: Explanation, group: Group) -> str:
    """The parameter of the model that a cause is about, if it is about one."""
    return group[1] if group[0] == "wrong_parameter" else ""
