# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noises of a filter, fitted to recordings by the likelihood of the innovations."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from penode_gen.model import Filter, Model

from ..errors import WrongUse
from .estimates import of
from .innovations import Consistency, consistency, log_likelihood
from .recorded import Measured
from .variable import Key, Variable

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Tuned:
    """Factors of the noises by table and name; those in `idle` might as well be zero. `evaluations`: runs over all recordings."""

    factors: dict[Key, float]
    idle: tuple[Key, ...]
    before: Consistency
    after: Consistency
    held_out: tuple[Consistency, Consistency] | None
    evaluations: int


def free(given: Filter, sensors: bool) -> list[Key]:
    """Noises that can be fitted: those of the file above zero; of sensors only if asked for."""
    found = [("states", s.name) for s in given.states if s.noise > 0.0] + [("inputs", i.name) for i in given.inputs]
    found += [("parameters", p.name) for p in given.parameters]
    return found + ([("sensors", s.name) for s in given.sensors] if sensors else [])


class Search:
    """The negative logarithm of the likelihood over the logarithms of the factors, over recordings."""

    def __init__(self, filters: Variable, keys: Sequence[Key], recordings: Sequence[Measured], tell: Callable[[int], None]):
        self.filters, self.keys, self.tell = filters, keys, tell
        self.given, self.data = filters.given, _data(recordings)
        self.evaluations = 0
        self.count = log_likelihood(self.given, filters.run({}, self.data))[1]

    def factors(self, logs: Array) -> dict[Key, float]:
        return dict(zip(self.keys, np.exp(logs).tolist(), strict=True))

    def __call__(self, logs: Array) -> float:
        """A mean over the measurements; 1e6 where a noise lets a sample fail that the file's noises can do."""
        self.evaluations += 1
        self.tell(self.evaluations)
        total, count = log_likelihood(self.given, self.filters.run(self.factors(logs), self.data))
        return -total / self.count if np.isfinite(total) and count == self.count else 1e6

    def slopes(self, logs: Array, step: float = 1e-2) -> Array:
        """By central differences, wide enough for gates that open and close."""
        steps = step * np.eye(logs.size)
        return np.array([(self(logs + s) - self(logs - s)) / (2.0 * step) for s in steps])

    def best(self, decades: int = 4, rounds: int = 3) -> Array:
        """BFGS within `decades` of the file's noises: from the best of all process noises times the same power of ten, then from the best
        of one noise times a power of ten, since a noise that is too small to be seen has no slope."""
        process = np.array([table != "sensors" for table, _ in self.keys], float)
        bounds = [(-decades * np.log(10.0), decades * np.log(10.0))] * len(self.keys)
        ftol = 0.1 / self.count  # a tenth of the logarithm of the likelihood
        at: Array = min([np.log(10.0) * power * process for power in range(1 - decades, decades)], key=self)
        for _ in range(rounds):
            end = minimize(self, at, jac=self.slopes, method="L-BFGS-B", bounds=bounds, options={"ftol": ftol, "maxiter": 60}).x
            at = min([at, end], key=self)
            moved = [np.clip(at + np.log(10.0) * power * one, *np.array(bounds).T) for one in np.eye(at.size) for power in (-1, 1, 2)]
            other = min(moved, key=self)
            if (self(at) - self(other)) * self.count < 1.0:
                break
            at = other
        return at

    def idle(self, logs: Array, decades: int = 3, least: float = 2.0) -> tuple[Key, ...]:
        """Noises but those of sensors that a thousandth would replace: the logarithm of the likelihood falls by less than `least`."""
        at = self(logs)
        found = []
        for k, key in enumerate(self.keys):
            less = logs - decades * np.log(10.0) * np.eye(logs.size)[k]
            if key[0] != "sensors" and (self(less) - at) * self.count < least:
                found.append(key)
        return tuple(found)


def _data(recordings: Sequence[Measured]) -> list[tuple[Array, Array, Any]]:
    return [(r.u, r.z, r.mask) for r in recordings]


def fit(
    model: Model,
    set_name: str,
    recordings: Sequence[Measured],
    held_out: Sequence[Measured],
    sensors: bool,
    tell: Callable[[int], None] = lambda n: None,
) -> Tuned:
    """Fit to recordings; `held_out` are only looked at. Raises WrongUse if the file leaves nothing to fit."""
    given, keys = of(model), free(of(model), sensors)
    if not keys:
        raise WrongUse(
            f"{model.path}: no state, input or parameter of [filter] has a noise above zero; give one to start from, or --sensors"
        )
    filters = Variable(model, set_name)
    search = Search(filters, keys, recordings, tell)
    logs = search.best()
    factors, idle = search.factors(logs), search.idle(logs)

    def looked(factors: Mapping[Key, float], on: Sequence[Measured]) -> Consistency:
        return consistency(given, filters.run(factors, _data(on)))

    before, after, *rest = (looked(f, on) for on, f in itertools.product((recordings, held_out), ({}, factors)) if on)
    return Tuned(factors, idle, before, after, (rest[0], rest[1]) if rest else None, search.evaluations)
