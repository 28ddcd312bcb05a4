# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which candidates of a regression belong to a cause: a kind takes up to TERMS elementary laws, and another kind comes in only by what no
curve of the first one's family at the same place could do."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from .build import Term
from .explanation import CURVES, FORMULAS, LEAST, NEW, Explanation, Group, cost, curve, exact, law_of
from .hypotheses import Basis
from .score import Candidate, Regression
from .study import Study

TERMS = 3  # elementary laws of one kind
DRIFTING = 5  # and of a bias, which may have any slow course
OCTAVE = 2.0  # factor of frequency, within which another form of a hidden mass is seen
PART = 0.1  # of the size a law has alone: left to it where its companions do the rest


def pools(r: Regression) -> dict[Group, list[int]]:
    """The candidates of each kind and place."""
    found: dict[Group, list[int]] = {}
    for k, c in enumerate(r.candidates):
        found.setdefault((c.kind, c.where), []).append(k)
    return found


def room(kind: str) -> int:
    """How many elementary laws a kind may take at first."""
    return DRIFTING if kind == "sensor_bias" else TERMS


def pursue(r: Regression, pool: Sequence[int], base: Sequence[int] = (), terms: int = TERMS, alone: bool = True) -> tuple[float, list[int]]:
    """Gain and choice of up to `terms` candidates of a pool beside `base`, the best next one at a time; not `alone`: beside others of
    their kind, so the first may be a companion."""
    chosen: list[int] = []
    costs = {p: cost(r.candidates[p]) for p in pool}
    gain = start = r.gain(base)[0] if base else 0.0
    while len(chosen) < (room(r.candidates[chosen[0]].kind) if chosen and terms == TERMS else terms):
        usable = [p for p in pool if p not in chosen and (chosen or not alone or not r.candidates[p].companion)]
        if chosen and r.candidates[chosen[0]].kind == "hidden_resonance":
            break  # one mass; a second would be any filter
        _step, best = r.best_single([*base, *chosen], usable, costs)
        if best < 0:
            break
        new = r.gain([*base, *chosen, best])[0]
        enough = 2e-3 * (gain - start) if chosen and r.candidates[chosen[0]].kind != "sensor_bias" else 0.0  # which is of no form
        if new - gain < max(costs[best], enough):
            break
        gain, chosen = new, [*chosen, best]
    return gain - start, chosen


def pair(r: Regression) -> tuple[float, list[int]]:
    """Worth and choice of the best two causes that are formulas: a curve may look like both together."""
    plain = [k for k, c in enumerate(r.candidates) if c.kind in FORMULAS and not c.companion and r.alive[k]]
    worth = {k: r.gain([k])[0] - cost(r.candidates[k]) for k in plain}
    plain = [k for k in plain if worth[k] > 0.0]
    best = 0.0, []
    for i, k in enumerate(plain):
        for j in plain[:i]:
            if (r.candidates[k].kind, r.candidates[k].where) != (r.candidates[j].kind, r.candidates[j].where):
                found = r.gain([j, k])[0] - sum(cost(r.candidates[x]) for x in (j, k)) - 2.0 * NEW
                if found > max(best[0], worth[j], worth[k]):
                    best = found, [j, k]
    return best


def elsewhere(r: Regression, group: Group, chosen: Sequence[int]) -> list[int]:
    """The best choice of one law of a kind that is none of those chosen: another one to begin with."""
    failed = {law_of(r.candidates[k]) for k in chosen}
    return pursue(r, [k for k in pools(r)[group] if law_of(r.candidates[k]) not in failed], terms=1)[1]


def strongest(r: Regression, groups: Collection[Group]) -> list[int]:
    """The choice of another kind than some that takes most, whether or not these could take it as well."""
    found = [pursue(r, pool) for group, pool in pools(r).items() if group not in groups]
    return max(found, key=lambda x: x[0] - sum(cost(r.candidates[c]) for c in x[1]), default=(0.0, []))[1]


def family(study: Study, r: Regression, groups: Sequence[Group]) -> list[int]:
    """All candidates that are of one curve, or one fault of a sensor, with some groups."""
    places = {(c.kind, c.where): c.what.place for c in r.candidates if isinstance(c.what, Basis)}
    own = {(CURVES.get(g[0], g[0]), places.get(g, g[1])) for g in groups}
    return [k for k, c in enumerate(r.candidates) if curve(c) in own]


def resembles(e: Explanation, c: Candidate) -> bool:
    """May what another form of a cause of `e` does look like this candidate of its family? A hidden mass only near its frequency: at
    all of them, masses do what any filter can."""
    if c.kind != "hidden_resonance":
        return True
    own = [t.candidate.what[2] for t in e.terms if t.group == (c.kind, c.where)]
    return any(f / OCTAVE < c.what[2] < OCTAVE * f for f in own)


def further(study: Study, e: Explanation, r: Regression) -> list[list[int]]:
    """Choices of one more kind by the part that no curve of the causes so far can explain, from best to worst."""
    taken = [k for k in family(study, r, e.groups) if resembles(e, r.candidates[k])]
    rest, related = r.beside(taken), set(taken)
    least = 0.0 if exact(e.groups) else LEAST * e.gain
    found = []
    for pool in pools(r).values():
        if related.isdisjoint(pool):
            gain, chosen = pursue(rest, pool, terms=2)
            price = sum(cost(r.candidates[c]) for c in chosen)
            if chosen and gain > max(NEW + price, least):
                found.append((gain - price, chosen))
    return [chosen for _, chosen in sorted(found, key=lambda x: -x[0])]


def terms_of(r: Regression, chosen: Sequence[int]) -> list[Term]:
    """The chosen candidates with the sizes that the regression gives them. Where only companions are left, the first of the others
    keeps a part of its gain alone; none if that is zero."""
    _, gains = r.gain(chosen)
    alone = [c for c in chosen if not r.candidates[c].companion][:1]
    if all(g == 0.0 or r.candidates[c].companion for c, g in zip(chosen, gains, strict=True)):
        small = PART * r.gain(alone)[1] if alone else np.zeros(1)
        gains = np.where([c in alone for c in chosen], small, gains) if small[0] else np.zeros(len(chosen))
    return [Term(r.candidates[c], float(g)) for c, g in zip(chosen, gains, strict=True) if g != 0.0]


def group_of(r: Regression, chosen: Sequence[int]) -> Group:
    return r.candidates[chosen[0]].kind, r.candidates[chosen[0]].where
