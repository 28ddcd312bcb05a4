# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which causes: a search that scores all hypotheses at once (score), fits the best few by simulation, and looks again.

A kind takes up to TERMS elementary laws before another kind may come in; what a further kind adds must be worth more than
chance (COST) and more than the first kind's form may be wrong by (SHARE).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .build import Extended, Term, all_free, extended
from .fit import Fit, Problem
from .hypotheses import Basis, Fault
from .score import Candidate, Regression
from .study import Study, regression, requieted

TERMS = 3  # elementary laws of one kind
COST = 10.0  # chi2 that an elementary law must gain for each of its numbers, and the choice among many
NEW = 50.0  # chi2 that a further kind must gain beyond that
SHARE = 0.02  # of what has been gained: forms are wrong by about as much
LEAST = 0.004  # of what has been gained: less is a matter of form in any case
MOST = 0.6  # of what was left: what a further kind may also take to be believed
FORM = 7e-4  # of what has been gained: a number more must gain that, or it only mends the form
Group = tuple[str, str]


@dataclass(frozen=True, eq=False)
class Explanation:
    """Some causes, fitted. `gain`: fall of the cost against the null fit; `score`: less what its freedom is worth."""

    terms: tuple[Term, ...]
    built: Extended
    fit: Fit
    gain: float

    @property
    def groups(self) -> tuple[Group, ...]:
        return tuple(dict.fromkeys(t.group for t in self.terms))

    @property
    def left(self) -> float:
        """Cost beyond what noise makes."""
        return self.fit.cost - len(self.fit.residual)

    @property
    def score(self) -> float:
        freedom = sum(cost(t.candidate) for t in self.terms)
        return self.gain - freedom - NEW * len(self.groups) - FORM * max(self.gain, 0.0) * freedom / COST


def cost(c: Candidate) -> float:
    """What the freedom of an elementary law is worth in chi2."""
    if isinstance(c.what, tuple):
        return 4.0 * COST  # three numbers, found among hundreds of places in the spectrum
    return COST * (1 + len(c.what.shapes) if isinstance(c.what, Basis) else 1)


def pools(r: Regression) -> dict[Group, list[int]]:
    """The candidates of each kind and place."""
    found: dict[Group, list[int]] = {}
    for k, c in enumerate(r.candidates):
        found.setdefault((c.kind, c.where), []).append(k)
    return found


def pursue(r: Regression, pool: Sequence[int], base: Sequence[int] = (), terms: int = TERMS) -> tuple[float, list[int]]:
    """Gain and choice of up to `terms` candidates of a pool beside `base`, the best next one at a time."""
    chosen: list[int] = []
    costs = {p: cost(r.candidates[p]) for p in pool}
    gain = start = r.gain(base)[0] if base else 0.0
    for _ in range(terms):
        usable = [p for p in pool if p not in chosen and (chosen or not r.candidates[p].companion)]
        if chosen and r.candidates[chosen[0]].kind == "hidden_resonance":
            break  # one mass; a second would be any filter
        step, best = r.best_single([*base, *chosen], usable, costs)
        if best < 0:
            break
        new = r.gain([*base, *chosen, best])[0]
        if new - gain < max(costs[best], 2e-3 * (gain - start) if chosen else 0.0):
            break
        gain, chosen = new, [*chosen, best]
    return gain - start, chosen


def explain(study: Study, terms: Sequence[Term], iterations: int = 10) -> Explanation:
    """Fit some terms by simulation."""
    recordings = len(study.experiments)
    built = extended(study.model, study.places, terms, recordings if study.moving else 0, recordings)
    problem = Problem(built.model, study.experiments, study.metrics, study.set_name, study.linear.fastest, built.faults)
    fit = problem.solve(problem.eased(all_free(study.null.free, built)), iterations)
    return Explanation(tuple(terms), built, fit, study.null.cost - fit.cost if np.isfinite(fit.cost) else -np.inf)


def singles(study: Study, r: Regression, few: int = 4) -> list[Explanation]:
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
    found = []
    for _, group, chosen in taken:
        _, gains = r.gain(chosen)
        terms = [Term(r.candidates[c], float(g)) for c, g in zip(chosen, gains) if g != 0.0]
        found.append(explain(study, terms))
    return sorted(found, key=lambda e: -e.score)


def refine(study: Study, e: Explanation, r: Regression, parameters: Sequence[str]) -> tuple[Explanation, Regression]:
    """Give each kind of an explanation more elementary laws, as long as they earn their cost."""
    for _ in range(2):
        best = None
        for group in e.groups:
            if sum(t.group == group for t in e.terms) < TERMS + 1:
                gain, chosen = pursue(r, pools(r).get(group, []), terms=1)
                if chosen and gain > max(cost(r.candidates[chosen[0]]), 2e-3 * e.gain) and (best is None or gain > best[0]):
                    best = gain, chosen[0], r.gain(chosen)[1][0]
        if best is None:
            break
        wider = explain(study, [*_updated(e), Term(r.candidates[best[1]], float(best[2]))])
        if wider.score < e.score + 2e-3 * e.gain:
            break
        e, r = wider, regression(study, wider.fit, parameters)
    return e, r


