# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Piecewise linear networks of one input by way of curves: straight lines first, then knots where the recordings require them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from . import data, lines
from .curve import Curve, bent, fewer, spaced, without
from .port import Port, inputs_of
from .problem import Point, Problem, replaced
from .settings import SETTINGS
from .solve import NONE, Fit, Limits, solve

Array = NDArray[np.float64]
Tell = Callable[[float, str], None]
POWERS = {"rate": 2.0, "place": 1.2}  # how dense knots are about 0: friction turns within millimetres a second


def grid(port: Port, low: float, high: float, count: int) -> Array:
    """Knots over a range: dense about 0 where the network is 0 there, else alike."""
    if not port.zero:
        return np.linspace(low, high, count)
    return spaced(low, high, count, POWERS["rate" if port.rate else "place"])


def curve_on(port: Port, before: Curve, seen: Sequence[Array], count: int) -> Curve:
    """The curve of before on new knots over the range that is visited now."""
    x = inputs_of(port, seen)[:, 0]
    if not port.zero:
        middle, half = 0.5 * float(x.max() + x.min()), 0.5 * SETTINGS.curves_wider * max(float(np.ptp(x)), 1e-12)
        return before.on(grid(port, middle - half, middle + half, count))
    low, high = SETTINGS.curves_wider * min(float(x.min()), 0.0), SETTINGS.curves_wider * max(float(x.max()), 0.0)
    reach = max(high, -low, 1e-12)
    return before.on(grid(port, min(low, -1e-3 * reach), max(high, 1e-3 * reach), count))


def limits_of(problem: Problem, bounds: Sequence[Callable[[Curve], Limits]]) -> Callable[[Point], Limits]:
    """Limits on all unknowns from those on each curve; `bounds`: one for each shape, or none at all."""

    def found(point: Point) -> Limits:
        n = len(point.vector)
        at, rows, least = len(point.ratios) + point.starts.size, [], []
        for shape, bound in zip(point.shapes, bounds, strict=bool(bounds)):
            if isinstance(shape, Curve):
                own = bound(shape)
                if own.some:
                    wide = np.zeros((len(own.least), n))
                    wide[:, at : at + shape.columns] = own.rows
                    rows.append(wide)
                    least.append(own.least)
            at += len(shape.theta)
        return Limits(np.vstack(rows), np.concatenate(least)) if rows else NONE

    return found


def rescaled(problem: Problem, point: Point, seen: Sequence[Array], ports: Sequence[Port]) -> Problem:
    """The problem with the size of each network's force as it is now, and at least a hundredth of the largest."""
    spans = np.array(
        [
            float(np.ptp(s(inputs_of(p, seen) if p.knots == 0 else inputs_of(p, seen)[:, 0])))
            for s, p in zip(point.shapes, ports, strict=True)
        ]
    )
    apart = tuple(a.visited(inputs_of(ports[a.shape], seen)[:, 0]) for a in problem.apart)
    values = dict(zip(problem.model.parameters, problem.parameters(point), strict=True))
    for a in apart:  # a network that takes only what a parameter cannot has no slopes of its own at first: it is measured by the parameter
        spans[a.shape] = max(spans[a.shape], float(np.ptp(values[a.parameter] * a.sensitivity(a.x))))
    return problem.with_(scale=np.maximum(spans, max(1e-2 * float(spans.max(initial=0.0)), 1e-9)), apart=apart)


def renoised(problem: Problem, point: Point) -> Problem:
    """The problem with the noise that its residuals show."""
    found = problem.residuals(point)
    if found is None:
        return problem
    return problem.with_(noise=data.of_residuals(found[0], [r.good for r in problem.records], problem.noise))


def seen_by(problem: Problem, point: Point) -> list[Array]:
    """Inputs of the networks. FloatingPointError where the simulation diverges."""
    found = problem.residuals(point)
    if found is None:
        raise FloatingPointError("the simulation left all bounds")
    return found[1]


