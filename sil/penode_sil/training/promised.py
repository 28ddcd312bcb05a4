# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a model file promises of a network as linear limits on its curve, kept by the margin that the certificate asks for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Promises

from .curve import Curve
from .settings import SETTINGS
from .solve import NONE, Limits

Array = NDArray[np.float64]


def bound(promises: Promises, margin: float = SETTINGS.promised_first, size: float = 0.0) -> Callable[[Curve], Limits]:
    """Limits on the free values of a curve. `margin` is relative to its own size, or to `size` [N] where that is more."""

    def limits(curve: Curve) -> Limits:
        wide = np.diff(curve.knots)
        slopes = _free(curve, (np.eye(len(curve.knots))[1:] - np.eye(len(curve.knots))[:-1]) / wide[:, None])
        values = _free(curve, np.eye(len(curve.knots)))
        force = margin * min(max(float(np.max(np.abs(curve.values))), size), _or_far(promises.max_force))
        by = margin * min(
            max(float(np.max(np.abs(np.diff(curve.values) / wide))), size / float(np.ptp(curve.knots))), _or_far(promises.max_slope)
        )
        rows: list[Array] = []
        least: list[Array] = []

        def add(matrix: Array, low: Array | float) -> None:
            rows.append(matrix)
            least.append(np.broadcast_to(low, len(matrix)).astype(float))

        if promises.increasing or promises.decreasing:
            add(slopes if promises.increasing else -slopes, by)
        if promises.max_slope is not None:
            add(-slopes, by - promises.max_slope)
            add(slopes, by - promises.max_slope)
        if promises.max_force is not None:
            add(-values, 16.0 * force - promises.max_force)
            add(values, 16.0 * force - promises.max_force)
        if promises.dissipative is not None:
            away = curve.knots != 0.0
            sign = np.sign(curve.knots[away])
            gone = np.minimum(16.0 * force, np.abs(curve.knots[away]) * by)  # near 0, where the force is small, so is its rounding
            add(sign[:, None] * values[away], gone - promises.dissipative)
            add(slopes[[0, -1]], by)  # beyond the outermost knots it goes on
        return Limits(np.vstack(rows), np.concatenate(least)) if rows else NONE

    return limits


def _or_far(limit: float | None) -> float:
    return np.inf if limit is None else limit


def _free(curve: Curve, matrix: Array) -> Array:
    """Columns of the free values."""
    return np.delete(matrix, curve.zero, axis=1) if curve.zero >= 0 else matrix
