# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How much a curve may bend where a fit leaves more than noise: as much as predicts parts of the recordings that it was not fitted to.

What a model lacks is no noise: it is alike from sample to sample, and a fit that counts each sample as news follows it with every knot. So
the size of a network's force, by which its bends are measured, is chosen by held-out parts, each some consecutive samples of a recording:
the part's error as predicted from all others, by the normal equations of each part where the fit ended (cross-validation with one standard
error; Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 7.10). 0 is among the sizes: a network that predicts nothing
is 0."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import left
from .curve import Curve
from .problem import Point, Problem
from .settings import SETTINGS
from .solve import Fit, Limits, solve

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Part:
    """Normal equations of a part of the recordings, curvature [n, n] and slope [n], and its chi2 where they were made."""

    curvature: Array
    slope: Array
    chi2: float


def loud(problem: Problem, point: Point) -> bool:
    """Is the residual of a sensor above its stated noise? False if none is stated."""
    found = left.of(problem, point)
    return found is not None and bool(found.above(SETTINGS.story_loud))


def parts(problem: Problem, point: Point, count: int = 8) -> list[Part]:
    """`count` consecutive parts of each recording."""
    found = []
    for k in range(count):
        own = []
        for r in problem.records:
            n = len(r.good)
            inside = np.zeros((n, 1), dtype=bool)
            inside[n * k // count : n * (k + 1) // count] = True
            own.append(replace(r, good=r.good & inside))
        part = problem.with_(records=tuple(own))
        if part.samples:
            normal = part.normal(point)
            found.append(Part(normal.curvature, normal.slope, part.chi2(point)))
    return found


def predicted(found: list[Part], precision: Array, pull: Array) -> Array:
    """chi2 of each part [parts] with what all others say; `precision` [n, n] and `pull` [n]: of the prior, and the way that it pulls."""
    curvature, slope = sum(p.curvature for p in found) + precision, sum(p.slope for p in found) + pull
    scores = []
    for p in found:
        others = curvature - p.curvature
        scale = 1.0 / np.sqrt(np.maximum(np.diag(others), 1e-300))
        step = scale * np.linalg.solve(others * np.outer(scale, scale) + 1e-12 * np.eye(len(scale)), (slope - p.slope) * scale)
        scores.append(p.chi2 - 2.0 * float(p.slope @ step) + float(step @ p.curvature @ step))
    return np.array(scores)


def sizes(problem: Problem, point: Point) -> Array:
    """Size of each network's force, over that of the problem: the smallest that predicts no worse than the best by more than a standard
    error."""
    found, factors = parts(problem, point), np.ones(len(problem.scale))
    if len(found) < 2:
        return factors
    tried = (*np.geomspace(1.0, 1e-2, 5), 1e-6)  # 1e-6: none
    for _ in range(2):
        for k, shape in enumerate(point.shapes):
            if not isinstance(shape, Curve):
                continue
            scores = []
            for factor in tried:
                by = np.where(np.arange(len(factors)) == k, factor, factors)
                precision, origin = problem.with_(scale=problem.scale * by).prior(point)
                scores.append(predicted(found, precision, -precision @ (point.vector - origin)))
            best = min(scores, key=lambda s: float(s.sum()))
            more = [s - best for s in scores]
            fine = [i for i, m in enumerate(more) if m.mean() <= m.std(ddof=1) / np.sqrt(len(m))]
            factors[k] = tried[max(fine)]
    return factors


def bent(problem: Problem, fit: Fit, limits: Callable[[Point], Limits]) -> tuple[Problem, Fit]:
    """The fit with curves that bend as held-out parts allow."""
    own = problem.with_(scale=problem.scale * sizes(problem, fit.point))
    return own, solve(own, fit.point, 6, 1.0, limits, damping=1e-6)
