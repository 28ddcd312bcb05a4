# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From terms to an explanation: fits by simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .build import Extended, Term, all_free, extended
from .explanation import Explanation, rows
from .fit import Fit, Problem
from .hypotheses import VALUED, Basis, Fault
from .naming import with_kinds
from .study import Study, loss

CLOSED = 1e-4  # of the possible gain: a fit that gains less in an iteration is good enough for a comparison
# steps for all derivatives: where it takes more, only the best explanation is gone on with, and with one rival of a cause; and one law
# mends its form
HEAVY = 2e6
ROUGH = 5e5  # the same: where it takes more, fits begin with longer steps


def explain(study: Study, terms: Sequence[Term], iterations: int = 12, start: Fit | None = None, formulas: float = 0.0) -> Explanation:
    """Fit some terms by simulation, with everything else from where a fit has left it. What ends without force is left out."""
    recordings = len(study.experiments)
    built = extended(study.model, study.places, terms, recordings if study.moving else 0, recordings)
    problem = Problem(built.model, study.experiments, study.metrics, study.set_name, study.linear.fastest, built.faults)
    values = {f.target: f.value for f in (start or study.null).free}
    free = [
        replace(f, value=values.get(f.target, f.value)) if i < len(study.null.free) else f
        for i, f in enumerate(all_free(study.null.free, built))
    ]
    known = start if start is not None and start.whole and start.metrics is study.metrics else study.null
    columns = {f.target: column for f, column in zip(known.free, known.jacobian.T, strict=True)}
    near = {i: columns[f.target] for i, f in enumerate(study.null.free) if f.target in columns and f.target not in built.loosened}
    most = rows(study) * np.log(max(study.null.cost / rows(study), 1.0))  # that noise of one level could gain by being as quiet as it may
    close = max(CLOSED * most, 0.5)
    if len(free) * problem.steps > ROUGH and problem.rough is not None:
        free = problem.rough.solve(problem.rough.eased(free), iterations, close, near).free
    else:
        free = problem.eased(free)
    fit = problem.solve(free, iterations, close, near)
    gain = study.nothing - loss(study, fit) if np.isfinite(fit.cost) else -np.inf
    found = fitted(terms, built, fit)
    if len(acting(found)) < len(found):
        return explain(study, acting(found), 2, fit, formulas)
    return Explanation(with_kinds(found, built.names, fit, study), built, problem, fit, gain, formulas)


def acting(terms: Sequence[Term]) -> list[Term]:
    """The terms that have a force, and those that companions with one need to be a cause."""
    forceful = [t for t in terms if t.gain != 0.0 or not isinstance(t.candidate.what, Basis)]
    led = {t.group for t in forceful if not t.candidate.companion}
    bare = {t.group for t in forceful} - led
    return [t for t in terms if t in forceful or (t.group in bare and not t.candidate.companion)]


def gains(terms: Sequence[Term], names: Sequence[str]) -> list[str | tuple[str, int]]:
    """What is free as the gain of each term."""
    found: list[str | tuple[str, int]] = []
    faults = 0
    for term, name in zip(terms, names, strict=True):
        what = term.candidate.what
        if isinstance(what, Basis):
            found.append(term.own or f"{name}_{what.gain[0]}")
        elif isinstance(what, Fault):
            series = what.what not in VALUED
            found.append(("fault", faults) if series else (what.what, what.sensor))
            faults += series
        else:
            found.append(what if isinstance(what, str) else f"{name}_mass")
    return found


def fitted(terms: Sequence[Term], built: Extended, fit: Fit) -> list[Term]:
    """The terms with gains and shapes where the fit left them."""
    values = {name: p.value for name, p in built.model.parameters.items()} | {f.target: f.value for f in fit.free}
    found = []
    for term, name, target in zip(terms, built.names, gains(terms, built.names), strict=True):
        what, gain, bend = term.candidate.what, values[target], 0.0
        if isinstance(what, Basis):
            what = replace(what, shapes={k: (values[f"{name}_{k}"], u) for k, (_, u) in what.shapes.items()})
        elif isinstance(what, tuple):
            k, d = (values[f"{name}_{key}"] for key in ("stiffness", "damping"))
            w = np.sqrt(k / gain)
            what, bend = (what[0], what[1], w / (2 * np.pi), d / (2 * w * gain)), values[f"{name}_cubic"]
        found.append(replace(term, candidate=replace(term.candidate, what=what), gain=gain, bend=bend))
    return found


def heavy(e: Explanation) -> bool:
    """Do its derivatives take so many steps that the search has to be narrow to end in time?"""
    return len(e.fit.free) * e.problem.steps > HEAVY


def settled(study: Study, e: Explanation) -> Explanation:
    """The explanation fitted to the end in the noise of the study."""
    free = [replace(f, value=v.value) for f, v in zip(all_free(study.null.free, e.built), e.fit.free, strict=True)]
    problem = Problem(e.built.model, study.experiments, study.metrics, study.set_name, study.linear.fastest, e.built.faults)
    return replace(e, problem=problem, fit=problem.solve(free))
