# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The simplest laws that do about as well as those that a search has put together: their parameters are known better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .build import Term
from .catalogue import lines, values
from .explaining import explain, gains
from .explanation import COST, CURVES, FORM, Explanation, cost, law_of, missing
from .hypotheses import BENDS, HALVES, KNEE, STRIBECK, Fault
from .naming import DAMPERS, straight
from .pursuit import TERMS, pools, pursue, terms_of
from .score import Candidate, where
from .study import Study, look, regression
from .worth import LINEAR

SHARP = 3.0  # of a sensor's limits, to begin with
BENT = 0.1  # more of a signal at its largest, to begin with
CLOSE = 0.02  # of the gain: an exchanged cause that is nearly as good gets more laws
WEAK = 2.0  # times the cost of a law: if to first order it is worth less, it may not be worth it
TEXTBOOK = {
    "bump_stop": ("bump_stop", "rebound_stop"),
    "cubic_spring": ("cubic_spring",),
    "backlash": ("backlash",),
    "asymmetric_spring": (BENDS["s"], "linear_spring"),
    "asymmetric_damper": (BENDS["v"], "linear_damper"),
    "coulomb_friction": ("coulomb_friction",),
    "bouc_wen": ("bouc_wen_loop",),
    "maxwell_bushing": ("maxwell_bushing",),
    "stribeck_friction": (STRIBECK,),
    "quadratic_damper": ("quadratic_damper",),
    "tyre_nonlinear": ("quadratic_spring",),
    "degressive_damper": (KNEE,),
    "damper_fading": ("heating_damper",),
    "tyre_damping": ("linear_damper",),
}
TAKING = {  # laws that take an element away: its law and argument
    "backlash": ("linear_spring", "stiffness"),
    "liftoff": ("linear_spring", "stiffness"),
    "loose_damper": ("linear_damper", "damping"),
    **dict.fromkeys(HALVES, ("linear_spring", "stiffness")),
}
LINES = dict(lines.LINES.values())  # laws and their gains
LINES_OF = {"spring": "linear_spring", "damper": "linear_damper"}
TWO = ("asymmetric_spring", "asymmetric_damper")  # of two numbers, and the nominal element is hardly their mean


def plain(study: Study, e: Explanation, parameters: Sequence[str], log) -> Explanation:
    """The explanation with the textbook law of a kind in place of several laws, and with constant friction in place of one that falls,
    where it does about as well: its parameters are known better."""
    e = level_friction(study, leaner(study, unlagged(study, unbent(study, e, log), log), log), log)
    laws = {g: [law_of(t.candidate) for t in e.terms if t.group == g] for g in e.groups if g[0] in TEXTBOOK}
    laws = {g: own for g, own in laws.items() if own != ["loose_damper"]}  # one as well
    ways = [(g, g) for g, own in laws.items() if len(own) > len(TEXTBOOK[g[0]]) or not set(own) <= set(TEXTBOOK[g[0]])]
    ways += [(g, ("coulomb_friction", g[1])) for g in laws if g[0] == "stribeck_friction"]  # a fall at rates that are rare is none
    if not ways:
        return joined(study, e, log)
    whole = e.whole()
    r = regression(study, whole.fit, parameters, {kind for _, (kind, _) in ways})
    for group, other in ways:
        if group not in e.groups:
            continue
        pool = pools(r).get(other, [])
        if group == other:
            pool = [k for k in pool if law_of(r.candidates[k]) in TEXTBOOK[group[0]]]
        without = r.without(missing(whole, group))
        chosen = pursue(without, pool, terms=len(TEXTBOOK[group[0]]) if group == other else TERMS)[1]
        if group[0] in TWO and len(chosen) == 1:
            chosen += [k for k in pool if without.candidates[k].companion]
        new = terms_of(without, chosen)
        if new:
            simple = explain(study, [*(t for t in e.terms if t.group != group), *new], start=e.fit, formulas=e.formulas)
            log(f"  plain {group} as {other[0]}, {simple.groups}: {simple.gain:.0f} for {e.gain:.0f}, {simple.score:.0f} for {e.score:.0f}")
            same = set(simple.groups) == {other if g == group else g for g in e.groups}
            if same and ((group == other and simple.gain > e.gain - COST) or simple.score > e.score - COST):
                e = simple
    return joined(study, unbent(study, e, log), log)