def _curves(point: Point) -> list[Curve]:
    """The shapes of a point, all of which are curves."""
    found = [shape for shape in point.shapes if isinstance(shape, Curve)]
    assert len(found) == len(point.shapes)
    return found


def train(
    problem: Problem,
    ports: Sequence[Port],
    bounds: Sequence[Callable[[Curve], Limits]],
    tell: Tell,
    start: Callable[[Problem, Point], Point] = lambda problem, point: point,
    turn: int = 0,
) -> tuple[Problem, Fit]:
    """Curves for all networks of a problem; `start` puts what is known already in place of straight lines, which are those of a `turn`."""
    limits = limits_of(problem, bounds)
    tell(0.05, "straight lines")
    problem, point = lines.fitted(problem, ports, limits, turn)
    point = start(problem, point)
    problem = problem.with_(plain=True)
    for share, count, iterations in ((0.15, SETTINGS.curves_coarse, 8), (0.35, SETTINGS.curves_coarse, 4)):
        tell(share, f"curves of {count} knots")
        seen = seen_by(problem, point)
        problem = rescaled(problem, point, seen, ports)
        for i, port in enumerate(ports):
            before = _curves(point)[i]
            point = replaced(point, i, curve_on(port, before, seen, min(max(count, len(before.knots)), port.knots)))
        fit = solve(problem, point, iterations, 20.0, limits, patience=1)
        point = fit.point
        problem = renoised(problem, point)
    tell(0.55, "where knots are wanted")
    problem, point = chosen(problem, point, ports, limits)
    problem = problem.with_(plain=False)
    tell(0.75, "the curves")
    fit = solve(problem, point, 10, 1.0, limits, damping=1e-6)
    problem = renoised(problem, fit.point)
    tell(0.9, "the curves")
    return problem, solve(problem, fit.point, 6, 1.0, limits, damping=1e-6)


def chosen(problem: Problem, point: Point, ports: Sequence[Port], limits: Callable[[Point], Limits]) -> tuple[Problem, Point]:
    """Curves on a regular grid of as many knots as there is room for, and on others in the middle between them where data want them
    there."""
    seen = seen_by(problem, point)
    problem = rescaled(problem, point, seen, ports)
    grids = [curve_on(p, s, seen, p.knots) for p, s in zip(ports, _curves(point), strict=True)]
    point = Point(point.ratios, point.starts, tuple(g.middled() for g in grids))
    fit = solve(problem, point, 3, 20.0, limits, damping=1e-6, patience=1)
    spread = covariance(problem, fit)
    at, shapes = len(point.ratios) + point.starts.size, []
    for port, grid_, shape in zip(ports, grids, _curves(fit.point), strict=True):
        own = spread[at : at + shape.columns, at : at + shape.columns]
        at += shape.columns
        if shape.zero >= 0:
            own = np.insert(np.insert(own, shape.zero, 0.0, axis=0), shape.zero, 0.0, axis=1)
        regular = np.isin(shape.knots, grid_.knots)
        want = (
            fewer(shape.knots, shape.values, own, port.knots, regular, shape.zero)
            if bent(shape.knots, shape.values, own, regular)
            else regular
        )
        left = Curve(shape.knots[want], without(shape.knots, shape.values, own, want), -1)
        shapes.append(left if shape.zero < 0 else replace(left, zero=int(np.flatnonzero(left.knots == 0.0)[0])))
    return problem, Point(fit.point.ratios, fit.point.starts, tuple(shapes))


def covariance(problem: Problem, fit: Fit) -> Array:
    """Covariance of all unknowns at the end of a fit."""
    curvature = fit.normal.curvature + problem.with_(tied=None).prior(fit.point)[0]
    scale = 1.0 / np.sqrt(np.diag(curvature))
    scaled = curvature * np.outer(scale, scale) + 1e-13 * np.eye(len(scale))
    return np.linalg.inv(scaled) * np.outer(scale, scale)
