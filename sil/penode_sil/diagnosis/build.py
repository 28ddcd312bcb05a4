# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From hypotheses to a model that can be simulated and fitted: each elementary law becomes an element of the model."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.laws import LAWS
from penode_gen.model import GROUND, Element, Model

from .fit import Free
from .hypotheses import VALUED, Basis, Fault
from .plant import Place, extend, nominal
from .score import Candidate

Array = NDArray[np.float64]
SPREAD = {"1": 0.5, "m": 0.01, "m/s": 0.05, "N": 1e-3, "s": 1e-3, "rad": 0.01, "rad/s": 0.05, "N*m": 1e-3}  # of start states of laws
HEAVIEST = 0.5  # of its body: a hidden mass beyond that is another vehicle
BENT = 0.01  # [m] deflection of a hidden mass's spring where its bend would show
SLOWEST = 5.0  # [s] relaxation: what takes longer is a load
RANGES = {"presliding": (3.0, 10.0), "transition": (30.0, 3.0), "bend": (30.0, 2.2), "share": (1.3, 1.54)}  # of shapes, down and up


@dataclass(frozen=True, eq=False)
class Term:
    """A candidate with the gain that the regression gave it."""

    candidate: Candidate
    gain: float
    bend: float = 0.0  # N/m^3, of a hidden mass's spring
    own: str = ""  # parameter of the model that its gain is, for a law that takes away all of an element

    @property
    def group(self) -> tuple[str, str]:
        return self.candidate.kind, self.candidate.where


@dataclass(frozen=True, eq=False)
class Extended:
    """A model with terms in it: what is free in it beyond the nuisances, the faults of its sensors as series, and per term
    the names of its element and parameters."""

    model: Model
    free: tuple[Free, ...]
    faults: tuple[Fault, ...]
    loosened: frozenset[str]
    names: tuple[str, ...]


def element(term: Term, place: Place, name: str, model: Model) -> tuple[Element, dict[str, tuple[float, str]], list[Free]]:
    """The element of a force law, its parameters, and its free values."""
    what = term.candidate.what
    if not isinstance(what, Basis):  # an absorber
        _, _, f0, zeta = what
        w, m = 2.0 * np.pi * f0, max(term.gain, 1e-9)
        values = {"mass": (m, "kg"), "stiffness": (m * w * w, "N/m"), "damping": (2.0 * zeta * w * m, "N*s/m")}
        arguments = {key: f"{name}_{key}" for key in values}
        body = next(b for b in model.bodies if b.name in place.ends)
        most = {"mass": max(HEAVIEST * model.parameters[body.mass].value, m)}
        free = [Free(arguments[key], v, 1.0, log=True, low=1e-9, high=most.get(key, np.inf)) for key, (v, _) in values.items()]
        values["cubic"] = (term.bend, "N/m^3")
        free.append(Free(f"{name}_cubic", term.bend, 0.03 * m * w * w / BENT**2))
        arguments = {key: f"{name}_{key}" for key in values}
        return Element(name, (body.name, GROUND), "absorber", arguments), {arguments[k]: v for k, v in values.items()}, free
    gain, unit = what.gain
    size = max(abs(term.gain), 1e-12)
    low, high = (0.0, np.inf) if what.sign > 0 else (-np.inf, 0.0) if what.sign < 0 else (-np.inf, np.inf)
    start, whole = term.gain, nominal(model, place, "linear_damper", "damping", {})
    if what.kind == "damper_fading" and what.sign < 0 and whole > 0.0:  # farther than to nothing it does not fade, on whatever road
        low, start = -whole, max(start, -0.9 * whole)
    parameters = {} if term.own else {f"{name}_{gain}": (start, unit)}
    free = [Free(key, x, size, low=low, high=high) for key, (x, _) in parameters.items()]
    shapes = {f"{name}_{key}": value for key, value in what.shapes.items()}
    least = {f"{name}_{key}": value for key, value in what.least.items()}
    known = {f"{name}_{key}": value for key, value in what.fixed.items()}
    parameters |= shapes | known
    for key, (value, _) in shapes.items():
        below, above = RANGES.get(key.removeprefix(f"{name}_"), (30.0, 30.0))
        most = SLOWEST if key == f"{name}_relaxation" else np.inf
        free.append(Free(key, value, 1.0, log=True, low=max(value / below, least.get(key, 0.0)), high=min(value * above, most)))
    if what.law in LAWS:
        arguments = {key: f"{name}_{key}" for key in LAWS[what.law].arguments} | ({gain: term.own} if term.own else {})
        return Element(name, place.ends, what.law, arguments), parameters, free
    known = {gain: term.own} if term.own else {}
    text = re.sub(rf"\b({'|'.join((gain, *what.shapes, *what.fixed))})\b", lambda m: known.get(m[1], f"{name}_{m[1]}"), what.law)
    return Element(name, place.ends, "expression", expression=text), parameters, free


def extended(model: Model, places: Sequence[Place], terms: Sequence[Term], recordings: int, settled: int) -> Extended:
    """The model with all terms. States of laws start free in `recordings`, a body under a settled load in `settled`."""
    elements, parameters, where, names = [], {}, [], []
    free: list[Free] = []
    faults: list[Fault] = []
    loosened = set()
    for i, term in enumerate(terms):
        what = term.candidate.what
        names.append(f"x{i}")
        if isinstance(what, str):
            loosened.add(what)
        elif isinstance(what, Fault):
            size = max(abs(term.gain), 1e-12)
            if what.what in VALUED:
                free.append(Free((what.what, what.sensor), term.gain, size, low=0.0 if what.sign > 0 else -np.inf))
            else:
                free.append(Free(("fault", len(faults)), term.gain, size))
                faults.append(what)
        else:
            place = places[what.place if isinstance(what, Basis) else what[1]]
            one, values, own = element(term, place, names[-1], model)
            elements.append(one)
            where.append(place)
            parameters |= values
            free += own
    whole = extend(model, elements, parameters, where)
    if not recordings and any(isinstance(t.candidate.what, Basis) and t.candidate.what.settled for t in terms):
        free += [Free(("start", e, i), x, 1e-3) for e in range(settled) for i, x in enumerate(model.start[: len(model.bodies)])]
    for i, state in enumerate(whole.extra_states[len(model.extra_states) :], len(model.states)):
        sigma = SPREAD[state.unit]
        if state.name.endswith(("_faded", "_warm")):  # a damper may be warm already
            free += [Free(("start", e, i), 0.0, 0.1, sigma=0.3, low=0.0, high=1.0) for e in range(recordings)]
        elif not state.name.endswith("_elapsed"):
            free += [Free(("start", e, i), 0.0, 0.1 * sigma, sigma=sigma) for e in range(recordings)]
    return Extended(whole, tuple(free), tuple(faults), frozenset(loosened), tuple(names))


def all_free(nuisances: Sequence[Free], found: Extended) -> tuple[Free, ...]:
    """Nuisances, those that a hypothesis set free without their priors, and the free values of the terms."""
    loose = (
        replace(f, sigma=np.inf, low=min(0.0, 10.0 * f.origin), high=max(0.0, 10.0 * f.origin)) if f.target in found.loosened else f
        for f in nuisances
    )
    return (*loose, *found.free)
