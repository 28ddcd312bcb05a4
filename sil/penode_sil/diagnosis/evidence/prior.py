# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Priors of free values: of Gauss, or with tails of Student's t for what a file states and what may nevertheless be far off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..study.fit import Free

Array = NDArray[np.float64]
SHARE = 0.5  # standard deviation of a parameter, in tolerances: a tolerance is a limit, not a deviation
TAIL = 2.5  # halves of (degrees of freedom + 1): far from the file a value costs 2.5 log(1 + x^2/5), 7 for 8 deviations, 12 for 20


@dataclass(frozen=True)
class Stated(Free):
    """A value that a file states: near it, as Gauss has it; far from it costs about as much as a cause, however far."""


def distance(f: Free) -> float:
    """From its prior, in deviations of that."""
    if np.isinf(f.sigma):
        return 0.0
    return float(np.log(f.value / f.origin) / f.sigma) if f.log else f.offset


def cost(f: Free) -> float:
    """Negative log prior, but for a constant."""
    x = distance(f)
    return TAIL * float(np.log1p(x**2 / (2.0 * TAIL))) if isinstance(f, Stated) else 0.5 * x**2


def pull(f: Free) -> tuple[float, float]:
    """Slope of `cost` along a distance, and the curvature of the parabola through there that is never below it (that of Gauss, weighted:
    Lange, Little and Taylor, JASA 84, 1989)."""
    x = distance(f)
    weight = 1.0 / (1.0 + x**2 / (2.0 * TAIL)) if isinstance(f, Stated) else 1.0
    return x * weight, weight


def precisions(free: Sequence[Free]) -> Array:
    """Of the priors of free values where they are, in their units (log: relative); 0 for those without."""
    return np.array([(1.0 if f.log else f.unit) / f.sigma * np.sqrt(pull(f)[1]) for f in free])


def slopes(free: Sequence[Free]) -> Array:
    """Of the costs along the units of free values (log: relative)."""
    return np.array([(1.0 if f.log else f.unit) / f.sigma * pull(f)[0] for f in free])


def stated(free: Sequence[Free]) -> float:
    """Cost of the values that a file states."""
    return sum(cost(f) for f in free if isinstance(f, Stated))
