# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A remaining structure that no cause on the list explains: a small network approximates it, without a name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from penode_gen.networks import Dense, Network

from ..catalogue.form import Form, Part
from ..evidence.bench import Bench
from ..evidence.fit import Fit
from ..evidence.observer import Filter
from ..plant.plant import extend
from ..search.terms import Term, element
from ..study.fit import Free
from ..study.missing import missing_forces
from ..study.smoother import size
from ..study.study import Study
from .absorb import learn

HIDDEN = 8  # neurons, of deflection and rate: 32 weights
ITERATIONS = 30  # at the most
FIRST = 8  # after which it has to look promising
PROMISING = 0.225  # share of the residual power that it must take by then, or the fit is given up
CLOSED = 1e-3  # of the log likelihood gained so far: the fit ends where an iteration takes less
COST = 5.0  # log likelihood that it must gain for each of its weights
STARTS = 4  # of the regression before, which sees the force that the smoother estimates
POINTS = 1500
NAME, ELEMENT = "nameless", "x89_0_0"  # in a model file, and in the bench, where names of terms have this form


@dataclass(frozen=True, eq=False)
class Nameless:
    """The bench with a network beside an element, its `term`; the free `run` with it, and its `share` of the residual power."""

    bench: Bench
    term: Term
    run: Fit
    share: float


def fitted(study: Study, bench: Bench, run: Fit, terms: Sequence[Term]) -> Nameless | None:
    """A force k tanh(a s + b v + c), summed over HIDDEN neurons, beside an element: at the place of the first of the `terms` found, or
    where a force can make up for most of the residual. First taught what force the smoother sees there, then fitted as a free run beside
    these terms; None if it takes away too little for its weights."""
    at = _place(study, terms)
    if at is None:
        return None
    place, (part, weights) = study.places[at], _taught(study, at)
    parameters = {str(f.target): (f.value, u) for f, u in zip(weights, _units(part), strict=True)}
    model = extend(bench.model, [element(ELEMENT, place.ends, part)], parameters, [place])
    problem, still = bench.problem(model), Filter.none(len(model.states), len(bench.noise))
    fit = problem.solve((*run.free, *weights), still, FIRST)
    if not np.isfinite(fit.cost) or run.taken_whole(fit, problem.floor) < PROMISING:
        return None
    fit = problem.solve(fit.free, still, ITERATIONS - FIRST, CLOSED * (fit.likelihood - run.likelihood))
    if fit.likelihood - run.likelihood < COST * len(weights):
        return None
    term = Term(Form(NAME, place.name, "force", at, (part,)), (ELEMENT,), tuple(weights))
    return Nameless(replace(bench, model=model), term, fit, run.taken_whole(fit, problem.floor))


def _units(part: Part) -> list[str]:
    """Units of the arguments of a law, in their order."""
    return [part.gain[1], *(unit for _, unit in part.shapes.values())]


def _place(study: Study, terms: Sequence[Term]) -> int | None:
    """Where the network acts: a place that has elements and moves; None without any."""
    shown = {m.place: m.share for m in missing_forces(study)}
    found = [t.form.index for t in terms if t.form.how == "force"]
    found += sorted(range(len(study.places)), key=lambda k: -shown.get(study.places[k], 0.0))
    return next((k for k in found if study.places[k].elements and min(size([s.motions[k] for s in study.seen])) > 0.0), None)


def _taught(study: Study, at: int) -> tuple[Part, list[Free]]:
    """The network as a law, and its weights as free values, taught what force the smoother sees at a place."""
    motions = [s.motions[at] for s in study.seen]
    reach, speed = size(motions)
    x = np.concatenate([np.stack([m.s / reach, m.v / speed], axis=1) for m in motions])
    force = np.concatenate([s.forces[at] for s in study.seen])
    pick = np.random.default_rng(0).choice(len(x), min(len(x), POINTS), replace=False)
    tries = [learn(_random(seed, float(np.std(force))), x[pick], force[pick]) for seed in range(STARTS)]
    first, last = (layer for layer in min(tries, key=lambda t: t[1])[0].layers if isinstance(layer, Dense))
    free, shapes = [], {}
    for i, (row, offset, k) in enumerate(zip(first.weights, first.bias, last.weights[0], strict=True), 1):
        for key, start, scale, unit in (
            ("k", k, float(np.std(force)), "N"),
            ("a", row[0] / reach, 1.0 / reach, "1/m"),
            ("b", row[1] / speed, 1.0 / speed, "s/m"),
            ("c", offset, 1.0, "1"),
        ):
            shapes[f"{key}{i}"] = (float(start), unit)
            free.append(Free(f"{ELEMENT}_{key}{i}", float(start), scale, sigma=10.0 * scale, origin=float(start)))
    text = " + ".join(f"k{i}*tanh(a{i}*s + b{i}*v + c{i})" for i in range(1, HIDDEN + 1))
    return Part(text, ("k1", shapes.pop("k1")[1]), shapes), free


def _random(seed: int, force: float) -> Network:
    """A network of two inputs about 1 and an output about `force`, without an offset of its own."""
    pick = np.random.default_rng(seed)
    first = Dense(pick.normal(0.0, 1.5, (HIDDEN, 2)), pick.normal(0.0, 1.0, HIDDEN), "tanh")
    return Network((first, Dense(pick.normal(0.0, force / HIDDEN, (1, HIDDEN)), np.zeros(1), "identity")), None, None, NAME)
