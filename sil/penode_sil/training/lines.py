# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Straight lines in place of all networks: parameters, start states and the range of motion that everything later leans on.

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
FREE = 1e6  # slopes are free, in the units of the model: how large forces are is not known yet


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


def rows(problem: Problem, seconds: float, most: int) -> int:
    """How many rows some seconds are; at least `most`, for a slow plant shows little in them."""
    return max(int(seconds / problem.model.sample_time), most)


def _first(problem: Problem, samples: int) -> Problem:
    return problem.with_(records=tuple(r.first(samples) for r in problem.records), scale=np.full(len(problem.scale), FREE))


def _renoised(problem: Problem, point: Point) -> Problem:
    found = problem.residuals(point)
    if found is None:
        return problem
    return problem.with_(noise=data.of_residuals(found[0], [r.good for r in problem.records], problem.noise))


def _growing(problem: Problem, point: Point, samples: int) -> Point:
    """Where lines end that see twice as many rows each time."""
    for doublings in range(SETTINGS.lines_doublings, -1, -1):
        own = _first(problem, max(samples >> doublings, SETTINGS.lines_least))
        for _ in range(2):  # measured by what lines leave, not by noise: or the priors would count for nothing
            own = _renoised(own, point)
            point = solve(own, point, 5, 20.0, damping=1e-2).point
    return point


def fitted(problem: Problem, ports: Sequence[Port], limits: Callable[[Point], Limits]) -> tuple[Problem, Point]:
    """Parameters, start states and lines; two slopes in place of a network that will be a curve. FloatingPointError where the simulation
    diverges from every start."""
    samples = min(rows(problem, SETTINGS.lines_short, SETTINGS.lines_rows), max(len(r.y) for r in problem.records))
    short = _first(problem, samples)
    nothing = short.begin([straight(p) for p in ports])
    ends: list[tuple[Problem, Fit]] = []
    for begin in (lambda: _growing(problem, nothing, samples), lambda: nothing):
        try:
            ends.append(_bent(short, begin(), ports, limits))
        except FloatingPointError:
            continue
    if not ends:
        raise FloatingPointError("the simulation left all bounds from every start")
    own, fit = min(ends, key=lambda end: left(*end))
    tied = unknown.invisible(own, fit)
    return problem.with_(noise=own.noise, tied=tied), solve(own.with_(tied=tied), fit.point, 2, 20.0, limits).point


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