def _updated(e: Explanation) -> list[Term]:
    """The terms with gains and shapes where the fit left them."""
    values = {f.target: f.value for f in e.fit.free}
    found, fault = [], 0
    for term, name in zip(e.terms, e.built.names):
        what = term.candidate.what
        if isinstance(what, Basis):
            shapes = {k: (values[f"{name}_{k}"], u) for k, (_, u) in what.shapes.items()}
            found.append(Term(replace(term.candidate, what=replace(what, shapes=shapes)), values[f"{name}_{what.gain[0]}"]))
        elif isinstance(what, Fault):
            if what.what in ("bias", "scale", "delay"):
                found.append(Term(term.candidate, values[(what.what, what.sensor)]))
            else:
                found.append(Term(term.candidate, values[("fault", fault)]))
                fault += 1
        elif isinstance(what, tuple):
            m, k, d = (values[f"{name}_{key}"] for key in ("mass", "stiffness", "damping"))
            w = np.sqrt(k / m)
            found.append(Term(replace(term.candidate, what=(what[0], what[1], w / (2 * np.pi), d / (2 * w * m))), m))
        else:
            found.append(term)
    return found


def at_rest(rest: Study, free: Study) -> bool:
    """Is a start in motion better explained by a load that was put on at the start?"""
    r = regression(rest, rest.null, [])
    loads = [k for k, c in enumerate(r.candidates) if c.kind == "constant_force"]
    gains = [r.gain([k])[0] for k in loads]
    return bool(gains) and max(gains) > 0.3 * (rest.null.cost - free.null.cost)


def search(study: Study, log=lambda text: None) -> tuple[Study, list[Explanation]]:
    """Explanations from best to worst; empty if there is nothing to explain. What the first and best of them takes for
    noise may be less than what the null fit did: then all is weighed anew, in the study returned."""
    parameters = [f.target for f in study.null.free if isinstance(f.target, str)]
    first = singles(study, regression(study, study.null, parameters), 2)
    if not first or first[0].score <= 0.0:
        return study, []
    quiet = requieted(study, first[0].fit)
    return quiet or study, grow(quiet or study, log)


def grow(study: Study, log) -> list[Explanation]:
    """Explanations by one kind, by two and by three, from best to worst."""
    parameters = [f.target for f in study.null.free if isinstance(f.target, str)]
    r = regression(study, study.null, parameters)
    beam = singles(study, r)
    for e in beam:
        log(f"{e.groups} {e.gain:.0f}")
    if not beam:
        return []
    done = list(beam)
    if beam[0].left < max(60.0, 0.01 * beam[0].gain):
        return [e for e in done if e.score > 0.0]
    for depth in (2, 3):
        grown: list[Explanation] = []
        for e in [b for b in beam[:2] if b.gain > 0.7 * beam[0].gain]:
            e, r = refine(study, e, regression(study, e.fit, parameters), parameters)
            done.append(e)
            log(f"refined {e.groups} x{len(e.terms)} {e.gain:.0f} of {study.null.chi2 - len(e.fit.residual):.0f}")
            found = []
            for group, pool in pools(r).items():
                if group in e.groups:
                    continue
                gain, chosen = pursue(r, pool, terms=2)
                if chosen and gain > max(NEW + sum(cost(r.candidates[c]) for c in chosen), LEAST * e.gain, min(0.5 * SHARE * e.gain, 0.3 * e.left)):
                    found.append((gain - sum(cost(r.candidates[c]) for c in chosen), chosen))
            found.sort(key=lambda x: -x[0])
            for gain, chosen in found[:2]:
                _, gains = r.gain(chosen)
                terms = [Term(r.candidates[c], float(g)) for c, g in zip(chosen, gains) if g != 0.0]
                pair = explain(study, [*_updated(e), *terms])
                log(f"  + {pair.groups[-1]} {gain:.0f} -> {pair.gain:.0f}")
                more = pair.gain - e.gain
                if more > max(NEW, LEAST * e.gain) and (more > SHARE * e.gain or more > MOST * e.left > 30.0):
                    grown.append(pair)
        if not grown or done and max(done, key=lambda e: e.score).left < 60.0:
            done += grown
            break
        beam = sorted(grown, key=lambda e: -e.score)
        done += beam
        if beam[0].left < 0.01 * beam[0].gain:
            break
    done = sorted((e for e in done if e.score > 0.0), key=lambda e: -e.score)
    if done and len(done[0].groups) > 1:
        done = sorted(done + exchanged(study, done[0], parameters, log), key=lambda e: -e.score)
    return done


def exchanged(study: Study, e: Explanation, parameters: Sequence[str], log) -> list[Explanation]:
    """Explanations with one cause of `e` exchanged for another: the first one found may have stood in for two."""
    found: list[Explanation] = []
    terms = _updated(e)
    for group in e.groups:
        rest = explain(study, [t for t in terms if t.group != group], 4)
        r = regression(study, rest.fit, parameters)
        worth = e.gain - rest.gain
        ranked = []
        for other, pool in pools(r).items():
            if other not in e.groups:
                gain, chosen = pursue(r, pool)
                if chosen and gain > 0.7 * worth:
                    ranked.append((gain, chosen))
        for gain, chosen in sorted(ranked, key=lambda x: -x[0])[:3]:
            _, gains = r.gain(chosen)
            new = [Term(r.candidates[c], float(g)) for c, g in zip(chosen, gains) if g != 0.0]
            found.append(explain(study, [*_updated(rest), *new]))
            log(f"  {group} for {found[-1].groups[-1]}: {found[-1].gain:.0f}")
    return found
