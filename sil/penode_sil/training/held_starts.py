# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Start states of recordings that were not trained on: a model with bent forces may leave all bounds from a start that is far off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .curve import Curve, three
from .data import Record
from .dense import Dense
from .engine import Shape
from .port import Port, inputs_of
from .problem import Point, Problem
from .solve import solve

Array = NDArray[np.float64]
ITERATIONS, CLOSE = 8, 0.1


def fitted(
    problem: Problem, records: tuple[Record, ...], point: Point, ports: Sequence[Port], seen: Sequence[Array]
) -> tuple[Problem, Point] | None:
    """Start states of other recordings, all else as trained. Straight lines in place of the networks, as they were `seen` in training, find
    states to begin with where these are better than those of the model file. None where the model leaves all bounds from both: then it does
    so within the recording."""
    own = problem.with_(records=records, frozen=True)
    begin = replace(own.begin(point.shapes), ratios=point.ratios)
    try:
        lines = replace(begin, shapes=tuple(line(p, s, inputs_of(p, seen)) for p, s in zip(ports, point.shapes, strict=True)))
        closer = replace(begin, starts=solve(own, lines, ITERATIONS, CLOSE, damping=1e-6).point.starts)
        begin = min(begin, closer, key=own.cost)
    except FloatingPointError:
        pass  # no lines that stay within bounds: the model file's start it is
    try:
        return own, solve(own, begin, ITERATIONS, CLOSE, damping=1e-6).point
    except FloatingPointError:
        return None


def line(port: Port, shape: Shape, x: Array) -> Shape:
    """The straight line through 0 that is closest to a shape over its visited inputs x [n, inputs]."""
    x = x[:: max(1, len(x) // 5000)]
    slopes = np.linalg.lstsq(x, shape(x[:, 0] if isinstance(shape, Curve) else x), rcond=None)[0]
    if isinstance(shape, Curve):
        found = three(1.0, port.zero)
        return found.with_theta(slopes[0] * (np.delete(found.knots, found.zero) if port.zero else found.knots))
    return Dense((x.shape[1], 1), ("identity",), np.concatenate([slopes, np.zeros(1)]), np.ones(x.shape[1]), 1.0, port.zero)
