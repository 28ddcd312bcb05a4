# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The straight pieces of a network of one input with ReLU activations, in exact rational arithmetic of its weights as float."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from ..networks import Affine, Layer, Network

EPS = float(np.finfo(np.float32).eps)


@dataclass(frozen=True)
class Piece:
    """
    F(x) = slope x + offset from `start` to `end`, None: without end.

    The margins are those of inc/penode/pen_promise.h: of the slope, and of the force at `start` and at `end`.
    """

    start: Fraction | None
    end: Fraction | None
    slope: Fraction
    offset: Fraction
    slope_margin: float
    start_margin: float
    end_margin: float

    def at(self, x: Fraction) -> Fraction:
        return self.slope * x + self.offset


@dataclass(frozen=True)
class _Layer:
    """Whole numbers [n_out, n_in] and [n_out]: weights and bias times 2^shift; and their sizes as float64."""

    weights: np.ndarray
    bias: np.ndarray
    shift: int
    relu: bool
    sizes: np.ndarray
    bias_sizes: np.ndarray


def pieces(network: Network) -> Iterator[Piece]:
    """All pieces from left to right. The network must be foldable (penode_gen/sets/fold.py)."""
    layers = [_layer(layer) for layer in network.layers]
    start: Fraction | None = None
    while True:
        piece = _piece(layers, start)
        yield piece
        if piece.end is None:
            return
        start = piece.end


def _layer(layer: Layer) -> _Layer:
    if isinstance(layer, Affine):
        shift, factor = ([Fraction(float(v)) for v in values.astype(np.float32)] for values in (layer.shift, layer.factor))
        bias = [-p * q for p, q in zip(shift, factor, strict=True)] if layer.form == "centre" else shift
        weights = [[q if i == j else Fraction(0) for j in range(len(factor))] for i, q in enumerate(factor)]
        relu = False
    else:
        weights = [[Fraction(float(v)) for v in row] for row in layer.weights.astype(np.float32)]
        bias = [Fraction(float(v)) for v in layer.bias.astype(np.float32)]
        relu = layer.activation == "relu"
    most = max(v.denominator for v in (*bias, *(v for row in weights for v in row)))  # powers of two
    whole = np.array([[int(v * most) for v in row] for row in weights], dtype=object)
    sizes = np.array([[abs(float(v)) for v in row] for row in weights])
    return _Layer(
        whole,
        np.array([int(v * most) for v in bias], dtype=object),
        most.bit_length() - 1,
        relu,
        sizes,
        np.array([abs(float(v)) for v in bias]),
    )


def _piece(layers: list[_Layer], start: Fraction | None) -> Piece:
    """The piece to the right of `start`; None: the leftmost."""
    s, o, shift = np.array([1], dtype=object), np.array([0], dtype=object), 0
    end: Fraction | None = None
    patterns: list[NDArray[np.bool_] | None] = []
    for layer in layers:
        s, o = layer.weights @ s, layer.weights @ o + layer.bias * (1 << shift)
        shift += layer.shift
        if not layer.relu:
            patterns.append(None)
            continue
        on = np.array([_is_on(a, b, start) for a, b in zip(s, o, strict=True)])
        patterns.append(on)
        for root in (Fraction(-b, a) for a, b, active in zip(s, o, on, strict=True) if (a < 0 if active else a > 0)):
            end = root if end is None or root < end else end
        s, o = s * on, o * on
    scale = Fraction(1, 1 << shift)
    path = _paths(layers, patterns, None)
    near = [_paths(layers, patterns, x) for x in (start, end)]
    return Piece(start, end, s[0] * scale, o[0] * scale, path, *near)


def _is_on(slope: int, offset: int, x: Fraction | None) -> bool:
    """Is a neuron on immediately to the right of x?"""
    if x is None:
        return slope < 0 or (slope == 0 and offset > 0)
    value = slope * x.numerator + offset * x.denominator
    return value > 0 or (value == 0 and slope > 0)


def _paths(layers: list[_Layer], patterns: list[NDArray[np.bool_] | None], x: Fraction | None) -> float:
    """Margin of the slope, or with x of the force there: rounding times the sum of the sizes of all paths."""
    h, terms = np.array([1.0 if x is None else abs(float(x))]), 0
    for layer, on in zip(layers, patterns, strict=True):
        h = layer.sizes @ h + (0.0 if x is None else layer.bias_sizes)
        h = h if on is None else h * on
        terms += layer.sizes.shape[1] + 10
    return float(terms * EPS * h[0])
