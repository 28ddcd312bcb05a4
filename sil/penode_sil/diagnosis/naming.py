# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Names of fitted curves: friction, dampers, springs and tyres by their force, not by the laws that they are composed of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .build import Term
from .explanation import Group
from .fit import Fit
from .hypotheses import Basis
from .plant import Place
from .score import where
from .study import Study

ELASTIC = 0.04  # of the reach: friction that yields farther before it slides is hysteresis of the element
FRICTION = ("coulomb_friction", "stribeck_friction", "bouc_wen")
DAMPERS = ("asymmetric_damper", "degressive_damper", "quadratic_damper")
SPRINGS = ("asymmetric_spring", "cubic_spring", "bump_stop", "network_extrapolation")
TYRES = ("tyre_nonlinear", "tyre_liftoff")
QUIET = 0.25  # of the largest force that an element is wrong by: less where its network was trained, and it is not the element
UNEVEN = 0.5  # even part of a curve over its odd one, without a line, that makes it asymmetric
EDGE = 0.15  # of the reach: a stop or a loss of contact that begins nearer than that to the middle is an element that bends there
MENDING = 0.2  # of the largest force of a stop on one side at the reach: with less, another only mends its form
STRAIGHT = 0.02  # of the straight part of a curve: less than that beside it, and it is a straight line
PEAK = 1.2  # friction at low rates over that at higher ones that makes it Stribeck's
FAST = 0.3  # of the rates: from there on the line in a curve is a damper's
STEP = 0.65  # of its greatest force from a twentieth of the rates on that friction without memory has there: with less, it is a damper
Array = NDArray[np.float64]
Values = Mapping[object, float]


def with_kinds(terms: Sequence[Term], names: Sequence[str], fit: Fit, study: Study) -> tuple[Term, ...]:
    """The terms of friction, dampers and springs named by what their fitted curve does, not by the laws that it was put
    together from."""
    values = {f.target: f.value for f in fit.free}
    named = list(terms)
    for kinds, name in ((FRICTION, _friction), (DAMPERS, _damper), (SPRINGS, _spring), (TYRES, _tyre)):
        for place in {t.candidate.what.place for t in terms if t.candidate.kind in kinds}:
            own = [i for i, t in enumerate(terms) if t.candidate.kind in kinds and t.candidate.what.place == place]
            curve = Curve([terms[i] for i in own], [names[i] for i in own])
            kind = name([terms[i] for i in own], [names[i] for i in own], values, *study.sizes[place])
            if kinds is SPRINGS and _beyond(curve, values, study.places[place], study.sizes[place][0]):
                kind = "network_extrapolation"
            for i in own:
                candidate = replace(terms[i].candidate, kind=kind, where=where(kind, study.places[place], study.model))
                named[i] = replace(terms[i], candidate=candidate)
    return tuple(named)


def _friction(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float, speed: float) -> str:
    own = [name for term, name in zip(terms, names, strict=True) if term.candidate.what.gain[0] == "force"]
    travel = sum(values[f"{name}_force"] * values.get(f"{name}_presliding", 0.0) for name in own)
    v = np.geomspace(0.004 * speed, speed, 200)
    f = Curve(terms, names)(np.zeros_like(v), v, values)
    if travel > ELASTIC * reach * np.max(f):
        return "bouc_wen"
    alone = _slid(v, f)
    if not travel and not _steps(v, alone):
        return "degressive_damper"
    return _rubbing(alone)


def _slid(v: Array, f: Array) -> Array:
    """A force at rates v > 0 without the line that it has at high ones: friction without the damper beside it."""
    fast = v > FAST * v[-1]
    return f - line(v[fast], f[fast], np.ones_like(v[fast])) * v


def _steps(v: Array, f: Array) -> bool:
    """Is a force at rates v > 0 without its line there from the lowest ones on? Dampers with a knee have 0.5 of it at a
    twentieth of the rates at the most, friction 0.86 at the least (54 and 60 hidden ones)."""
    here = float(np.interp(0.05 * v[-1], v, f))
    return here > STEP * max(here, float(np.max(f[v > 0.05 * v[-1]]))) > 0.0


def _rubbing(f: Array) -> str:
    """Does friction fall as the rate grows?"""
    least = np.minimum.accumulate(f[::-1])[::-1]  # from each rate on
    return "stribeck_friction" if np.any(f > PEAK * least) else "coulomb_friction"


def _damper(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float, speed: float) -> str:
    v = np.linspace(-speed, speed, 401)
    f = Curve(terms, names)(np.zeros_like(v), v, values)
    odd, even = _parts(v, f)
    if _size(even) > UNEVEN * _size(odd):
        return "asymmetric_damper"
    if odd @ v**3 > line(v, v**3) * (odd @ v):
        return "quadratic_damper"
    fine = np.geomspace(0.004 * speed, speed, 200)
    both = Curve(terms, names)(np.zeros(2 * len(fine)), np.concatenate([fine, -fine]), values)
    alone = _slid(fine, 0.5 * (both[: len(fine)] - both[len(fine) :]))
    return _rubbing(alone) if _steps(fine, alone) else "degressive_damper"


def _spring(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float, speed: float) -> str:
    s = np.linspace(-reach, reach, 401)
    odd, even = _parts(s, Curve(terms, names)(s, np.zeros_like(s), values))
    found = {t.candidate.kind for t in terms}
    if _contact(terms, names, values, reach) < EDGE * reach:
        return "asymmetric_spring" if _size(even) > UNEVEN * _size(odd) else "cubic_spring"
    if found & {"bump_stop", "network_extrapolation"}:
        return terms[0].candidate.kind
    if found == {"asymmetric_spring"} and _size(even) < UNEVEN * _size(odd):
        return "cubic_spring"
    return "asymmetric_spring" if found == {"cubic_spring"} and _size(even) > UNEVEN * _size(odd) else terms[0].candidate.kind


