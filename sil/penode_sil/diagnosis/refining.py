# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""More elementary laws for the causes of an explanation, where they earn their cost."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

from .build import Term
from .explaining import explain, heavy, settled
from .explanation import Explanation, cost, curve, fault_of, related
from .hypotheses import CLOCK
from .naming import DAMPERS, FRICTION
from .pursuit import family, pools, pursue, room, terms_of
from .score import Regression
from .study import Study, noise_of, regression

SHAPED = {*FRICTION, *DAMPERS} - {"bouc_wen"}  # kinds whose names follow from the shape of a curve alone, whatever laws it is made of
FILTER = 0.93  # of the gain of two hidden masses: where one gains less, the two are a filter that replaces other dynamics
SINGLE = ("wrong_parameter", "hidden_resonance", CLOCK)  # kinds that have one law only


def refined(study: Study, e: Explanation, parameters: Sequence[str]) -> Explanation:
    """The explanation with more elementary laws of its kinds, where they earn their cost."""
    kinds = related(e.groups) - set(SINGLE)
    if not kinds:
        return e
    e = e.whole()
    return refine(study, e, regression(study, e.fit, parameters, kinds), parameters, kinds)[0]


def refine(
    study: Study, e: Explanation, r: Regression, parameters: Sequence[str], kinds: Collection[str] = ()
) -> tuple[Explanation, Regression]:
    """Give each kind of an explanation more elementary laws, as long as they earn their cost; `kinds`: that the regression is about,
    if not all."""
    for _ in range(2):
        best = None
        for group in e.groups:
            if group[0] != "hidden_resonance" and sum(t.group == group for t in e.terms) < room(group[0]) + 1:
                own = {fault_of(t.candidate) for t in e.terms if t.group == group} - {None}
                laws = family(study, r, [group]) if group[0] in SHAPED else pools(r).get(group, [])
                pool = [k for k in laws if r.candidates[k].kind in {group[0], *SHAPED} and fault_of(r.candidates[k]) not in own]
                gain, chosen = pursue(r, pool, terms=1, alone=group[0] not in ("sensor_bias", "sensor_delay", "maxwell_bushing"))
                if chosen and gain > max(cost(r.candidates[chosen[0]]), 2e-3 * e.gain) and (best is None or gain > best[0]):
                    best = gain, chosen[0], r.gain(chosen)[1][0]
        if best is None:
            break
        wider = explain(study, [*e.terms, Term(r.candidates[best[1]], float(best[2]))], start=e.fit, formulas=e.formulas)
        if wider.score < e.score + 2e-3 * e.gain:
            break
        e = wider.whole()
        r = regression(study, e.fit, parameters, kinds)
    return e, r


def filtered(study: Study, e: Explanation, r: Regression) -> Explanation | None:
    """The explanation with a second hidden mass, if it has one and that gains by another: any filter will do, and has no name."""
    for group in e.groups:
        if group[0] == "hidden_resonance" and sum(t.group == group for t in e.terms) == 1:
            gain, chosen = pursue(r, pools(r).get(group, []), terms=1)
            if chosen and gain > (1.0 / FILTER - 1.0) * e.gain:
                return explain(study, [*e.terms, *terms_of(r, chosen)], start=e.fit, formulas=e.formulas)
    return None


def mended(study: Study, e: Explanation, log) -> tuple[Explanation, Explanation]:
    """The explanation with as many more laws of its causes as are worth their numbers, under the same names: with laws of the sign of
    their kinds, from which its causes have their sizes; and then of any sign. A name is what a curve does in the large; what the
    extended model predicts depends on all of the curve, and may need less of a law as well as more."""
    study, sized, r = formed(study, e, None, log)
    more = r is not None and not heavy(sized)
    return sized, formed(study, sized, r.unsigned(), log)[1] if more else sized


def formed(study: Study, e: Explanation, r: Regression | None, log) -> tuple[Study, Explanation, Regression | None]:
    """The explanation with more laws as they are in a regression about it, if it is known already, one where fits are `heavy`; with the
    study that has the noise it leaves, and the regression about it. Laws may have any sign if they may in the regression."""
    parameters = [f.target for f in study.null.free if isinstance(f.target, str)]
    spare = [g for g in e.groups if g[0] not in ("wrong_parameter", "constant_force", "sensor_delay", CLOCK)]
    anyway = r is not None
    if spare and r is None:
        e = e.whole()
        r = regression(study, e.fit, parameters, related(spare))
    while spare:
        found = []
        for group in spare:
            own = {fault_of(t.candidate) for t in e.terms if t.group == group} - {None}
            pool = [k for k in family(study, r, [group]) if fault_of(r.candidates[k]) not in own]
            gain, chosen = pursue(r, pool, terms=1, alone=False)
            if chosen and gain > 2.0 * cost(r.candidates[chosen[0]]):
                found.append((gain, group, Term(r.candidates[chosen[0]], float(r.gain(chosen)[1][0]))))
        if not found:
            break
        _, group, new = max(found, key=lambda x: x[0])
        wider = called(explain(study, [*e.terms, new], start=e.fit, formulas=e.formulas), e)
        log(f"  mended {group}: {wider.gain:.0f} for {e.gain:.0f}")
        if set(wider.groups) == set(e.groups) and wider.gain > e.gain + 2.0 * cost(new.candidate):
            levels, metrics = noise_of(study, wider.fit)  # what is mended had been taken for noise
            study = replace(study, levels=levels, metrics=metrics)
            e = settled(study, wider).whole()
            r = regression(study, e.fit, parameters, related(spare))
            r = r.unsigned() if anyway else r
            if heavy(e):
                break
        else:
            spare.remove(group)
    return study, e, r


def called(e: Explanation, known: Explanation) -> Explanation:
    """The explanation with its curves called what they are in a known one."""
    names = {curve(t.candidate): t.group for t in known.terms}
    groups = [names.get(curve(t.candidate), t.group) for t in e.terms]
    candidates = [replace(t.candidate, kind=kind, where=where) for t, (kind, where) in zip(e.terms, groups, strict=True)]
    return replace(e, terms=tuple(replace(t, candidate=c) for t, c in zip(e.terms, candidates, strict=True)))
