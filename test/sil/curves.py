# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Smooth inputs of plants, and their integration."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline


def curve(z: NDArray[np.float64], step: float) -> Callable[[float], float]:
    """The cubic spline through samples, as a function of time; asked for one time, SciPy's own object takes ten times as long."""
    pieces = CubicSpline(np.arange(len(z)) * step, z).c.T.tolist()

    def at(time: float) -> float:
        i = min(max(int(time / step), 0), len(pieces) - 1)
        x, (a, b, c, d) = time - i * step, pieces[i]
        return ((a * x + b) * x + c) * x + d

    return at


def integrate(
    rates: Callable[[float, list[float]], Sequence[float]], start: Sequence[float], step: float, samples: int, substeps: int = 2
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """States and their rates [states, samples] of x' = rates(time, x) at multiples of `step` [s], by Runge-Kutta of order 4.

    Plain numbers, for plants of a few states: SciPy's solvers take ten times as long for the same steps.
    """
    h, x, rows = step / substeps, list(start), []
    for i in range(samples):
        for j in range(substeps):
            time = i * step + j * h
            p = rates(time, x)
            if j == 0:
                rows.append((x, p))
            q = rates(time + 0.5 * h, [y + 0.5 * h * v for y, v in zip(x, p, strict=True)])
            r = rates(time + 0.5 * h, [y + 0.5 * h * v for y, v in zip(x, q, strict=True)])
            s = rates(time + h, [y + h * v for y, v in zip(x, r, strict=True)])
            x = [y + h / 6.0 * (a + 2.0 * b + 2.0 * c + d) for y, a, b, c, d in zip(x, p, q, r, s, strict=True)]
    return np.array([x for x, _ in rows]).T, np.array([v for _, v in rows]).T