def _contact(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float) -> float:
    """Deflection where stops come into contact, on the side where they do later; `reach` without any. Laws with a smaller part of
    the force there correct the form of others."""
    stops = [(t, n) for t, n in zip(terms, names, strict=True) if t.candidate.kind == "bump_stop"]
    ends = np.array([-reach, reach])
    forces = np.array([np.abs(Curve([t], [n])(ends, np.zeros(2), values)) for t, n in stops]).reshape(-1, 2)
    gaps = np.array([abs(values.get(f"{n}_gap", reach)) for _, n in stops])
    return max((float(np.min(gaps[f > MENDING * np.max(f)])) for f in forces.T if np.any(f > 0.0)), default=reach)


def _tyre(terms: Sequence[Term], names: Sequence[str], values: Values, reach: float, speed: float) -> str:
    lost = [values[f"{n}_static"] for t, n in zip(terms, names, strict=True) if t.candidate.what.law == "liftoff"]
    return "tyre_liftoff" if max(lost, default=0.0) > EDGE * reach else "tyre_nonlinear"


def straight(terms: Sequence[Term], names: Sequence[str], group: Group, values: Values) -> str:
    """The law of a line that the curve of a group is, but for STRAIGHT of it; empty if it is a curve."""
    if group[0] not in (*DAMPERS, "cubic_spring", "asymmetric_spring", "tyre_nonlinear"):
        return ""
    law = "linear_damper" if group[0] in DAMPERS else "linear_spring"
    size = {True: 0.0, False: 0.0}  # of linear parts, and of others
    for term, name in ((t, n) for t, n in zip(terms, names, strict=True) if t.group == group):
        what = term.candidate.what
        gain = values.get(f"{name}_{what.gain[0]}", term.gain)
        size[what.law == law] += abs(gain) * float(np.sqrt(np.mean(np.concatenate(what.series) ** 2)))
    return law if size[False] < STRAIGHT * size[True] else ""


def _beyond(curve: Curve, values: Values, place: Place, reach: float) -> bool:
    """Is a curve one of where a network was not trained, and next to nothing where it was?"""
    inside = [(low, high) for _, what, low, high, _ in place.trained if what == "s"]
    s = np.linspace(-reach, reach, 401)
    f = np.abs(curve(s, np.zeros_like(s), values))
    return any(np.max(f[(s >= low) & (s <= high)], initial=0.0) < QUIET * np.max(f) for low, high in inside)


def _parts(x: Array, f: Array) -> tuple[Array, Array]:
    """Odd part less its line, and even part, of a curve over a symmetric range."""
    odd, even = (f - f[::-1]) / 2.0, (f + f[::-1]) / 2.0
    return odd - line(x, odd) * x, even - even[len(x) // 2]


def _size(f: Array) -> float:
    return float(np.sqrt(np.mean(f * f)))


class Curve:
    """The force of a group of terms over deflection or rate, for any values of the free parameters."""

    def __init__(self, terms: Sequence[Term], names: Sequence[str]):
        self.parts = [(t, n) for t, n in zip(terms, names, strict=True) if isinstance(t.candidate.what, Basis)]

    def __call__(self, s: Array, v: Array, values: Values) -> Array:
        total = np.zeros_like(s)
        for term, name in self.parts:
            what = term.candidate.what
            gain = values.get(f"{name}_{what.gain[0]}", term.gain)
            a = {k: values.get(f"{name}_{k}", x) for k, (x, _) in (what.shapes | what.fixed).items()}
            total = total + gain * shape(what.law, s, v, a)
        return total


def shape(law: str, s: Array, v: Array, a: Mapping[str, float]) -> Array:
    """A memoryless elementary law for gain 1; hysteresis as it is long after a reversal, relaxation as it is at first."""
    match law:
        case "linear_spring" | "maxwell_bushing":
            return s
        case "hardening_bushing":
            return s**3
        case "linear_damper":
            return v
        case "coulomb_friction":
            return np.tanh(v / a["transition"])
        case "bouc_wen" | "bouc_wen_loop" | "dahl_friction" | "slack_friction":
            return np.sign(v)
        case "degressive_damper":
            return -v * np.abs(v) / (a["knee"] + np.abs(v))
        case "quadratic_damper":
            return v * np.abs(v)
        case "cubic_spring":
            return s**3
        case "quadratic_spring":
            return s * s
        case "bump_stop":
            return np.maximum(s - a["gap"], 0.0)
        case "rebound_stop":
            return np.minimum(s + a["gap"], 0.0)
        case "backlash":
            return -np.clip(s, -a["gap"], a["gap"])
        case "liftoff":
            return -np.maximum(s - a["static"], 0.0)
        case "loose_damper":
            return np.zeros_like(s)
        case "constant_force" | "growing_force":
            return np.ones_like(s)
        case "falling_friction":
            return np.sign(v) / (1.0 + (v / a["stribeck"]) ** 2)
        case "fading_damper" | "heating_damper":
            return v
    functions = {
        "abs": np.abs,
        "exp": np.exp,
        "tanh": np.tanh,
        "max": np.maximum,
        "min": np.minimum,
        "softplus": lambda x: np.logaddexp(0.0, x),
    }
    words = functions | {"s": s, "v": v, "k": 1.0, "force": 1.0} | dict(a)
    return eval(law.replace("^", "**"), {"__builtins__": {}}, words)  # one of our own texts


def line(x: Array, y: Array, *others: Array) -> float:
    """Least-squares factor of x in y, beside others."""
    return float(np.linalg.lstsq(np.stack([x, *others], axis=1), y, rcond=None)[0][0])
