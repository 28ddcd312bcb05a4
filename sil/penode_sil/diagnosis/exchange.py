# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Causes exchanged for others, or left out: the first one found may have stood in for another."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .build import Term
from .explaining import explain, heavy, settled
from .explanation import LOADS, Explanation, Group, cost, distinct, missing
from .pursuit import group_of, pools, pursue, terms_of
from .refining import refined
from .score import DAMPINGS, Regression
from .singles import rigid
from .study import Study, regression
from .textbook import CLOSE

RIVAL = 0.8  # of a cause's worth: what another must explain of it to be tried in its place
MAX_LOSS = 0.3  # of all that was gained: an explanation that gains less by that is not gone on with
SMALL = 0.03  # of all that was gained: a cause worth less than that may be a remainder of another
MASS_FREQUENCIES = (8.0, 16.0, 30.0)  # [Hz] frequencies to begin with of a mass that may be on a spring


def ranked(study: Study, best: Explanation, others: Sequence[Explanation], log) -> list[Explanation]:
    """Explanations from best to worst, with those that differ from the best one by the like of a load or a bias."""
    alike = equals(study, best, log)
    swapped = max([best, *alike], key=lambda e: e.score)
    return [best, *others, *alike] if swapped is best else [settled(study, swapped), best, *others, *alike]


def exchanged(study: Study, e: Explanation, parameters: Sequence[str], log) -> list[Explanation]:
    """Explanations with one cause of `e` exchanged for another: the first one found may have stood in for it."""
    e = e.whole()
    r = regression(study, e.fit, parameters)
    found: list[Explanation] = []
    for group in e.groups:
        without = r.without(missing(e, group))
        worth = without.chi2 - r.chi2
        kept = [t for t in e.terms if t.group != group]
        if worth < SMALL * e.gain:  # it may have stood in for what another cause can do by itself
            alone = explain(study, kept, start=e.fit, formulas=e.formulas)
            if alone.gain > (1.0 - MAX_LOSS) * e.gain:
                alone = refined(study, alone, parameters)
            found.append(alone)
            log(f"  without {group}: {alone.gain:.0f} for {e.gain:.0f}, x{len(alone.terms)}")
        ranked = []
        for other, pool in pools(r).items():
            if other not in e.groups:
                gain, chosen = pursue(without, pool)
                if chosen and gain > RIVAL * worth:
                    ranked.append((gain - sum(cost(r.candidates[c]) for c in chosen), chosen))
        best = sorted(ranked, key=lambda x: -x[0])[: 1 if heavy(e) else 2]
        ways = [terms_of(without, chosen) for _, chosen in best]
        ways.append(rigid(study, [t for t in e.terms if t.group == group]))
        for new in [*filter(None, ways), *sprung(study, e, r, group)]:
            found.append(explain(study, [*kept, *new], start=e.fit, formulas=e.formulas))
            log(f"  {group} for {found[-1].groups[-1]}: {found[-1].gain:.0f}")
    close = [x for x in found if set(x.groups) != set(e.groups) and x.gain > (1.0 - CLOSE) * e.gain]
    for other in distinct(close)[:2]:
        found.append(refined(study, other, parameters))
        log(f"  refined {found[-1].groups} x{len(found[-1].terms)}: {found[-1].gain:.0f}")
    return found


def sprung(study: Study, e: Explanation, r: Regression, group: Group) -> list[list[Term]]:
    """What a mass that is too small may be instead: the rest of it on a spring, which moves along at frequencies below its own."""
    model = study.model
    body = next((b.name for b in model.bodies if group == ("wrong_parameter", b.mass)), "")
    more = e.fit.value(group[1]) - model.parameters[group[1]].value if body else 0.0
    masses = [c for c in r.candidates if c.kind == "hidden_resonance" and c.where == body]
    if more <= 0.0 or not masses:
        return []
    nearest = [min(masses, key=lambda c: abs(np.log(c.what[2] / f)) + abs(np.log(c.what[3] / DAMPINGS[1]))) for f in MASS_FREQUENCIES]
    return [[Term(c, more)] for c in nearest]


def lightened(study: Study, e: Explanation, log) -> list[Explanation]:
    """Explanations with one of three causes or more left out: one that stood in for a cause found later is not needed."""
    fewer = [[t for t in e.terms if t.group != group] for group in e.groups] if len(e.groups) > 2 else []
    found = [explain(study, terms, start=e.fit, formulas=e.formulas) for terms in fewer]
    for less in found:
        log(f"  only {less.groups}: {less.gain:.0f} for {e.gain:.0f}")
    return found


def equals(study: Study, e: Explanation, log) -> list[Explanation]:
    """The explanation with a load or a bias exchanged for the one of its like that does about as well, however it grows."""
    loads = [g for g in e.groups if g[0] in LOADS]
    if not loads:
        return []
    e = e.whole()
    r = regression(study, e.fit, [f.target for f in study.null.free if isinstance(f.target, str)], LOADS)
    found = []
    for group in loads:
        without = r.without(missing(e, group))
        alike = [k for k, c in enumerate(r.candidates) if c.kind in LOADS and (c.kind, c.where) not in e.groups]
        _, first = pursue(without, alike, terms=1)
        gain, chosen = pursue(without, pools(without)[group_of(without, first)]) if first else (0.0, [])
        if chosen and gain > RIVAL * (without.chi2 - r.chi2):
            kept = [t for t in e.terms if t.group != group]
            found.append(explain(study, [*kept, *terms_of(without, chosen)], start=e.fit, formulas=e.formulas))
            log(f"  {group} as {found[-1].groups[-1]}: {found[-1].gain:.0f} for {e.gain:.0f}")
    return found
