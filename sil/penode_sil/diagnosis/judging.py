# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From explanations to a verdict: which causes are named, and whether they are an explanation at all."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from . import explaining, explanation, noise, refining, search, sized
from .catalogue import lines
from .echo import LAGGING
from .explanation import Explanation
from .hypotheses import CLOCK, Basis
from .late import SHORT
from .leftover import DOUBT, beyond_noise
from .result import OUTSIDE, UNKNOWN, Cause, Named
from .study import Study

PATCHED = 0.985  # share that several causes must take away if sensors still share a residual, and any cause if something changes too
WHOLE = 0.94  # share of several causes from which on a residual beyond chance may be of their form
ENOUGH = 0.85  # share of the avoidable residual that named causes must take away to be an explanation at all
DAMPED = 0.2  # a hidden mass with more damping is no part on rubber, whose loss factor is 0.4 at most: it stands for some other dynamics
MAIN = 0.5  # of the gain: causes that do less without a drift of the clocks only stand in for it
# What is positive by its nature: a cause of which that is not sure stands for something else. Others are unsure for a bent curve.
SIZES = {
    "tyre_damping": "damping",
    "coulomb_friction": "force",
    "bouc_wen": "force",
    "maxwell_bushing": "stiffness",
    "hidden_resonance": "frequency",
}


def judge(
    study: Study, explanations: Sequence[Explanation], faults: list[Cause], alike: float, shared: float, pure: bool, changed: float = 0.0
) -> tuple[tuple[Cause, ...], str, float, float]:
    """Causes, verdict, share explained, and the evidence that there is anything at all; `alike`, `shared`: see
    noise.correlation; `pure`: a tone is left; `changed`: chi2 of changes with time, if that is beyond chance."""
    rows = explanation.rows(study)
    excess = study.null.cost - rows
    evidence = excess / np.sqrt(2.0 * rows)
    if not explanations:
        if beyond_noise(excess, rows) or alike > noise.ALIKE or pure or changed:
            return (UNKNOWN,), "unexplained", 0.0, evidence
        verdict = "explained" if faults else "not_identifiable" if evidence > DOUBT else "no_discrepancy"
        return tuple(faults), verdict, 1.0, evidence
    best = explanations[0]
    left = max(best.fit.chi2 - rows, shared if alike > noise.ALIKE else 0.0, 0.0)  # in the noise that the best explanation leaves
    gained, part = study.null.cost - best.fit.cost, share(study, best, left)
    if part < ENOUGH and (beyond_noise(left, rows) or alike > noise.ALIKE):
        return (Cause(OUTSIDE, "", {}, 1.0 - part),), "unexplained", part, evidence
    shown = alike > noise.ALIKE or (part < WHOLE and left > DOUBT * np.sqrt(2.0 * rows))
    patched = len(best.groups) > 1 and part < PATCHED and shown  # several causes, and still no whole
    twice = changed and alike > noise.ALIKE and part < PATCHED  # by two proofs something is left
    if patched or twice or changed > (1.0 - PATCHED) * gained:
        return (Cause(OUTSIDE, "", {}, 1.0 - part),), "unexplained", part, evidence
    masses = [t for t in best.terms if t.candidate.kind == "hidden_resonance"]
    if len(masses) > 1 and len(best.groups) == 1 and explaining.explain(study, masses[:1]).gain < refining.FILTER * best.gain:
        return (UNKNOWN,), "unexplained", part, evidence
    others = [t for t in best.terms if t.candidate.kind != CLOCK]
    if not others or (len(others) < len(best.terms) and explaining.explain(study, others).gain < MAIN * best.gain):
        return (UNKNOWN,), "unexplained", part, evidence
    causes = [cause(study, explanations, group) for group in best.groups if group[0] != CLOCK]
    causes = [c for c in causes if worth(study, c)]
    if any(unsized(best, c) for c in causes):
        return (UNKNOWN,), "unexplained", part, evidence
    kinds = [c.kind for c in causes]  # several wrong parameters are another vehicle, several delays another clock
    several = max(kinds.count("wrong_parameter"), kinds.count("sensor_delay")) > 1
    if several or damped(causes):
        return (UNKNOWN,), "unexplained", part, evidence
    faulty = {(c.kind, c.where) for c in causes}
    causes += [f for f in faults if (f.kind, f.where) not in faulty]
    whole = (part > search.WHOLE or left < 0.15 * rows) and not pure
    return tuple(causes), ("explained" if whole else "partly_explained") if causes else "no_discrepancy", part, evidence