def level_friction(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with friction of one level that yields as far in place of one that falls, where it does about as well: no candidate
    yields as little as a fit has found."""
    for t in [t for t in e.terms if law_of(t.candidate) == "falling_friction"]:
        what = t.candidate.what
        one = replace(what, kind="coulomb_friction", law="dahl_friction", shapes={"presliding": what.shapes["presliding"]})
        term = replace(t, candidate=replace(t.candidate, kind="coulomb_friction", what=one))
        level = explain(study, [*(x for x in e.terms if x.group != t.group), term], start=e.fit, formulas=e.formulas)
        log(f"  one level of {t.group}: {level.gain:.0f} for {e.gain:.0f}, {level.score:.0f} for {e.score:.0f}")
        if len(level.groups) == len(e.groups) and level.score > e.score - COST:
            return level
    return e


def unlagged(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with a spring that hardens in place of a bushing that hardens, where it fits as well without memory."""
    for t in [t for t in e.terms if law_of(t.candidate) == "hardening_bushing"]:
        if t.group in e.groups:
            what = replace(t.candidate.what, kind="cubic_spring", law="cubic_spring", shapes={})
            place = where("cubic_spring", study.places[what.place], study.model)
            term = replace(t, candidate=replace(t.candidate, kind="cubic_spring", where=place, companion=False, what=what))
            spring = explain(study, [*(x for x in e.terms if x.group != t.group), term], start=e.fit, formulas=e.formulas)
            log(f"  no memory in {t.group}: {spring.gain:.0f} for {e.gain:.0f}")
            e = spring if spring.score > e.score - COST else e
    return e


def joined(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with the straight part of a curve in place of a wrong parameter of the element at its place: together they are
    one curve, which has one name."""
    for group in [g for g in e.groups if g[0] == "wrong_parameter"]:
        linear = {x.law: x.name for x in study.model.elements if group[1] in x.arguments.values() and x.law in LINES}
        for t in [t for t in e.terms if t.candidate.kind in (*DAMPERS, "cubic_spring", "asymmetric_spring")]:
            what = t.candidate.what
            law = LINES_OF[CURVES[t.candidate.kind]]
            if linear.get(law) in {name for name, _ in study.places[what.place].elements} and group in e.groups:
                along = tuple(getattr(s.motions[what.place], LINEAR[law]) for s in look(study, e.fit))
                line = replace(what, law=law, gain=LINES[law], shapes={}, sign=0, series=along, companion=True, fixed={}, least={})
                more = e.fit.value(group[1]) - study.model.parameters[group[1]].value
                term = Term(replace(t.candidate, sign=0, companion=True, what=line), more)
                one = explain(study, [*(x for x in e.terms if x.group != group), term], start=e.fit, formulas=e.formulas)
                log(f"  {group} in {t.group}: {one.gain:.0f} for {e.gain:.0f}")
                e = one if one.score > e.score else e
    return e


def leaner(study: Study, e: Explanation, log) -> Explanation:
    """The explanation without laws that the others of their kind do as well without: they only blur its parameters, or its name."""
    kept: list[Term] = []
    while spare := [t for t in weak(e) if t not in kept]:
        simple = explain(study, [t for t in e.terms if t is not spare[0]], 4, e.fit, e.formulas)
        if simple.gain > (1.0 - CLOSE) * e.gain:  # else more steps will not make it as good
            simple = explain(study, simple.terms, start=simple.fit, formulas=e.formulas)
        log(f"  lean {spare[0].group}: {simple.gain:.0f} for {e.gain:.0f}")
        if len(simple.groups) == len(e.groups) and simple.score > e.score:
            e, kept = simple, []
        else:
            kept.append(spare[0])
    return e


def weak(e: Explanation) -> list[Term]:
    """Laws beside others of their kind that may be worth less than they cost, the least one first."""
    places = {f.target: i for i, f in enumerate(e.fit.free)}
    variance = np.diag(e.fit.covariance())
    found = []
    for term, target in zip(e.terms, gains(e.terms, e.built.names), strict=True):
        several = sum(t.group == term.group for t in e.terms) > 1 and term.group[0] != "sensor_bias"
        if not term.candidate.companion and sum(t.group == term.group and not t.candidate.companion for t in e.terms) == 1:
            continue  # companions alone are no cause
        if several and not term.own and getattr(term.candidate.what, "what", "") not in ("rail", "sharpness"):
            i = places[target]
            f = e.fit.free[i]
            found.append(((f.value / f.unit) ** 2 / max(variance[i], 1e-300), term))
    bound = WEAK * (COST + FORM * e.gain)
    return [term for worth, term in sorted(found, key=lambda x: x[0]) if worth < bound * cost(term.candidate) / COST]


def unbent(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with the parameter of an element in place of a curve beside it that is a straight line, or with that line, where
    the model has none."""
    for group in e.groups:
        law = straight(e.terms, e.built.names, group, {f.target: f.value for f in e.fit.free})
        term = _line(study, next(t for t in e.terms if t.group == group), law, e) if law else None
        if term and all(t.group != term.group for t in e.terms):
            simple = explain(study, [*(t for t in e.terms if t.group != group), term], start=e.fit, formulas=e.formulas)
            log(f"  straight {group}: {simple.gain:.0f} for {e.gain:.0f}")
            if simple.score > e.score - COST:
                e = simple
    return e


def _line(study: Study, t: Term, law: str, e: Explanation) -> Term | None:
    """What a straight curve at the place of a term is: a parameter that may change, or what the place lacks; None if it is neither."""
    place = study.places[t.candidate.what.place]
    elements, argument = {name for name, _ in place.elements}, LINES[law][0]
    found = [x.arguments[argument] for x in study.model.elements if x.law == law and x.name in elements]
    if found:
        name = found[0]
        return Term(Candidate(values.KIND, name, 0, False, name), 0.0) if study.model.parameters[name].tolerance > 0.0 else None
    kind = next((kind for kind in lines.lacking(place) if lines.LINES[kind][0] == law), "")
    fitted = {f.target: f.value for f in e.fit.free}
    gain = next(
        (
            fitted[f"{n}_{argument}"]
            for x, n in zip(e.terms, e.built.names, strict=True)
            if x.group == t.group and law_of(x.candidate) == law
        ),
        0.0,
    )
    sign = lines.sign(kind)
    if not kind or gain == 0.0 or gain * sign < 0.0:
        return None
    along = tuple(getattr(s.motions[t.candidate.what.place], LINEAR[law]) for s in look(study, e.fit))
    what = replace(
        t.candidate.what, kind=kind, law=law, gain=LINES[law], shapes={}, sign=sign, series=along, companion=False, fixed={}, least={}
    )
    return Term(replace(t.candidate, kind=kind, sign=sign, companion=False, what=what), gain)


def owned(study: Study, e: Explanation, log) -> Explanation:
    """The explanation with laws that take away all of an element, where they do as well as with a share of it: else how
    wide a play is would be known no better than how much it takes. A play that is not in the middle has two halves."""
    best = e
    for terms in ([t if t.candidate.companion else whole(study, t) or t for t in e.terms], halved(study, e)):
        if terms != list(e.terms):
            tied = explain(study, terms, start=e.fit, formulas=e.formulas)
            log(f"  all of an element: {tied.gain:.0f} for {e.gain:.0f}")
            best = tied if tied.groups == e.groups and tied.score > best.score else best
    return best


def softened(study: Study, e: Explanation, log=lambda text: None) -> Explanation:
    """The explanation with a sensor that comes near its limits smoothly in place of one that is bent at several values."""
    for group in [g for g in e.groups if g[0] == "sensor_clipping"]:
        own = [t for t in e.terms if t.group == group]
        if any(t.candidate.what.what == "rail" for t in own):
            continue
        sensor = own[0].candidate.what.sensor
        top = max(float(np.max(np.abs(x.y[x.good[:, sensor], sensor]), initial=1e-300)) for x in study.experiments)
        for laws in ({"sharpness": SHARP}, {"sharpness": 0.0, "scale_bend": BENT}):  # a tanh of what is bent is sharper than one
            sizes = {"rail": 1.0 / top} | laws
            faults = [Fault("sensor_clipping", sensor, what, what != "scale_bend", (), top) for what in sizes]
            soft = [Term(replace(own[0].candidate, what=fault), x) for fault, x in zip(faults, sizes.values(), strict=True)]
            smooth = explain(study, [*(t for t in e.terms if t.group != group), *soft], start=e.fit, formulas=e.formulas)
            log(f"  smooth {group}: {smooth.gain:.0f} for {e.gain:.0f}")
            e = smooth if smooth.score > e.score else e
    return e


def halved(study: Study, e: Explanation) -> list[Term]:
    """The terms with two halves, each of which takes away all of a spring, for a play with one half beside it."""
    terms = list(e.terms)
    for group in [g for g in e.groups if g[0] == "backlash"]:
        laws = {law_of(t.candidate): t for t in terms if t.group == group}
        play, beside = laws.get("backlash"), [law for law in HALVES if law in laws]
        if play is not None and play.gain > 0.0 and len(beside) == 1:
            half = laws[beside[0]]
            gap, more = (t.candidate.what.shapes["gap"][0] for t in (play, half))
            gaps = {law: gap + (half.gain / play.gain * more if law in beside else 0.0) for law in HALVES}
            basis = play.candidate.what
            kinds = [replace(basis, law=law, gain=half.candidate.what.gain, shapes={"gap": (x, "m")}) for law, x in gaps.items()]
            both = [whole(study, replace(play, own="", candidate=replace(play.candidate, what=kind))) for kind in kinds]
            if all(both) and min(gaps.values()) > 0.0:
                terms = [*(t for t in terms if t.group != group), *both]
    return terms


def whole(study: Study, t: Term) -> Term | None:
    """A law that takes away all of the element at its place; None if it is no such law, or already does."""
    law, argument = TAKING.get(law_of(t.candidate), ("", ""))
    near = {name for name, _ in study.places[t.candidate.what.place].elements} if law and not t.own else set()
    own = [x.arguments[argument] for x in study.model.elements if x.law == law and x.name in near]
    if len(own) != 1 or t.gain == 0.0:
        return None
    what, all_of_it = t.candidate.what, study.model.parameters[own[0]].value
    share = t.gain / all_of_it  # of a narrow play, only its gap times what it takes is seen
    shapes = {k: (x * share if k == "gap" else x, unit) for k, (x, unit) in what.shapes.items()}
    return replace(t, candidate=replace(t.candidate, what=replace(what, shapes=shapes)), gain=all_of_it, own=own[0])
