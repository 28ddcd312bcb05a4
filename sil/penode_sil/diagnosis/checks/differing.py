# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Before a search: is each recording of a study explained by a value of its own of one parameter, and by no common one?"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from penode_gen import units
from penode_gen.model import Parameter

from ..catalogue import others
from ..extend import measuring
from ..extend.entries import table, toml, unlike
from ..reliability import trust
from ..result import Cause, Diagnosis, Value
from ..search.worth import Z_95
from ..study.fit import Fit, Free, Problem
from ..study.noise import UNSEEN
from ..study.residual import stated_noise
from ..study.restoring import rms
from ..study.study import Study, look
from . import numerics
from .case import Case, End
from .leftover import CHANCE, chi2, rows
from .values import entry
from .written import heading, write_extended


@dataclass(frozen=True, eq=False)
class Own:
    """A parameter with a value for each recording, and the fit in which it has."""

    name: str
    fit: Fit

    def values(self) -> list[tuple[float, float]]:
        """Value and standard deviation in each recording."""
        at = [i for i, f in enumerate(self.fit.free) if f.target[0] == "own"]
        sd = np.sqrt(np.maximum(np.diag(self.fit.covariance())[at], 0.0))
        return [(self.fit.free[i].value, abs(self.fit.free[i].value) * float(s)) for i, s in zip(at, sd, strict=True)]

    def differs(self) -> bool:
        """Are two of its values surely not the same?"""
        found = self.values()
        return any(abs(a - b) > CHANCE * float(np.hypot(x, y)) for a, x in found for b, y in found)


def different(case: Case, study: Study, searched: Callable[[], End]) -> End | None:
    """The end of a diagnosis of recordings that differ by a parameter, and by nothing else: with it all sensors are within their noise, and
    with a common value of it, whatever that is, they are not; nor is there a common cause (see `common`) in the end of the search."""
    count, noise = len(study.experiments), stated_noise(study)
    if count == 1 or study.model.networks or not _missed(study, study.null, noise):
        return None
    if any(_beyond(study, k, noise) for k in range(count)):
        return None
    problem = Problem(study.model, study.experiments, study.metrics, study.set_name, study.linear.fastest)
    good: list[Own] = []
    for p in study.model.parameters.values():
        if p.exact or not p.value:
            continue
        others = [f for f in study.null.free if f.target != p.name]
        own = [Free(("own", e, p.name), p.value, abs(p.value), log=True, origin=p.value) for e in range(count)]
        found = Own(p.name, problem.solve([*others, *own]))
        if _missed(study, found.fit, noise) or not found.differs():
            continue
        if not _missed(study, problem.solve([*others, _free(p)]), noise):
            return None
        good.append(found)
    good.sort(key=lambda x: x.fit.cost)
    return _end(case, study, good) if good and not common(study, searched(), good[0].fit) else None


def common(study: Study, end: End, fit: Fit) -> bool:
    """Does the one cause that a search names, with the same values in all recordings, leave less than a fit with values of their own? A
    damper that is not linear has another best value at another amplitude."""
    if len(end.answer.causes) != 1 or end.answer.verdict == "unexplained" or end.fit is None:
        return False
    return chi2(study, end.fit.simulated) < fit.cost


def _beyond(study: Study, k: int, noise: np.ndarray) -> bool:
    """Is recording k beyond the model, whatever the values of its parameters are?"""
    one = replace(study, experiments=study.experiments[k : k + 1])
    problem = Problem(study.model, one.experiments, study.metrics[k : k + 1], study.set_name, study.linear.fastest)
    starts = [f.alone(k) for f in study.null.free if f.of("start", k)]
    free = [_free(p) for p in study.model.parameters.values() if not p.exact and p.value]
    return _missed(one, problem.solve([*free, *starts]), noise)


def _free(p: Parameter) -> Free:
    """A parameter of any size, of its own sign."""
    return Free(p.name, p.value, abs(p.value), log=True, sigma=abs(p.value), origin=p.value)


def _missed(study: Study, fit: Fit, noise: np.ndarray) -> bool:
    """Is a sensor of a recording off by more than its noise?"""
    return any(
        not rms((e.y - z)[e.good[:, j], j]) <= UNSEEN * level
        for e, z in zip(study.experiments, fit.simulated, strict=True)
        for j, level in enumerate(noise)
        if e.good[:, j].any()
    )


def _end(case: Case, study: Study, good: Sequence[Own]) -> End:
    """The answer with the best of them; the others are its alternatives where they are as good."""
    best = good[0]
    p, sets = study.model.parameters[best.name], _sets(study)
    values = {
        s: Value(v, units.si(p.unit), (v - Z_95 * sd, v + Z_95 * sd)) for s, (v, sd) in zip(sets.values(), best.values(), strict=True)
    }
    alike = [x.name for x in good[1:] if x.fit.cost - best.fit.cost < CHANCE * CHANCE]
    seen = replace(study, model=case.model, seen=look(study, study.null))
    noise = rows(study)
    taken = min((study.null.cost - best.fit.cost) / max(study.null.cost - noise, 1.0), 1.0)
    cause = others.differing(best.name, values, trust(taken) / (1 + len(alike)), alike)
    extended = write_extended(_text(case, cause, best, sets), case)
    gain, notes, held = measuring.measure(seen, extended, case.unused) if case.unused else ({}, [], [])
    evidence = (study.null.cost - noise) / float(np.sqrt(2.0 * noise))
    sure = ({"causes": [{"kind": cause.kind, "where": best.name}], "posterior": cause.confidence},)
    notes = [*case.remarks, *notes, f"each recording has a parameter set of its own in the extended model: {', '.join(sets.values())}"]
    found = numerics.numerics(seen)[0]
    answer = Diagnosis("explained", (cause,), gain, found, taken, evidence, 0.0, tuple(notes), explanations=sure)
    return End(answer, seen, extended, best.fit, held, sets=sets)


def _sets(study: Study) -> dict[str, str]:
    """Names of parameter sets by those of recordings."""
    found: dict[str, str] = {}
    for e in study.experiments:
        stem = re.sub(r"\W", "_", e.name.rsplit(".", 1)[0]).lower()
        found[e.name] = unlike(f"of_{stem}", found.values())  # by itself it might be a word of the C
    return found


def _text(case: Case, cause: Cause, best: Own, sets: dict[str, str]) -> str:
    """The model file with the common fitted parameters, and a set for each recording."""
    model, p = case.model, case.model.parameters[best.name]
    per = units.factor(p.unit)
    lines = [*heading(model, f"{cause.kind} at {best.name}"), f"{best.name} = {table(entry(p, p.value) | {'tunable': True})}"]
    for f in best.fit.free:
        known = model.parameters.get(f.target) if isinstance(f.target, str) else None
        if known is not None and f.value != known.value:
            lines.append(f"{f.target} = {table(entry(known, f.value))}")
    lines += ["", "[sets.default]", ""] if "default" not in model.sets or not model.sets["default"].parameters else [""]
    for name, (value, _) in zip(sets.values(), best.values(), strict=True):
        lines += [f"[sets.{name}]", f"{best.name} = {toml(f'{value / per:.7g} {p.unit}')}", ""]
    return "\n".join(lines)
