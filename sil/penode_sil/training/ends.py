# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks of any shape, trained end to end: straight lines, random weights that are taught them, start states, first rows, all rows."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from penode_gen.networks import Network

from . import begin, curves, lines
from .curve import Curve
from .curves import Tell
from .dense import like
from .engine import Shape
from .port import Port, inputs_of
from .problem import Point, Problem
from .settings import SETTINGS
from .solve import Fit, Limits, solve

Array = NDArray[np.float64]


def train(
    problem: Problem,
    ports: Sequence[Port],
    shapes: Sequence[Network],
    bounds: Sequence[Callable[[Curve], Limits]],
    seed: int,
    tell: Tell,
    start: begin.Start,
    turn: int = 0,
) -> tuple[Problem, Fit]:
    """All networks of a problem, from random weights and the lines of a `turn`, or from what a `start` knows."""
    limits = curves.limits_of(problem, bounds)
    tell(0.02, "straight lines")
    first, straight = lines.fitted(problem, ports, limits, turn)
    seen = curves.seen_by(first, straight)
    first = curves.rescaled(first, straight, seen, ports)
    return _descend(first, _begin(first, straight, seen, ports, shapes, seed, start), limits, tell)


def _begin(
    problem: Problem,
    straight: Point,
    seen: Sequence[Array],
    ports: Sequence[Port],
    shapes: Sequence[Network],
    seed: int,
    start: begin.Start,
) -> Point:
    """Random weights in place of the lines, or those of a start."""
    found: list[Shape] = []
    for k, (port, network, line) in enumerate(zip(ports, shapes, straight.shapes, strict=True)):
        x = inputs_of(port, seen)
        if isinstance(line, Curve):
            line = begin.curve(port, start.networks[port.name], float(np.max(np.abs(x)))) if port.name in start.networks else line
            found.append(curves.curve_on(port, line, seen, min(SETTINGS.curves_coarse, port.knots)))
        else:
            scale, size = 2.0 * np.maximum(np.std(x, axis=0), 1e-12), float(np.max(problem.scale))
            known = start.networks.get(port.name)
            found.append(
                begin.dense(port, known, scale, size)
                if known is not None
                else like(network, scale, size, port.zero, seed + k).taught(*_lesson(line, x))
            )
    return Point(begin.ratios(start, problem.engine.free, problem.model, straight.ratios), straight.starts, tuple(found))


def _lesson(line: Shape, x: Array) -> tuple[Array, Array]:
    """Places that a line has been to, and beyond, with its values there: a network that gives nothing at first would let a body go that
    nothing else holds."""
    places = np.concatenate([x, 2.0 * x - x.mean(axis=0)])
    return places, line(places)


def _descend(problem: Problem, point: Point, limits: Callable[[Point], Limits], tell: Tell) -> tuple[Problem, Fit]:
    """Start states alone, weights on the first rows, then on everything."""
    samples = lines.rows(problem)
    short = problem.with_(records=tuple(r.first(samples) for r in problem.records))
    tell(0.0, "start states")
    point = solve(short.with_(frozen=True), point, 4, 1.0, damping=1e-3).point
    for k, iterations in enumerate((8, 8, 10)):
        tell(0.1 + 0.15 * k, "weights on the first rows")
        short = curves.renoised(short, point)
        point = solve(short, point, iterations, 5.0, limits, damping=1e-2).point
    whole = problem.with_(noise=short.noise)
    for k, iterations in enumerate((4, 8)):
        tell(0.6 + 0.15 * k, "weights on everything")
        whole = curves.renoised(whole, point)
        fit = solve(whole, point, iterations, SETTINGS.ends_close, limits, damping=1e-3)
        point = fit.point
    whole = curves.renoised(whole, point)
    tell(0.95, "weights on everything")
    return whole, solve(whole, point, 6, SETTINGS.ends_close, limits, damping=fit.damping)
