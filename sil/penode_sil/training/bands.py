# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Error bands of a trained force: from noise, and from straight pieces between few knots.

A true force is curved. Between two knots it may differ from the chord, by width^2 * curvature / 8 in the middle, and that difference also
moves the knots, and the constant that two curves share. So the band is computed with one more knot in the middle of each piece, whose
distance from the chord has a prior deviation according to the bend of its neighbours. The error of the trained curve is then the sum of its
distance from the best such curve, which is known, and the error of that curve, given by its covariance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from .curve import Curve
from .dense import Dense
from .problem import Point, Problem
from .solve import Fit

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Band:
    """Where a fit ended, the same point with a knot more in each piece of its curves, and there `spread` [n, n] and `away` [n]: covariance
    of the unknowns, and the distance to the best."""

    point: Point
    fine: Point
    spread: Array
    away: Array

    @property
    def deviations(self) -> Array:
        """Standard deviation of each unknown."""
        return np.sqrt(np.maximum(np.diag(self.spread), 0.0) + self.away**2)

    def deviation(self, k: int) -> Callable[[Array], Array]:
        """The standard deviation of the k-th shape's force at places [n, inputs]: 1.96 of them hold 95 %."""
        before = sum(len(s.theta) for s in self.fine.shapes[:k])
        first = len(self.fine.ratios) + self.fine.starts.size + before
        own = slice(first, first + len(self.fine.shapes[k].theta))
        shape, fine = self.point.shapes[k], self.fine.shapes[k]

        def found(x: Array) -> Array:
            rows = fine.hats(x[:, 0]) if isinstance(fine, Curve) else _slopes(fine, x)
            noise = np.maximum(np.einsum("ij,jk,ik->i", rows, self.spread[own, own], rows), 0.0)
            left = rest(shape, x[:, 0]) if isinstance(shape, Curve) else 0.0
            return wide(rows @ self.away[own], np.sqrt(noise + left**2))

        return found


def wide(away: Array, deviation: Array, holds: float = 1.96) -> Array:
    """The deviation of which `holds` to both sides hold 95 % of a normal error about `away`, as they do of one about 0: what is known to be
    away is no noise, of which as much again would have to be held."""
    far, spread = np.abs(away), np.maximum(deviation, 1e-300)
    share = ndtr(holds) - ndtr(-holds)
    low, high = np.zeros_like(far), far + holds * spread
    for _ in range(50):  # halvings: to the last bit
        middle = 0.5 * (low + high)
        inside = ndtr((middle - far) / spread) - ndtr((-middle - far) / spread) >= share
        low, high = np.where(inside, low, middle), np.where(inside, middle, high)
    found: Array = high / holds
    return found


def of(problem: Problem, fit: Fit) -> Band:
    """The band where a fit ended; one more evaluation of the sensitivities."""
    point = fit.point
    fine = Point(point.ratios, point.starts, tuple(s.middled() if isinstance(s, Curve) else s for s in point.shapes))
    into, sags = _ways(point, fine)
    normal = problem.normal(fine) if len(sags) else fit.normal
    precision, origin = problem.with_(tied=None).prior(point)
    n = len(origin)
    curvature, slope = into.T @ normal.curvature @ into, into.T @ normal.slope
    curvature[:n, :n] += precision
    slope[:n] -= precision @ (point.vector - origin)
    curvature[n:, n:] += np.diag(sags**-2.0)
    scale = 1.0 / np.sqrt(np.diag(curvature))
    spread = np.linalg.inv(curvature * np.outer(scale, scale) + 1e-13 * np.eye(len(scale))) * np.outer(scale, scale)
    return Band(point, fine, into @ spread @ into.T, into @ (spread @ slope))


def sag(curve: Curve) -> Array:
    """Standard deviation of how far a smooth force is from each straight piece [n - 1] in its middle: it bends there as at the piece's
    ends."""
    wide = np.diff(curve.knots)
    bend = np.abs(np.diff(np.diff(curve.values) / wide)) / (0.5 * (wide[1:] + wide[:-1]))
    ends = np.concatenate([bend[:1], bend, bend[-1:]]) if len(bend) else np.zeros(2)
    least = 1e-9 * max(float(np.ptp(curve.values)), 1e-9)  # a straight line has a deviation too, or nothing could be inverted
    return np.maximum(wide**2 * 0.5 * (ends[1:] + ends[:-1]) / 8.0, least)


def rest(curve: Curve, x: Array) -> Array:
    """What is left of a sag at x when the middles are known: a quarter of it half way to them, nothing there and at the knots."""
    i = np.clip(np.searchsorted(curve.knots, x, side="right") - 1, 0, len(curve.knots) - 2)
    half = np.clip((x - curve.knots[i]) / np.diff(curve.knots)[i], 0.0, 1.0) * 2.0 % 1.0
    return sag(curve)[i] * half * (1.0 - half)


def _ways(point: Point, fine: Point) -> tuple[Array, Array]:
    """How unknowns of the fine point follow from those of the coarse one and from sags [fine, coarse + sags]; deviations of the sags."""
    n, m = len(point.vector), len(fine.vector)
    at = to = len(point.ratios) + point.starts.size
    first = np.zeros((m, n))
    first[:at, :at] = np.eye(at)
    more: list[Array] = []
    deviations: list[Array] = []
    for shape, middled in zip(point.shapes, fine.shapes, strict=True):
        columns, wide = len(shape.theta), len(middled.theta)
        if isinstance(shape, Curve) and isinstance(middled, Curve):
            free = np.delete(middled.knots, middled.zero) if middled.zero >= 0 else middled.knots
            first[to : to + wide, at : at + columns] = shape.hats(free)
            own = np.zeros((m, len(shape.knots) - 1))
            middles = 0.5 * (shape.knots[1:] + shape.knots[:-1])
            own[to + np.searchsorted(free, middles), np.arange(len(middles))] = 1.0
            more.append(own)
            deviations.append(sag(shape))
        else:
            first[to : to + wide, at : at + columns] = np.eye(wide)
        at, to = at + columns, to + wide
    return np.hstack([first, *more]), np.concatenate([*deviations, np.zeros(0)])


def _slopes(shape: Dense, at: Array) -> Array:
    """Derivatives [n, columns] of a network by its weights: differences, for a picture."""
    found = np.empty((len(at), shape.columns))
    for j in range(shape.columns):
        step = np.zeros(shape.columns)
        step[j] = 1e-4 * max(1.0, abs(shape.theta[j]))
        found[:, j] = (shape.with_theta(shape.theta + step)(at) - shape.with_theta(shape.theta - step)(at)) / (2.0 * step[j])
    return found
