# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A curve written down as a ReLU network of a given shape, exactly: no regression, and 0 at 0 to the bit where the curve is.

F(x) = F(0) + a relu(x) - b relu(-x) + sum of c_j relu(x - k_j) for k_j > 0 and of c_j relu(k_j - x) for k_j < 0: all units are 0 at 0. The
first hidden layer holds x+ and x- and its share of the kinks; those in the middle carry x+ and x- and what is summed up so far as a
positive and a negative part, and kinks of their own; the last carries the sum only, for relu(y) - relu(-y) = y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from penode_gen.networks import Affine, Dense, Layer, Network

from .curve import Curve

Array = NDArray[np.float64]


def hidden(network: Network) -> tuple[int, ...]:
    """Widths of the hidden layers; empty where the network is no such chain (ReLU throughout, scaling at the ends only)."""
    dense = [layer for layer in network.layers if isinstance(layer, Dense)]
    ends = all(not isinstance(layer, Affine) for layer in network.layers[1:-1])
    chain = all(layer.activation == "relu" for layer in dense[:-1]) and dense[-1].activation == "identity"
    narrow = network.n_inputs == 1 and network.n_outputs == 1
    return tuple(layer.n_out for layer in dense[:-1]) if ends and chain and narrow and len(dense) > 1 else ()


def rooms(widths: tuple[int, ...]) -> tuple[int, ...]:
    """Kinks beside the one at 0 that each hidden layer has room for."""
    if len(widths) == 1:
        return (widths[0] - 2,)
    return (widths[0] - 2, *(w - 4 for w in widths[1:-1]), widths[-1] - 2)


def capacity(network: Network) -> int:
    """Knots that a curve with one at 0 may have for the network to hold it: its kinks, and the two outermost, where it has none; 0 for
    none. One less without a knot at 0."""
    widths = hidden(network)
    if not widths or min(rooms(widths)) < 0:
        return 0
    return sum(rooms(widths)) + 1 + 2


@dataclass(frozen=True, eq=False)
class _Kinks:
    at: Array
    by: Array  # change of slope on the way away from 0
    right: float  # slope just right of 0
    left: float  # slope just left of 0
    size: Array  # of the change, for the order


def _kinks(curve: Curve) -> _Kinks:
    slopes = np.diff(curve.values) / np.diff(curve.knots)
    inner, change = curve.knots[1:-1], np.diff(slopes)
    cell = int(np.clip(np.searchsorted(curve.knots, 0.0, side="right") - 1, 0, len(slopes) - 1))
    before = int(np.clip(np.searchsorted(curve.knots, 0.0, side="left") - 1, 0, len(slopes) - 1))
    away = inner != 0.0
    return _Kinks(inner[away], change[away], slopes[cell], slopes[before], np.abs(change[away]))


def unfold(curve: Curve, template: Network, low: float, high: float) -> Network:
    """The network of the template's shape that is this curve. ValueError where it has no room for the kinks."""
    found, widths = _kinks(curve), hidden(template)
    if not capacity(template) or len(found.at) > sum(rooms(widths)):
        raise ValueError(
            f"{len(curve.knots)} knots do not fit: the network holds {capacity(template)}, one at 0 and at least one on either side of it"
        )
    scale, size = _scales(template, max(abs(low), abs(high)), curve)
    at = found.at / scale
    shares = np.split(np.arange(len(at)), np.cumsum(rooms(widths))[:-1])
    layers: list[Layer] = []
    carried = np.zeros(0)  # how the sum so far follows from the layer before
    x_of = np.array([1.0])  # how x follows from it
    for n, (width, own) in enumerate(zip(widths, shares, strict=True)):
        first, last = n == 0, n == len(widths) - 1
        n_in = 1 if first else widths[n - 1]
        weights, bias, row = np.zeros((width, n_in)), np.zeros(width), 0
        new_sum, new_x = np.zeros(width), np.zeros(width)
        if first or not last:
            weights[row], weights[row + 1] = x_of, -x_of
            new_x[row], new_x[row + 1] = 1.0, -1.0
            if first:
                new_sum[row], new_sum[row + 1] = found.right * scale / size, -found.left * scale / size
            row += 2
        if not first:
            weights[row], weights[row + 1] = carried, -carried
            new_sum[row], new_sum[row + 1] = 1.0, -1.0
            row += 2
        for j in own:
            sign = 1.0 if at[j] > 0.0 else -1.0
            weights[row], bias[row] = sign * x_of, -sign * at[j]
            new_sum[row] = found.by[j] * scale / size
            row += 1
        layers.append(Dense(weights, bias, "relu"))
        carried, x_of = new_sum, new_x
    at_zero = np.zeros(1) if curve.zero >= 0 else curve(np.zeros(1)) / size
    layers.append(Dense(carried[None, :], at_zero, "identity"))
    return Network(_between(template, layers, scale, size), np.array([low]), np.array([high]), "trained")


def _scales(template: Network, reach: float, curve: Curve) -> tuple[float, float]:
    """Powers of two by which x is divided and the force multiplied, where the template scales; 1 where it does not."""
    scaled_in, scaled_out = isinstance(template.layers[0], Affine), isinstance(template.layers[-1], Affine)
    scale = 2.0 ** np.ceil(np.log2(max(reach, 1e-30))) if scaled_in else 1.0
    size = 2.0 ** np.ceil(np.log2(max(float(np.max(np.abs(curve.values))), 1e-30))) if scaled_out else 1.0
    return float(scale), float(size)


def _between(template: Network, layers: list[Layer], scale: float, size: float) -> tuple[Layer, ...]:
    """The layers between the template's scalings."""
    first, last = template.layers[0], template.layers[-1]
    before: list[Layer] = [Affine(np.zeros(1), np.array([1.0 / scale]), first.form)] if isinstance(first, Affine) else []
    after: list[Layer] = [Affine(np.zeros(1), np.array([size]), last.form)] if isinstance(last, Affine) else []
    return (*before, *layers, *after)
