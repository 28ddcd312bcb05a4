# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Explanations by one kind of cause, with which a search begins."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .build import Term
from .explaining import explain, gains
from .explanation import COST, NEW, Explanation, Group, cost, distinct, law_of
from .pursuit import elsewhere, pair, pools, pursue, terms_of
from .score import RESONANCES, Candidate, Regression
from .study import Study
from .textbook import softened, whole

KEPT = 0.5  # of the gain that a regression predicts: a fit that reaches less has started in the wrong place
STIFF = 1.5  # of the highest frequency of hidden masses: one that a fit has taken beyond it moves with its body


def singles(study: Study, r: Regression, few: int = 3) -> list[Explanation]:
    """The best explanations by one kind, fitted."""
    ranked = []
    for group, pool in pools(r).items():
        gain, chosen = pursue(r, pool)
        if chosen:
            ranked.append((gain - sum(cost(r.candidates[c]) for c in chosen) - NEW, group, chosen))
    ranked = sorted((x for x in ranked if x[0] > 0.0), key=lambda x: -x[0])
    if not ranked:
        return []
    best = ranked[0][0]
    taken = [x for x in ranked if x[0] > 0.5 * best - NEW][:few]
    known = [x for x in ranked if x[1][0] == "network_extrapolation" and x[0] > 0.2 * best]  # to happen, of its motion
    taken += [x for x in known if x not in taken]
    choices = [chosen for _, _, chosen in taken]
    worth, both = pair(r)
    if worth > 0.7 * best:
        choices.append(both)
    ways = [terms_of(r, chosen) for chosen in choices]
    ways += [in_series(study, r, group) for _, group, _ in taken]
    found = []
    for k, terms in enumerate(ways):
        if terms:
            found.append(explain(study, terms))
            kept = study.null.cost - found[-1].fit.cost
            if k < len(taken) and kept < KEPT * r.gain(choices[k])[0] and (other := terms_of(r, elsewhere(r, taken[k][1], choices[k]))):
                found.append(explain(study, other))
    found += [explain(study, [needed], start=e.fit) for e in found for needed in (*sufficient(study, e), *rigid(study, e.terms))]
    found += [explain(study, poled) for e in found if (poled := through_a_pole(r, e))]
    return distinct([softened(study, e) for e in found if e.groups])


def sufficient(study: Study, e: Explanation) -> list[Term]:
    """Of two causes with one number each, those that make the other one worth less than it costs: a regression may have asked for
    two parameters in place of one that is far off."""
    if len(e.terms) != 2 or len(e.groups) != 2:
        return []
    variance, index = np.diag(e.fit.covariance()), {f.target: i for i, f in enumerate(e.fit.free)}
    found = []
    for other, target in zip(e.terms[::-1], gains(e.terms, e.built.names), strict=True):
        f = e.fit.free[index[target]]
        nominal = study.model.parameters[target].value if target in study.model.parameters else 0.0
        if ((f.value - nominal) / f.unit) ** 2 < (NEW + COST) * variance[index[target]]:
            found.append(other)
    return found


def rigid(study: Study, terms: Sequence[Term]) -> list[Term]:
    """The parameter of a body in place of a hidden mass alone, whose spring or damper does not give way: together they are a heavier
    body."""
    if len(terms) != 1 or terms[0].candidate.kind != "hidden_resonance":
        return []
    _, _, frequency, damping = terms[0].candidate.what
    if max(1.0, 2.0 * damping) * frequency < STIFF * RESONANCES[-1]:
        return []
    mass = next(b.mass for b in study.model.bodies if b.name == terms[0].candidate.where)
    return [Term(Candidate("wrong_parameter", mass, 0, False, mass), 0.0)] if study.model.parameters[mass].tolerance > 0.0 else []


def through_a_pole(r: Regression, e: Explanation) -> list[Term]:
    """A dead time as late through one pole: where that is slower than the signal, no small step leads from one to the other."""
    if len(e.terms) != 1 or e.groups[0][0] != "sensor_delay":
        return []
    [late] = e.terms
    rolled = [c for c in r.candidates if (c.kind, c.where) == e.groups[0] and getattr(c.what, "what", "") == "roll_off"]
    return [late, *(Term(c, 0.45 * late.gain**2) for c in rolled)]


def in_series(study: Study, r: Regression, group: Group) -> list[Term]:
    """A spring or a play in series with all of a damper; none if that is not of the group. With a damping of its own,
    many values of the rest do about as well, and a fit may end in the wrong ones."""
    pool = [k for k in pools(r)[group] if law_of(r.candidates[k]) == "loose_damper"]
    _, best = r.best_single([], pool, dict.fromkeys(pool, 0.0))
    terms = terms_of(r, [best]) if best >= 0 else []
    return [tied for tied in (whole(study, t) for t in terms) if tied]
