# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What recordings cannot tell, from the curvature of the fit: found, named in words, never guessed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .curve import Curve
from .port import Port
from .problem import Problem
from .settings import SETTINGS
from .solve import Fit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Unknown:
    """`kind`: scale, combination, split or range; `text` for people; `names` of parameters and networks; `size`: relative for
    parameters, N for a split."""

    kind: str
    text: str
    names: tuple[str, ...]
    size: float


def find(problem: Problem, fit: Fit, ports: Sequence[Port], visited: Sequence[Array]) -> list[Unknown]:
    """All that is not known after a fit; `visited` holds each network's inputs [n, inputs]."""
    return [*_parameters(problem, fit), *_splits(problem, fit, ports, visited)]


def _parameters(problem: Problem, fit: Fit) -> list[Unknown]:
    """Directions of the parameters along which the data say less than the model file."""
    names, values, vectors, deviation = _seen(problem, fit)
    return [
        _direction(problem, names, vector * deviation / np.sqrt(max(value, 0.0) + 1.0))
        for value, vector in zip(values, vectors.T, strict=True)
        if value < SETTINGS.unknown_invisible**-2.0
    ]


def invisible(problem: Problem, fit: Fit) -> Array:
    """Directions [., free] of the parameters, of length 1, along which no sensor changes at all."""
    names, values, vectors, deviation = _seen(problem, fit)
    found = np.zeros((int(np.sum(values < SETTINGS.unknown_nothing)), len(problem.engine.free)))
    for row, vector in zip(found, vectors.T[values < SETTINGS.unknown_nothing], strict=True):
        row[[problem.engine.free.index(n) for n in names]] = vector * deviation / np.linalg.norm(vector * deviation)
    return found


def _seen(problem: Problem, fit: Fit) -> tuple[list[str], Array, Array, Array]:
    """Names of free parameters; eigenvalues and vectors of the information in the data relative to that of the file; its deviations."""
    names = [n for n in problem.engine.free if n not in problem.held]
    at = np.array([problem.engine.free.index(n) for n in names], dtype=int)
    if not len(at):
        return [], np.zeros(0), np.zeros((0, 0)), np.zeros(0)
    prior, _ = problem.with_(tied=None).prior(fit.point)
    whole = fit.normal.curvature
    rest = np.setdiff1d(np.arange(len(whole)), at)
    inner = whole[np.ix_(rest, rest)] + prior[np.ix_(rest, rest)]
    scale = 1.0 / np.sqrt(np.diag(inner))
    across = whole[np.ix_(rest, at)] * scale[:, None]
    left = whole[np.ix_(at, at)] - across.T @ np.linalg.solve(inner * np.outer(scale, scale) + 1e-13 * np.eye(len(rest)), across)
    deviation = 1.0 / np.sqrt(np.diag(prior)[at])
    values, vectors = np.linalg.eigh((left + left.T) / 2.0 * np.outer(deviation, deviation))
    return names, values, vectors, deviation


def _direction(problem: Problem, names: Sequence[str], by: Array) -> Unknown:
    """A direction in words; `by` are relative changes of one standard deviation."""
    some = np.abs(by) >= SETTINGS.unknown_part * np.max(np.abs(by))
    chosen = tuple(n for n, s in zip(names, some, strict=True) if s)
    size = float(np.sqrt(np.mean(by[some] ** 2)))
    like = np.ptp(by[some]) < 0.3 * np.max(np.abs(by[some])) and some.sum() > 1
    masses = {b.mass for b in problem.model.bodies}
    if like and masses & set(chosen) and problem.engine.networks:
        weigh = sorted(masses & set(chosen))[0]
        text = (
            f"the common scale of {', '.join(chosen)} and of all forces of the networks is invisible: all of them may be "
            f"{100 * size:.1f} % larger or smaller together, and no sensor would differ; weigh one mass and give it, --known {weigh}"
        )
        return Unknown("scale", text, (*chosen, *problem.engine.networks), size)
    if len(chosen) == 1:
        text = (
            f"{chosen[0]} cannot be identified from these recordings; its value is that of the model file, to {100 * size:.1f} %; "
            f"measure it and give it, --known {chosen[0]}"
        )
    else:
        parts = ", ".join(f"{n} {'up' if b > 0 else 'down'} {100 * abs(b):.1f} %" for n, b, s in zip(names, by, some, strict=True) if s)
        text = f"{parts} together change no sensor; measure one of them and give it, --known {chosen[0]}"
    return Unknown("combination", text, chosen, size)


def _splits(problem: Problem, fit: Fit, ports: Sequence[Port], visited: Sequence[Array]) -> list[Unknown]:
    """Constants that may move from one network to another between the same ends."""
    ends = {e.network: frozenset(e.ends) for e in problem.model.elements if e.network}
    prior, _ = problem.prior(fit.point)
    curvature = fit.normal.curvature + prior
    scale = 1.0 / np.sqrt(np.diag(curvature))
    spread = np.linalg.inv(curvature * np.outer(scale, scale) + 1e-13 * np.eye(len(scale))) * np.outer(scale, scale)
    at = len(fit.point.ratios) + fit.point.starts.size
    rows: dict[str, tuple[int, Curve, Array]] = {}
    for port, shape, x in zip(ports, fit.point.shapes, visited, strict=True):
        if isinstance(shape, Curve):
            rows[port.name] = (at, shape, x[:, 0])
        at += len(shape.theta)
    found = []
    names = list(rows)
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            if ends.get(one) is None or ends.get(one) != ends.get(other):
                continue
            size = _constant(*rows[one], spread)
            span = max(float(np.ptp(rows[n][1](rows[n][2]))) for n in (one, other))
            if size > SETTINGS.unknown_split * span / 4.0:
                text = (
                    f"a constant force may move between {one} and {other} by {size:.2g} N (1 sigma): only the few samples where one of "
                    "them passes 0 tell them apart"
                )
                found.append(Unknown("split", text, (one, other), size))
    return found


def _constant(at: int, shape: Curve, x: Array, spread: Array) -> float:
    """Standard deviation [N] of the mean height of a curve where it is visited, both sides of 0 alike."""
    values = np.sort(x)[:: max(1, len(x) // 500)]
    mean = np.zeros(len(spread))
    mean[at : at + shape.columns] = np.mean(shape.hats(values), axis=0)
    return math.sqrt(max(float(mean @ spread @ mean), 0.0))
