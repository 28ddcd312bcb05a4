# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Straight lines in place of all networks: parameters, start states and the range of motion, the start of all later fits.

A network that nothing stands beside is 0 at first: its body is free, and within seconds a fit may take it anywhere, to half a metre beside
its place. So lines are fitted to the first rows, then to twice as many from where that ended, and so on: over few rows a free body goes
nowhere, and each fit begins within what the next one can see."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from . import data, unknown
from .curve import three
from .dense import Dense
from .engine import Shape
from .port import Port
from .problem import Point, Problem
from .settings import SETTINGS
from .solve import Fit, Limits, solve

Array = NDArray[np.float64]


def straight(port: Port) -> Dense:
    """A network's place with nothing but slopes, and a constant where it is not 0 at 0."""
    inputs = len(port.seen[0])
    return Dense((inputs, 1), ("identity",), np.zeros(inputs + 1), np.ones(inputs), 1.0, port.zero)


def bendable(port: Port, line: Dense) -> Shape:
    """The line of a network that will be a curve as one of two slopes; that of another one as it is."""
    if not port.knots:
        return line
    found = three(1.0, port.zero)
    return found.with_theta(line.theta[0] * (found.knots if not port.zero else np.delete(found.knots, 1)) + line.theta[1] * (not port.zero))


def rows(problem: Problem) -> int:
    """How many rows of each recording a fit sees at first: some seconds of a fast plant, and enough of a slow one."""
    return max(int(SETTINGS.lines_short / problem.model.sample_time), SETTINGS.lines_rows)


def _first(problem: Problem, samples: int) -> Problem:
    """The problem of the first rows; slopes are free, in the units of the model: how large forces are is not known yet."""
    return problem.with_(records=tuple(r.first(samples) for r in problem.records), scale=np.full(len(problem.scale), 1e6))


def _renoised(problem: Problem, point: Point) -> Problem:
    found = problem.residuals(point)
    if found is None:
        return problem
    return problem.with_(noise=data.of_residuals(found[0], [r.good for r in problem.records], problem.noise))


def simple(problem: Problem, ports: Sequence[Port]) -> tuple[Problem, Point]:
    """One line for each network, from a few rows on to all; the problem has the noise that they leave. FloatingPointError where the
    simulation diverges."""
    samples = max(len(r.y) for r in problem.records)
    own = _first(problem, samples)
    point = _growing(problem, own.begin([straight(p) for p in ports]), samples)
    return _renoised(own, point), point


def _growing(problem: Problem, point: Point, samples: int) -> Point:
    """Where lines end that see twice as many rows each time."""
    for doublings in reversed(range(7)):
        own = _first(problem, max(samples >> doublings, 100))
        for _ in range(2):  # measured by what lines leave, not by noise: or the priors would count for nothing
            own = _renoised(own, point)
            point = solve(own, point, 5, 20.0, damping=1e-2).point
    return point


def fitted(problem: Problem, ports: Sequence[Port], limits: Callable[[Point], Limits], turn: int = 0) -> tuple[Problem, Point]:
    """Parameters, start states and lines; two slopes in place of a network that will be a curve. `turn`: 0 for the best, 1 for where lines
    that see all rows at once end, more for places beside the best. FloatingPointError where the simulation diverges from every start."""
    samples = min(rows(problem), max(len(r.y) for r in problem.records))
    short = _first(problem, samples)
    nothing = short.begin([straight(p) for p in ports])
    ends: list[tuple[Problem, Fit]] = []
    for grows in (True, False):
        try:
            ends.append(_bent(short, _growing(problem, nothing, samples) if grows else nothing, ports, limits))
        except FloatingPointError:
            continue
    if not ends:
        raise FloatingPointError("the simulation left all bounds from every start")
    ends.sort(key=lambda end: left(*end))
    own, fit = ends[1 if turn == 1 and len(ends) > 1 else 0]
    tied = unknown.invisible(own, fit)
    point = solve(own.with_(tied=tied), fit.point, 2, 20.0, limits).point
    return problem.with_(noise=own.noise, tied=tied), _beside(point, turn) if turn > 1 else point


def _beside(point: Point, turn: int, by: float = 0.5) -> Point:
    """Other slopes, by a deviation of their logarithms: what a fit makes of them is another place where forces bend."""
    random = np.random.default_rng(turn)
    shapes = tuple(s.with_theta(s.theta * np.exp(by * random.standard_normal(len(s.theta)))) for s in point.shapes)
    return Point(point.ratios, point.starts, shapes)


def _bent(short: Problem, point: Point, ports: Sequence[Port], limits: Callable[[Point], Limits]) -> tuple[Problem, Fit]:
    """Two slopes from one."""
    shapes = tuple(bendable(p, s) if isinstance(s, Dense) else s for p, s in zip(ports, point.shapes, strict=True))
    point = Point(point.ratios, point.starts, shapes)
    for _ in range(3):
        short = _renoised(short, point)
        fit = solve(short, point, 5, 20.0, limits, damping=1e-2)
        point = fit.point
    return short, fit


def left(problem: Problem, fit: Fit) -> float:
    """What a fit leaves: the sum over the signals of the logarithms of their residuals, which asks for no unit and no stated noise."""
    found = _renoised(problem, fit.point).noise.level
    return float(np.sum(np.log(np.maximum(found, 1e-300))))
