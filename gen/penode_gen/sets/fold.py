# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How many straight pieces a network of one input has: known here before the target folds it (penode/pen_fold.h)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..networks import Affine, Network

Vector = NDArray[np.float64]
_MIDDLE = 0.1234567890123456  # where the lines are tied down at first: hardly a kink of anything


def foldable(network: Network) -> bool:
    """Is it a chain of straight pieces along one input?"""
    return network.n_inputs == 1 and network.n_outputs == 1 and network.is_piecewise_linear


def kinks(network: Network) -> Vector:
    """Where its neurons switch, ascending, in float64. The network must be foldable."""
    x = np.array([_MIDDLE])  # all lines are straight between these places, with the slopes `left` and `right` outside
    h, left, right = x[None, :], np.ones(1), np.ones(1)
    found: list[float] = []
    for layer in network.layers:
        if isinstance(layer, Affine):
            factor = layer.factor[:, None]
            h = (h - layer.shift[:, None]) * factor if layer.form == "centre" else h * factor + layer.shift[:, None]
            left, right = left * layer.factor, right * layer.factor
            continue
        h, left, right = layer.weights @ h + layer.bias[:, None], layer.weights @ left, layer.weights @ right
        if layer.activation == "relu":
            roots = _roots(x, h, left, right)
            found += list(roots)
            x, h = _refined(x, h, left, right, np.unique(np.append(x, roots)))
            left = np.where(h[:, 0] - left > 0.0, left, 0.0)
            right = np.where(h[:, -1] + right > 0.0, right, 0.0)
            h = np.maximum(h, 0.0)
    return np.unique(found)


def pieces(network: Network, clamp: bool = False) -> int:
    """Room that folding it takes: its pieces, one more at the centre, and one for each edge of the trust envelope."""
    at, edges = kinks(network), 0
    if network.input_min is not None and network.input_max is not None:
        edges = 2
        at = at[(at > network.input_min[0]) & (at < network.input_max[0])] if clamp else at
    return at.size + 2 + edges


def room(wanted: int) -> int:
    """The next number that the look-up can halve to the end: a power of two, or three times one; 0 stays 0."""
    return min(n for k in range(2, 13) for n in (1 << k, 3 << (k - 1)) if n >= wanted) if wanted > 0 else 0


def _roots(x: Vector, h: Vector, left: Vector, right: Vector) -> Vector:
    """Where the lines h [n, places] cross zero."""
    with np.errstate(divide="ignore", invalid="ignore"):
        row, i = np.nonzero(h[:, :-1] * h[:, 1:] < 0.0)
        between = x[i] + (x[i + 1] - x[i]) * h[row, i] / (h[row, i] - h[row, i + 1])
        before, after = h[:, 0] / left, -h[:, -1] / right  # distance beyond the outermost places
    outside = [x[0] - before[(before > 0.0) & np.isfinite(before)], x[-1] + after[(after > 0.0) & np.isfinite(after)]]
    return np.concatenate([between, *outside])


def _refined(x: Vector, h: Vector, left: Vector, right: Vector, to: Vector) -> tuple[Vector, Vector]:
    """The same lines at more places; a line that crosses zero there is exactly zero."""
    values = np.array([np.interp(to, x, row) for row in h])
    values += np.where(to < x[0], left[:, None] * (to - x[0]), 0.0) + np.where(to > x[-1], right[:, None] * (to - x[-1]), 0.0)
    return to, values
