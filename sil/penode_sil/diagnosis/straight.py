# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The straight line that laws found at a place share with its linear element: what of it is a parameter that is off.

How much of a line is whose, of two elements in parallel, is a matter of writing it down: an asymmetric spring beside a stiffness k may be
that of either side, or of their mean. So a parameter is compared with all slopes that its element and the laws beside it have together: it
is off where none of these is within its tolerance.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from penode_gen import laws, units
from penode_gen.model import Model

from .catalogue import values as of_values
from .catalogue.form import Motion, Moved
from .evidence.bench import Bench
from .explanation import Explanation
from .hypotheses import Basis, size
from .naming import Curve
from .plant import Place
from .result import Cause, Value
from .study import Study
from .terms import Term
from .worth import LINEAR

Array = NDArray[np.float64]
Slopes = tuple[float, float]  # the least and the greatest
SIDES = {"difference", "rebound"}  # values of laws that are straight on either side


def off(nominal: float, own: float, slopes: Slopes, limit: float) -> bool:
    """Is a parameter, `own` as it is fitted, farther from its nominal value than its relative `limit`, with any of the slopes beside it?"""
    far = limit * abs(nominal)
    return not own + slopes[0] - far <= nominal <= own + slopes[1] + far


def beside(model: Model, bench: Bench, terms: Sequence[Term], moved: Sequence[Motion]) -> dict[str, Slopes]:
    """For each parameter of a linear law beside `terms` at its place: the fitted slopes of these terms."""
    found: dict[str, Slopes] = {}
    for k in {t.form.index for t in terms}:
        own, motion = [t for t in terms if t.form.index == k], moved[k]
        for parameter, quantity in _lines(model, bench.places[k]):
            reach = motion.s_reach if quantity == "s" else motion.v_reach
            found[parameter] = _slopes(own, bench, quantity, _grid(reach))
    return found


def missed(study: Study, e: Explanation, causes: Sequence[Cause]) -> list[Cause]:
    """Parameters of straight lines that are off beside laws with two sides, as causes of their own; the interval of each is from the least
    to the greatest slope. Of other laws a curve is put together from several, whose slopes say less."""
    values = {f.target: f.value for f in e.fit.free}
    known = {x for c in causes for x in c.parameters}
    found = []
    for k, place in enumerate(study.places):
        pairs = [
            (t, n)
            for t, n in zip(e.terms, e.built.names, strict=True)
            if isinstance(t.candidate.what, Basis) and t.candidate.what.place == k
        ]
        sure = [c.confidence for c in causes if (c.kind, c.where) in {t.group for t, _ in pairs} and c.parameters.keys() & SIDES]
        if len(sure) < len({t.group for t, _ in pairs}) or not sure:
            continue
        curve, reaches = Curve(*zip(*pairs, strict=True)), size([s.motions[k] for s in study.seen])
        for name, quantity in _lines(study.model, place):
            x = _grid(reaches["sv".index(quantity)])
            force = curve(x, 0.0 * x, values) if quantity == "s" else curve(0.0 * x, x, values)
            p, slopes = study.model.parameters[name], _range(force, x)
            own = values.get(name, p.value)
            if name not in known and not p.exact and off(p.value, own, slopes, p.tolerance):
                value = Value(own + 0.5 * sum(slopes), units.si(p.unit), (own + slopes[0], own + slopes[1]))
                found.append(of_values.cause(name, value, max(sure)))
    return found


def _grid(reach: float) -> Array:
    return np.linspace(-reach, reach, 401)


def _lines(model: Model, place: Place) -> list[tuple[str, str]]:
    """Parameters of the linear elements of a place, each with what it is the slope of."""
    names = {n for n, _ in place.elements}
    return [(p, LINEAR[e.law]) for e in model.elements if e.name in names and e.law in LINEAR for p in e.arguments.values()]


def _slopes(terms: Sequence[Term], bench: Bench, quantity: str, x: Array) -> Slopes:
    """Slopes of the laws of terms over deflection or rate. One with memory has any slope from 0 to its gain."""
    zeros, force, low, high = np.zeros_like(x), np.zeros_like(x), 0.0, 0.0
    along = Moved(x, zeros, np.arange(len(x)) * bench.step) if quantity == "s" else Moved(zeros, x, np.arange(len(x)) * bench.step)
    for gain, part in (pair for term in terms for pair in term.laws(bench.fit.values)):
        known = laws.LAWS.get(part.law)
        if part.force is not None or (known and known.states):
            low, high = low + min(gain, 0.0), high + max(gain, 0.0)
        else:
            force = force + gain * part.along(along)
    least, most = _range(force, x)
    return least + low, most + high


def _range(force: Array, x: Array) -> Slopes:
    slopes = np.gradient(force, x)
    return float(np.min(slopes)), float(np.max(slopes))
