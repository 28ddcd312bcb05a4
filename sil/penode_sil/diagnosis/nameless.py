# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A remaining structure that no cause on the list explains: a small network approximates it, without a name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from penode_gen.model import Element
from penode_gen.networks import Dense, Network

from .absorb import learn
from .build import Extended
from .explanation import COST, Explanation
from .fit import Fit, Free, Problem
from .hypotheses import Basis
from .plant import extend
from .study import Study, loss

HIDDEN = 8  # neurons, of deflection and rate: 32 weights
ITERATIONS = 30  # at the most
FIRST = 8  # after which it has to look promising
PROMISING = 0.225  # share of the avoidable residual that it must take by then, or the fit is given up
CLOSED = 1e-2  # of the avoidable residual: the fit ends where an iteration takes less
STARTS = 4  # of the regression before, which sees the force that the smoother estimates
POINTS = 1500


def fitted(study: Study, best: Explanation | None) -> Explanation | None:
    """A force k tanh(a s + b v + c), summed over HIDDEN neurons, beside the element that the best explanation is about: first
    taught what force the smoother sees there, then fitted by output error; None if it takes away too little for its weights."""
    at = [t.candidate.what.place for t in best.terms if isinstance(t.candidate.what, Basis)] if best else []
    place = next((k for k in [*at, *range(len(study.places))] if study.places[k].elements), None)
    if place is None or min(study.sizes[place]) <= 0.0:
        return None
    p, (reach, speed) = study.places[place], study.sizes[place]
    motions = [s.motions[place] for s in study.seen]
    x = np.concatenate([np.stack([m.s / reach, m.v / speed], axis=1) for m in motions])
    force = np.concatenate([s.forces[place] for s in study.seen])
    pick = np.random.default_rng(0).choice(len(x), min(len(x), POINTS), replace=False)
    tries = [learn(_random(seed, float(np.std(force))), x[pick], force[pick]) for seed in range(STARTS)]
    first, last = min(tries, key=lambda t: t[1])[0].layers
    parameters: dict[str, tuple[float, str]] = {}
    free = []
    for i, (row, offset, k) in enumerate(zip(first.weights, first.bias, last.weights[0], strict=True), 1):
        for key, start, scale, unit in (
            ("a", row[0] / reach, 1.0 / reach, "1/m"),
            ("b", row[1] / speed, 1.0 / speed, "s/m"),
            ("c", offset, 1.0, "1"),
            ("k", k, float(np.std(force)), "N"),
        ):
            parameters[f"nameless_{key}{i}"] = (float(start), unit)
            free.append(Free(f"nameless_{key}{i}", float(start), scale, sigma=10.0 * scale, origin=float(start)))
    text = " + ".join(f"nameless_k{i}*tanh(nameless_a{i}*s + nameless_b{i}*v + nameless_c{i})" for i in range(1, HIDDEN + 1))
    model = extend(study.model, [Element("nameless", p.ends, "expression", expression=text)], parameters, [p])
    problem = Problem(model, study.experiments, study.metrics, study.set_name, study.linear.fastest)
    plain = [replace(f, value=f.origin) if isinstance(f.target, str) else f for f in study.null.free]  # as it was stated
    close = max(CLOSED * avoidable(study), COST)
    fit = problem.solve((*plain, *free), FIRST, close)
    if not np.isfinite(fit.cost) or share(study, fit) < PROMISING:
        return None
    fit = problem.solve(fit.free, ITERATIONS - FIRST, close)
    gain = loss(study, study.null) - loss(study, fit)
    if gain < COST * len(free):
        return None
    return Explanation((), Extended(model, tuple(free), (), frozenset(), ()), problem, fit, gain)


def share(study: Study, fit: Fit) -> float:
    """What a fit takes away of the avoidable residual."""
    return min((study.null.cost - fit.cost) / max(avoidable(study), 1.0), 1.0)


def avoidable(study: Study) -> float:
    """The chi2 that the model as it is leaves beyond noise."""
    return study.null.cost - len(study.null.residual)


def beside(study: Study, e: Explanation) -> str:
    """The element that the network acts beside."""
    ends = e.built.model.elements[-1].ends
    return next(p.name for p in study.places if p.ends == ends)


def _random(seed: int, force: float) -> Network:
    """A network of two inputs about 1 and an output about `force`, without an offset of its own."""
    pick = np.random.default_rng(seed)
    first = Dense(pick.normal(0.0, 1.5, (HIDDEN, 2)), pick.normal(0.0, 1.0, HIDDEN), "tanh")
    return Network((first, Dense(pick.normal(0.0, force / HIDDEN, (1, HIDDEN)), np.zeros(1), "identity")), None, None, "nameless")
