# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks of any shape as one vector of numbers, in the order in which engine.c has them."""

from __future__ import annotations

import ctypes
import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from penode_gen import networks
from penode_gen.networks import Affine, Network

Array = NDArray[np.float64]
ACTIVATIONS = ("identity", "relu", "tanh", "sigmoid", "softplus")


@dataclass(frozen=True, eq=False)
class Dense:
    """Layers of widths `width` [layers + 1] with activations; theta holds each layer's weights [out][in], then its biases.
    Inputs are divided by `scale` [inputs], what comes out is multiplied by `size`. `zero`: its value at 0 is taken away."""

    width: tuple[int, ...]
    activation: tuple[str, ...]
    theta: Array
    scale: Array
    size: float
    zero: bool

    @property
    def columns(self) -> int:
        """Number of free values; with `zero`, the last, a bias, has no effect."""
        return sum((i + 1) * o for i, o in itertools.pairwise(self.width))

    def with_theta(self, theta: Array) -> Dense:
        """The same shape with other numbers."""
        return replace(self, theta=np.array(theta))

    def parts(self) -> list[tuple[Array, Array]]:
        """Weights and biases of each layer."""
        found, at = [], 0
        for i, o in itertools.pairwise(self.width):
            found.append((self.theta[at : at + i * o].reshape(o, i), self.theta[at + i * o : at + (i + 1) * o]))
            at += (i + 1) * o
        return found

    def __call__(self, x: Array) -> Array:
        """Values at x [n] or [n, inputs]."""
        x = np.reshape(x, (-1, self.width[0])) / self.scale
        weights = [networks.Dense(w, b, a) for (w, b), a in zip(self.parts(), self.activation, strict=True)]
        if self.zero:
            weights[-1] = networks.Dense(weights[-1].weights, np.zeros(1), self.activation[-1])
        h, rest = x, np.zeros((1, self.width[0]))
        for layer in weights:
            h, rest = networks.layer_value(layer, h), networks.layer_value(layer, rest)
        return (h[:, 0] - (rest[0, 0] if self.zero else 0.0)) * self.size

    def taught(self, x: Array, values: Array) -> Dense:
        """The same inner weights; those of the last layer are added what brings it nearest to `values` at x [n, inputs] and stays small. As
        it is where the last layer is none to be added to."""
        if self.activation[-1] != "identity" or len(self.activation) == 1:
            return self
        parts, (w, b) = self.parts(), self.parts()[-1]
        h, rest = np.reshape(x, (-1, self.width[0])) / self.scale, np.zeros((1, self.width[0]))
        for (weights, bias), activation in zip(parts[:-1], self.activation, strict=False):
            h, rest = (networks.layer_value(networks.Dense(weights, bias, activation), v) for v in (h, rest))
        rows = h - rest if self.zero else np.hstack([h, np.ones((len(h), 1))])
        aim = (values - self(x)) / self.size
        small = 1e-4 * len(rows)  # of rows of the size of 1: weights that a thousandth of the aim asks for stay away
        more = np.linalg.solve(rows.T @ rows + small * np.eye(rows.shape[1]), rows.T @ aim)
        last = np.concatenate([w[0] + more[: w.shape[1]], b if self.zero else b + more[-1]])
        return self.with_theta(np.concatenate([self.theta[: -len(last)], last]))

    def fill(self, net: ctypes.Structure) -> list[NDArray[Any]]:
        """Fill in a net_t; what it points to."""
        width = np.array(self.width, dtype=np.int32)
        kinds = np.array([ACTIVATIONS.index(a) for a in self.activation], dtype=np.int32)
        weights, factor = np.ascontiguousarray(self.theta), np.array([*(1.0 / self.scale), self.size])
        net.kind, net.count, net.zero, net.layers, net.columns = 1, 0, 0 if self.zero else -1, len(kinds), self.columns
        net.widest, net.inputs = max(self.width), self.width[0]
        net.width, net.activation, net.weights, net.factor = (a.ctypes.data for a in (width, kinds, weights, factor))
        return [width, kinds, weights, factor]


def like(network: Network, scale: Array, size: float, zero: bool, seed: int) -> Dense:
    """The shape of a network with small random numbers: what it gives at first is small against `size`."""
    layers = [layer for layer in network.layers if isinstance(layer, networks.Dense)]
    width = (layers[0].n_in, *(layer.n_out for layer in layers))
    random, parts = np.random.default_rng(seed), []
    for k, (i, o) in enumerate(itertools.pairwise(width)):
        last = k == len(layers) - 1
        spread = 0.02 if last else np.sqrt((2.0 if layers[k].activation == "relu" else 1.0) / i)
        parts += [random.normal(0.0, spread / (np.sqrt(i) if last else 1.0), i * o), np.zeros(o) if last else random.normal(0.0, 0.5, o)]
    return Dense(width, tuple(layer.activation for layer in layers), np.concatenate(parts), np.array(scale), size, zero)


def trainable(network: Network) -> str:
    """Why a network's shape cannot be trained; empty if it can: scaling first and last only, activations that have a slope."""
    inner = [isinstance(layer, Affine) for layer in network.layers]
    if any(inner[1:-1]):
        return "scales between its layers; fold that into the weights and export it again"
    kinds = {layer.activation for layer in network.layers if not isinstance(layer, Affine)}
    unknown = sorted(kinds - set(ACTIVATIONS))
    return f"has the activation {unknown[0]}, which has no slope to train by; use one of {', '.join(ACTIVATIONS)}" if unknown else ""


def network_of(shape: Dense, template: Network, low: Array, high: Array) -> Network:
    """A Network of the template's architecture that computes the same, in float as well as in double: 0 at 0 if it shall."""
    layers: list[networks.Dense] = []
    first, last = template.layers[0], template.layers[-1]
    parts = [(w.copy(), b.copy()) for w, b in shape.parts()]
    if not isinstance(first, Affine):
        parts[0] = (parts[0][0] / shape.scale, parts[0][1])
    if not isinstance(last, Affine):
        parts[-1] = (parts[-1][0] * shape.size, parts[-1][1] * shape.size)
    for (w, b), activation in zip(parts, shape.activation, strict=True):
        layers.append(networks.Dense(w.astype(np.float32), b.astype(np.float32), activation))
    if shape.zero:
        layers[-1] = networks.Dense(layers[-1].weights, -_at_zero(layers), layers[-1].activation)
    before = (Affine(np.zeros(shape.width[0]), (1.0 / shape.scale).astype(np.float32), first.form),) if isinstance(first, Affine) else ()
    behind = (Affine(np.zeros(1), np.array([shape.size], np.float32), last.form),) if isinstance(last, Affine) else ()
    return Network((*before, *layers, *behind), low, high, "trained")


def _at_zero(layers: list[networks.Dense]) -> Array:
    """What the weights of the last layer make at 0, summed in float in the order of the C, so that the bias takes it away exactly."""
    h = np.zeros(layers[0].n_in, np.float32)
    for layer in layers:
        last = layer is layers[-1]
        if not last:
            h = networks.layer_value(layer, h.astype(float)).astype(np.float32)
            continue
        total = np.zeros(layer.n_out, np.float32)
        for column, value in zip(layer.weights.astype(np.float32).T, h, strict=True):
            total = total + column * value
    return total.astype(float)
