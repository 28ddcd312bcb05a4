# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An accepted form in the bench: its laws as terms of their own, its edges as steep as the recordings show them."""

from __future__ import annotations

from dataclasses import replace

from ..evidence.bench import Bench
from ..evidence.observer import MOST_STEPS
from ..evidence.screening import Probe
from ..study.fit import Free
from .propose import FOLLOWED, PROMISE, motions
from .terms import Term, Trial, with_forms


def adopt(bench: Bench, t: Trial, number: int) -> tuple[Bench, list[Term]]:
    """The bench with a trial's form in its model, and the terms that the form becomes there, one for each kind of law. Takes over the
    trial's values for parameters that the bench has, and ignores the others. `number` makes the form's parameter names the same in every
    bench."""
    moved = motions(Probe.of(bench))
    model, (term,) = with_forms(bench, [t.form], moved, 90 + number)  # forms that are only tried have the number of their round, far below
    names = dict(zip([f.target for f in t.term.free], term.free, strict=True))
    own = {f.target: f for f in bench.fit.free}
    fitted = [
        replace(f, target=names[f.target].target) if f.target in names else f for f in t.fit.free if f.target in own or f.target in names
    ]
    free = (
        *fitted,
        *(f for f in own.values() if f.target not in {x.target for x in fitted}),
    )  # the bench may have parameters that the trial did not fit
    fresh = replace(bench, model=model, free=free, level=t.level)
    problem = fresh.problem()
    fresh = replace(fresh, fit=problem.solve(free, t.fit.by.cut(len(bench.model.states)).padded(len(model.states)), FOLLOWED))
    fresh, term = loosened(steepened(fresh, term), term)
    return fresh, apart(term)


def steepened(bench: Bench, term: Term) -> Bench:
    """Halves the width of a term's edges for as long as each halving gains PROMISE. The integration step is halved too, because a steeper
    edge is stiffer. Later fits pay for these steps, so it stops where there would be more of them, and more than MOST_STEPS."""
    edges = {f"{name}_{part.edge}" for name, part in zip(term.elements, term.form.parts, strict=True) if part.edge}
    for _ in range(8 if edges else 0):  # down to 1e-4 of the rms rate: no plant turns faster
        free = tuple(replace(f, value=0.5 * f.value, low=0.5 * f.low) if f.target in edges else f for f in bench.fit.free)
        finer = replace(bench, fastest=2.0 * bench.fastest)
        problem = finer.problem()
        if problem.predictor.steps > MOST_STEPS and problem.predictor.steps > bench.problem().predictor.steps:
            break
        fit = problem.solve(free, bench.fit.by, FOLLOWED)
        if not fit.cost > bench.fit.cost + PROMISE:
            break
        bench = replace(finer, free=fit.free, fit=fit)
    return bench


def loosened(bench: Bench, term: Term) -> tuple[Bench, Term]:
    """Fits what a term's laws leave to be fitted later, where that gains PROMISE."""
    more = []
    for name, part in zip(term.elements, term.form.parts, strict=True):
        for key, factor in part.later.items():
            x = part.shapes[key][0]
            more.append(Free(f"{name}_{key}", x, x, log=True, sigma=1.0, origin=x, low=x / factor, high=x * factor))
    fit = bench.problem().solve((*bench.fit.free, *more), bench.fit.by, FOLLOWED) if more else bench.fit
    if not fit.cost > bench.fit.cost + PROMISE:
        return bench, term
    return replace(bench, free=fit.free, fit=fit), replace(term, free=(*term.free, *more))


def apart(term: Term) -> list[Term]:
    """Splits a term into one term for each kind of law in it, that of the form first."""
    if len(term.form.kinds) == 1:
        return [term]
    found = []
    for kind in term.form.kinds:
        own = [(n, p) for n, p in zip(term.elements, term.form.parts, strict=True) if (p.kind or term.form.kind) == kind]
        names = tuple(n for n, _ in own)
        form = replace(term.form, kind=kind, parts=tuple(p for _, p in own), note="")
        found.append(Term(form, names, tuple(f for f in term.free if any(str(f.target).startswith(f"{n}_") for n in names))))
    return found
