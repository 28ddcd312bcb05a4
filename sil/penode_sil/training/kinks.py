# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a force turns between two knots: a stop, a preload, an end of a clearance. What straight pieces miss there is more than noise, so
the fit moves the whole curve along its input until the turn meets a knot (where 0 is follows from the forces at 0 alone, which say little).
The band does not know of it: it is reported."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .curve import Curve
from .curves import covariance
from .port import Port
from .problem import Problem
from .solve import Fit

Array = NDArray[np.float64]


def find(curve: Curve, spread: Array) -> list[tuple[float, float]]:
    """Places at which a curve turns at once, and the width of the cell between two knots around each; `spread` [n, n] is the covariance of
    the values at its knots. Sure by five standard deviations (of some hundred cells none does so by chance), and three times what the
    curvature beside it makes (what only bends makes as much). Not next to 0, where knots are dense: friction turns there."""
    knots, wide = curve.knots, np.diff(curve.knots)
    rows, cells = np.zeros((len(wide), len(knots))), np.arange(len(wide))
    rows[cells, cells], rows[cells, cells + 1] = -1.0 / wide, 1.0 / wide
    slope = rows @ curve.values
    found: list[tuple[float, float, float]] = []
    for i in range(2, len(wide) - 2):
        turn, row = slope[i + 1] - slope[i - 1], rows[i + 1] - rows[i - 1]
        across = wide[i] + 0.5 * (wide[i - 1] + wide[i + 1])
        beside = max(abs(slope[k + 1] - slope[k]) / (0.5 * (wide[k + 1] + wide[k])) for k in (i - 2, i + 1))
        if abs(turn) <= max(5.0 * np.sqrt(max(row @ spread @ row, 0.0)), 3.0 * beside * across):
            continue
        share = (slope[i + 1] - slope[i]) / turn  # of the cell that has the slope on its left
        at = float(knots[i] + share * wide[i])
        if not 0.0 <= share <= 1.0 or abs(at) <= 2.0 * wide[i]:
            continue
        if found and at - found[-1][0] < 2.0 * wide[i]:  # one turn, seen from two cells: that of the larger one
            if abs(turn) <= found[-1][2]:
                continue
            found.pop()
        found.append((at, float(wide[i]), abs(float(turn))))
    return [(at, width) for at, width, _ in found]


def notes(problem: Problem, fit: Fit, ports: Sequence[Port]) -> list[str]:
    """A line for each curve that turns between its knots."""
    spread, at, lines = covariance(problem, fit), len(fit.point.ratios) + fit.point.starts.size, []
    for port, shape in zip(ports, fit.point.shapes, strict=True):
        columns = len(shape.theta)
        if isinstance(shape, Curve):
            own = spread[at : at + columns, at : at + columns]
            own = np.insert(np.insert(own, shape.zero, 0.0, axis=0), shape.zero, 0.0, axis=1) if shape.zero >= 0 else own
            found = find(shape, own)
            unit = problem.model.networks[port.name].input_units[0]
            places = ", ".join(f"{x:.3g}" for x, _ in found)
            if found:
                lines.append(
                    f"{port.name} bends sharply near {places} {unit}, between two knots that are {max(w for _, w in found):.1g} {unit} "
                    "apart: the whole curve may be shifted by some of that, which the bands of the forces do not include; "
                    "model the stop as a law of its own, or give the network more layers"
                )
        at += columns
    return lines
