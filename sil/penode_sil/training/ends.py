# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks of any shape, trained end to end: straight lines, then random small weights, start states, ten seconds, then all."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from penode_gen.networks import Network

from . import begin, curves, lines
from .curve import Curve
from .curves import Tell
from .dense import Dense, like
from .engine import Shape
from .port import Port, inputs_of
from .problem import Point, Problem
from .settings import SETTINGS
from .solve import Fit, Limits, solve

Array = NDArray[np.float64]


def loud(problem: Problem, point: Point) -> float:
    """How much more the residuals are than the noise that sensors state, at the most; 1 where none states any."""
    stated = np.array([s.noise for s in (*problem.model.sensors, *problem.model.outputs)])
    level = curves.renoised(problem, point).noise.level
    shown = np.array([any(r.good[:, j].any() for r in problem.records) for j in range(len(stated))])
    some = shown & (stated > 0.0)
    return float(np.max(level[some] / stated[some], initial=0.0)) if some.any() else 1.0


def train(
    problem: Problem,
    ports: Sequence[Port],
    shapes: Sequence[Network],
    bounds: Sequence[Callable[[Curve], Limits]],
    seed: int,
    tell: Tell,
    start: begin.Start,
) -> tuple[Problem, Fit]:
    """All networks of a problem; several random starts if one does not come down to the noise. What a `start` knows is tried first."""
    limits = curves.limits_of(problem, bounds)
    tell(0.02, "straight lines")
    first, straight = lines.fitted(problem, ports, limits)
    seen = curves.seen_by(first, straight)
    first = curves.rescaled(first, straight, seen, ports)
    best: tuple[Problem, Fit] | None = None
    for k in range(SETTINGS.ends_tries):
        own = _begin(first, straight, seen, ports, shapes, seed + 1000 * k, start if k == 0 else begin.Start())
        try:
            found = _descend(first, own, limits, _of_try(k, tell))
        except FloatingPointError:
            continue
        if best is None or loud(*_of(found)) < loud(*_of(best)):
            best = found
        if loud(*_of(best)) < SETTINGS.ends_good:
            break
    if best is None:
        raise FloatingPointError("the simulation left all bounds from every start")
    return best


def _of_try(k: int, tell: Tell) -> Tell:
    """Tells the progress of all tries, during one of them."""
    return lambda share, doing: tell((k + share) / SETTINGS.ends_tries, f"{doing}, try {k + 1}")


def _of(found: tuple[Problem, Fit]) -> tuple[Problem, Point]:
    return found[0], found[1].point


def _begin(
    problem: Problem, straight: Point, seen: Sequence[Array], ports: Sequence[Port], shapes: Sequence[Network], seed: int, start: begin.Start
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
            found.append(begin.dense(port, known, scale, size) if known is not None else like(network, scale, size, port.zero, seed + k))
    return Point(begin.ratios(start, problem.engine.free, problem.model, straight.ratios), straight.starts, tuple(found))


def _descend(problem: Problem, point: Point, limits: Callable[[Point], Limits], tell: Tell) -> tuple[Problem, Fit]:
    """Start states alone, weights on the first seconds, then on everything."""
    samples = lines.rows(problem, SETTINGS.ends_horizon, SETTINGS.ends_rows)
    short = problem.with_(records=tuple(r.first(samples) for r in problem.records))
    tell(0.0, "start states")
    point = solve(short.with_(frozen=True), point, 4, 1.0, damping=1e-3).point
    for k, iterations in enumerate((8, 8, 10)):
        tell(0.1 + 0.15 * k, "weights on the first seconds")
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
