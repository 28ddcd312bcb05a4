# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Damped Gauss-Newton, within linear limits where promises require them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve, cholesky, solve_triangular
from scipy.optimize import nnls

from .curve import Curve
from .problem import Normal, Point, Problem
from .resume import State
from .settings import SETTINGS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Limits:
    """rows @ unknowns >= least."""

    rows: Array
    least: Array

    @property
    def some(self) -> bool:
        return len(self.least) > 0


NONE = Limits(np.zeros((0, 0)), np.zeros(0))


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a fit ended. `ended`: it stopped because nothing more was gained, not because its iterations were used up."""

    point: Point
    cost: float
    normal: Normal
    damping: float
    iterations: int
    ended: bool


def least(curvature: Array, slope: Array, limits: Limits, at: Array) -> Array:
    """The step d of least d' curvature d / 2 - slope' d with limits on at + d (Lawson and Hanson, 1974: least distance)."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    scaled, along = curvature * np.outer(scale, scale), slope * scale
    scaled = scaled + 1e-12 * np.eye(len(scaled))
    if not limits.some:
        return scale * cho_solve(cho_factor(scaled), along)
    root = cholesky(scaled)  # scaled = root' root
    free = solve_triangular(root, along, trans="T")
    rows = solve_triangular(root, (limits.rows * scale).T, trans="T").T
    short = limits.least - limits.rows @ at - rows @ free
    size = np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
    rows, short = rows / size[:, None], short / size
    if np.all(short <= 0.0):
        return scale * solve_triangular(root, free)
    most = max(float(np.max(short)), 1e-300)
    stacked = np.vstack([rows.T, short[None, :] / most])
    target = np.zeros(len(stacked))
    target[-1] = 1.0
    multipliers, _ = nnls(stacked, target, maxiter=30 * stacked.shape[1])
    left = stacked @ multipliers - target
    if not left[-1] < -1e-12:
        raise RuntimeError("no step is within the limits")
    return scale * solve_triangular(root, free - left[:-1] * most / left[-1])


def solve(
    problem: Problem,
    point: Point,
    iterations: int,
    close: float = SETTINGS.solve_close,
    limits: Callable[[Point], Limits] = lambda point: NONE,
    damping: float = 1e-3,
    tell: Callable[[int], None] = lambda k: None,
    patience: int = 2,
) -> Fit:
    """From a point to the least cost. Two dampings are tried at once, then larger ones until one gains."""
    number, state = problem.journal.enter(
        [point.vector, *(s.knots for s in point.shapes if isinstance(s, Curve)), np.array([iterations, close, damping, patience])]
    )
    if state is None:
        state = State(point.vector, problem.cost(point), damping, 0, 0)
    if not np.isfinite(state.cost):
        raise FloatingPointError("the simulation left all bounds")
    point = point.placed(state.vector)
    normal = problem.normal(point)
    while state.steps < iterations and state.poor < patience:
        tell(state.steps + 1)
        found = _step(problem, point, normal, state, limits(point))
        if found is None:
            state = replace(state, poor=patience, steps=state.steps + 1)
        else:
            new, cost, used = found
            poor = state.poor + 1 if state.cost - cost < close else 0
            point, state = new, State(new.vector, cost, max(used, 0.1 * state.damping, 1e-9), poor, state.steps + 1)
            normal = problem.normal(point)
        problem.journal.note(number, state)
    return Fit(point, state.cost, normal, state.damping, state.steps, state.poor >= patience)


def _inside(curvature: Array, slope: Array, limits: Limits, point: Point) -> Array:
    """The step within the limits, and within those of the parameters where it would pass one: a parameter keeps its sign."""
    step = least(curvature, slope, limits, point.vector)
    n = len(point.ratios)
    if np.all(point.ratios + step[:n] >= SETTINGS.problem_least):
        return step
    rows = np.eye(n, len(step))
    low = np.full(n, SETTINGS.problem_least * (1.0 + 1e-6))  # more than what the solution is off by
    both = Limits(np.vstack([limits.rows, rows]), np.concatenate([limits.least, low])) if limits.some else Limits(rows, low)
    return least(curvature, slope, both, point.vector)


def _step(problem: Problem, point: Point, normal: Normal, state: State, limits: Limits) -> tuple[Point, float, float] | None:
    """The next point, its cost and the damping that led there; None where no damping gains."""
    precision, origin = problem.prior(point)
    curvature, slope = normal.curvature + precision, normal.slope - precision @ (point.vector - origin)
    diagonal = np.diag(curvature)
    extra = np.maximum(diagonal, SETTINGS.solve_floor * float(diagonal.max()))
    best: tuple[Point, float, float] | None = None
    full = ((0.0, 1.0), (0.0, 0.5)) if len(slope) <= SETTINGS.problem_wide else ()
    for d, share in (*full, *((by * state.damping, 1.0) for by in (0.1, 1.0, 10.0, 1e2, 1e3, 1e5))):
        try:
            step = _inside(curvature + np.diag(d * extra), slope, limits, point)
        except (np.linalg.LinAlgError, RuntimeError):
            continue
        new = point.moved(share * step)
        value = problem.cost(new)
        if value < (state.cost if best is None else best[1]) or (best is None and limits.some and state.steps == 0 and np.isfinite(value)):
            best = new, value, d
            if share == 1.0 and d == 0.0 and state.steps > 0:
                break
        elif best is not None and d >= state.damping:
            break
    return best
