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

from penode_gen import laws
from penode_gen.model import Model

from ..catalogue import values as of_values
from ..catalogue.form import Motion, Moved, Part
from ..evidence.bench import Bench
from ..plant.plant import Place
from .terms import Term
from .worth import LINEAR

Array = NDArray[np.float64]
Slopes = tuple[float, float]  # the least and the greatest


def off(nominal: float, own: float, slopes: Slopes, limit: float) -> bool:
    """Is a parameter, `own` as it is fitted, farther from its nominal value than its relative `limit`, with any of the slopes beside it?"""
    return of_values.is_off(own + slopes[0], own + slopes[1], nominal, limit)


def beside(model: Model, bench: Bench, terms: Sequence[Term], moved: Sequence[Motion]) -> dict[str, Slopes]:
    """For each parameter of a linear law beside `terms` at its place: the fitted slopes of these terms."""
    found: dict[str, Slopes] = {}
    for k in {t.form.index for t in terms}:
        own, motion = [t for t in terms if t.form.index == k], moved[k]
        for parameter, quantity in lines(model, bench.places[k]):
            found[parameter] = _slopes(own, bench, motion, quantity)
    return found


def lines(model: Model, place: Place) -> list[tuple[str, str]]:
    """Parameters of the linear elements of a place, each with what it is the slope of."""
    names = {n for n, _ in place.elements}
    return [(p, LINEAR[e.law]) for e in model.elements if e.name in names and e.law in LINEAR for p in e.arguments.values()]


def _slopes(terms: Sequence[Term], bench: Bench, motion: Motion, quantity: str) -> Slopes:
    """Slopes of the laws of terms over deflection or rate, as far as these reach. One with memory has any slope from none, which it has in
    slow motion, to that along the motion: below zero where it takes a part of an element."""
    reach = motion.s_reach if quantity == "s" else motion.v_reach
    x = np.linspace(-reach, reach, 401)
    zeros, force, low, high = np.zeros_like(x), np.zeros_like(x), 0.0, 0.0
    along = Moved(*((x, zeros) if quantity == "s" else (zeros, x)), np.arange(0.0, len(x)) * bench.step)
    for gain, part in (pair for term in terms for pair in term.laws(bench.fit.values)):
        known = laws.LAWS.get(part.law)
        if known and known.states:
            slope = gain * slope_along(part, motion, quantity)
            low, high = low + min(slope, 0.0), high + max(slope, 0.0)
        else:
            force = force + gain * part.along(along)
    least, most = _range(force, x)
    return least + low, most + high


def slope_along(part: Part, motion: Motion, quantity: str) -> float:
    """The straight line in the force of a law along a motion, for gain 1."""
    x, force = (np.concatenate(list(each)) for each in zip(*((getattr(m, quantity), part.along(m)) for m in motion.parts), strict=True))
    x = x - np.mean(x)
    return float(x @ force / (x @ x))


def _range(force: Array, x: Array) -> Slopes:
    slopes = np.gradient(force, x)
    return float(np.min(slopes)), float(np.max(slopes))