def share(study: Study, e: Explanation, left: float = 0.0) -> float:
    """Share of the avoidable residual that an explanation takes away, 0 to 1; `left`: a lower bound of the chi2 that remains."""
    left, gained = max(e.fit.chi2 - explanation.rows(study), left), study.null.cost - e.fit.cost
    return gained / (gained + left) if gained + left > 0.0 else 1.0


def pitching(e: Explanation) -> bool:
    """Might pitch pass for it? Several causes that lag."""
    return len(e.groups) > 1 and {kind for kind, _ in e.groups} <= LAGGING


def damped(causes: Sequence[Cause]) -> list[str]:
    """A line on each hidden mass whose damping is more than that of a part on rubber."""
    lines = []
    for c in (c for c in causes if c.kind == "hidden_resonance"):
        v = {k: p.value for k, p in c.parameters.items()}
        if v["damping_ratio"] > DAMPED:
            like = f"a mass of {v['mass']:.3g} kg at {v['frequency']:.3g} Hz with a damping ratio of {v['damping_ratio']:.2f}"
            lines.append(
                f"the force missing at {c.where} is like that of {like}, too much for a part on rubber: "
                "pitch, roll, an occupant, a load that moves?"
            )
    return lines


def unsized(e: Explanation, c: Cause) -> bool:
    """May the size of a cause be nothing? Not where that is a stiffness in series with a damper: it follows from a time that may be too
    short to be known, though the laws together are sure."""
    if c.kind not in SIZES or c.parameters[SIZES[c.kind]].ci95[0] > 0.0:
        return False
    laws = {n: t.candidate.what for t, n in zip(e.terms, e.built.names, strict=True) if t.group == (c.kind, c.where)}
    if not any(isinstance(what, Basis) and what.law == "loose_damper" for what in laws.values()):
        return True
    gains = {f"{name}_{what.gain[0]}" for name, what in laws.items()}
    at = [i for i, f in enumerate(e.fit.free) if f.target in gains]
    size = np.array([e.fit.free[i].value / e.fit.free[i].unit for i in at])
    return float(size @ np.linalg.pinv(e.fit.covariance()[np.ix_(at, at)]) @ size) < explanation.COST * len(at)


def worth(study: Study, c: Cause) -> bool:
    """Is a cause large enough to be one? Significance is not size."""
    p = {k: v.value for k, v in c.parameters.items()}
    match c.kind:
        case "sensor_scale":
            return abs(p["scale"] - 1.0) > 0.005
        case "constant_force":
            low, high = c.parameters["force"].ci95
            return low * high > 0.0
        case "sensor_delay":
            return p["delay"] > SHORT * study.model.sample_time
        case "wrong_parameter":
            return all(abs(v / study.model.parameters[k].value - 1.0) > study.model.parameters[k].tolerance for k, v in p.items())
        case "hidden_resonance":
            mass = next(study.model.parameters[b.mass].value for b in study.model.bodies if b.name == c.where)
            return p["mass"] > 0.002 * mass
    return True


def cause(study: Study, explanations: Sequence[Explanation], group: tuple[str, str]) -> Cause:
    """One group of the best explanation with parameters and alternatives."""
    best = explanations[0]
    others = []
    margin = np.inf
    for e in explanations[1:]:
        if group in e.groups:
            continue
        swapped = [g for g in e.groups if g not in best.groups and g[0] != CLOCK]
        if group[0] in lines.KINDS and {where for _, where in swapped} == {group[1]} and e.gain < best.gain + explanation.COST:
            continue  # a curve there that gains no more has become that line
        behind = best.score - e.score
        margin = min(margin, behind)
        if len(swapped) == 1 and behind < max(50.0, 0.01 * best.gain) and swapped[0] not in others:
            others.append(swapped[0])
    scale = 2.0 + 0.002 * best.gain
    confidence = float(1.0 / (1.0 + np.exp(-min(margin, 50.0 * scale) / scale)))
    return Cause(*group, sized.values(study, best, group), confidence, tuple(Named(*o) for o in others[:3]))


def resized(study: Study, e: Explanation, c: Cause) -> Cause:
    """A cause with its parameters in another explanation, if it is in there: where more of the rest is explained, it need not
    make up for that."""
    group = (c.kind, c.where)
    own = [t for t in e.terms if t.group == group]
    if not own or (c.kind == "hidden_resonance" and len(own) > 1):  # which share what one was
        return c
    return replace(c, parameters=sized.values(study, e, group))
