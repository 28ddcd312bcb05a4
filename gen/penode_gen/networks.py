# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Feed-forward networks as plain data; network_files reads them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import expit

from .choices import ACTIVATIONS as ACTIVATIONS
from .errors import NetworkError as NetworkError

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

FORMS = ("centre", "rescale")


@dataclass(frozen=True, eq=False)
class Affine:
    """Element-wise layer. "centre": y = (x - shift) * factor; "rescale": y = x * factor + shift. Both [n], float64."""

    shift: Vector
    factor: Vector
    form: str

    def __post_init__(self) -> None:
        _freeze(self, "shift", "factor")

    @property
    def n_in(self) -> int:
        return self.shift.size

    n_out = n_in


@dataclass(frozen=True, eq=False)
class Dense:
    """y = activation(weights x + bias), weights [n_out, n_in], bias [n_out], float64."""

    weights: Matrix
    bias: Vector
    activation: str

    def __post_init__(self) -> None:
        _freeze(self, "weights", "bias")

    @property
    def n_in(self) -> int:
        return int(self.weights.shape[1])

    @property
    def n_out(self) -> int:
        return len(self.weights)


Layer = Affine | Dense


@dataclass(frozen=True, eq=False)
class Network:
    """
    Layers in the order of evaluation, at least one; raises NetworkError when they do not fit or are not finite.

    `input_min`, `input_max` [n_inputs] are the range that was seen in training, both None if nobody says; `source` is
    the name of the file.
    """

    layers: tuple[Layer, ...]
    input_min: Vector | None
    input_max: Vector | None
    source: str

    def __post_init__(self) -> None:
        if self.input_min is not None and self.input_max is not None:
            _freeze(self, "input_min", "input_max")
        object.__setattr__(self, "layers", tuple(self.layers))
        problem = _problem(self)
        if problem:
            raise NetworkError(f"{self.source}: {problem}")

    @property
    def n_inputs(self) -> int:
        return self.layers[0].n_in

    @property
    def n_outputs(self) -> int:
        return self.layers[-1].n_out

    @property
    def n_parameters(self) -> int:
        """Weights and biases of the dense layers; scaling is not counted."""
        return sum(layer.weights.size + layer.bias.size for layer in self.layers if isinstance(layer, Dense))

    @cached_property
    def architecture(self) -> tuple[tuple[str | int, ...], ...]:
        """What the generated code depends on: networks that agree here differ in numbers only."""
        return tuple(
            ("affine", layer.form, layer.n_out) if isinstance(layer, Affine) else ("dense", layer.activation, layer.n_in, layer.n_out)
            for layer in self.layers
        )

    @property
    def is_piecewise_linear(self) -> bool:
        """Continuous and made of straight pieces: it can be folded if it has one input."""
        return all(isinstance(layer, Affine) or layer.activation in ("relu", "identity") for layer in self.layers)

    def evaluate(self, x: ArrayLike) -> NDArray[np.float64]:
        """Outputs [..., n_outputs] at inputs x [..., n_inputs], in float64."""
        h = self._inputs(x)
        with np.errstate(over="ignore", invalid="ignore"):
            for layer in self.layers:
                h = layer_value(layer, h)
        return h

    def jacobian(self, x: ArrayLike) -> NDArray[np.float64]:
        """Exact d y / d x [..., n_outputs, n_inputs] at x [..., n_inputs]; the slope of relu and step at 0 is 0."""
        h = self._inputs(x)
        j = np.broadcast_to(np.eye(self.n_inputs), (*h.shape, self.n_inputs))
        with np.errstate(over="ignore", invalid="ignore"):
            for layer in self.layers:
                if isinstance(layer, Affine):
                    j = j * layer.factor[:, np.newaxis]
                else:
                    j = layer_slope(layer, h)[..., np.newaxis] * (layer.weights @ j)
                h = layer_value(layer, h)
        return j

    def _inputs(self, x: ArrayLike) -> NDArray[np.float64]:
        h = np.asarray(x, dtype=np.float64)
        if h.ndim == 0 or h.shape[-1] != self.n_inputs:
            raise ValueError(f"{self.source}: inputs have the shape {h.shape}; the last axis must be {self.n_inputs}")
        return h


def layer_value(layer: Layer, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Output [..., n_out] of one layer at x [..., n_in]."""
    if isinstance(layer, Affine):
        return (x - layer.shift) * layer.factor if layer.form == "centre" else x * layer.factor + layer.shift
    z = x @ layer.weights.T + layer.bias
    match layer.activation:
        case "relu":
            return np.maximum(z, 0.0)
        case "tanh":
            return np.tanh(z)
        case "sigmoid":
            return expit(z)
        case "softplus":
            return np.logaddexp(0.0, z)
        case "step":
            return np.where(np.isnan(z), z, np.heaviside(z, 1.0))
    return z


def layer_slope(layer: Dense, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Slope [..., n_out] of the activation at the layer's input x [..., n_in]."""
    z = x @ layer.weights.T + layer.bias
    match layer.activation:
        case "relu":
            return np.heaviside(z, 0.0)
        case "tanh":
            return 1.0 - np.tanh(z) ** 2
        case "sigmoid":
            return expit(z) * expit(-z)
        case "softplus":
            return expit(z)
        case "step":
            return np.zeros_like(z)
    return np.ones_like(z)


def _freeze(owner: object, *names: str) -> None:
    """Replace the named fields by read-only float64 copies."""
    for name in names:
        array = np.array(getattr(owner, name), dtype=np.float64)
        array.setflags(write=False)
        object.__setattr__(owner, name, array)


def _problem(network: Network) -> str:
    """The first thing that is wrong with a network, with its remedy; empty if nothing is."""
    if not network.layers:
        return "no layers: nothing to evaluate; export the trained network again"
    width = None
    for i, layer in enumerate(network.layers, 1):
        problem = _layer_problem(layer)
        if not problem and width is not None and layer.n_in != width:
            problem = f"takes {layer.n_in} values, but the layer before gives {width}; make the two sizes equal"
        if problem:
            return f"layer {i}: {problem}"
        width = layer.n_out
    return _range_problem(network.input_min, network.input_max, network.n_inputs)


def _layer_problem(layer: Layer) -> str:
    if isinstance(layer, Affine):
        if layer.form not in FORMS:
            return f"unknown form '{layer.form}'; use one of {', '.join(FORMS)}"
        if layer.shift.ndim != 1 or layer.shift.size == 0 or layer.shift.shape != layer.factor.shape:
            return f"shift {layer.shift.shape} and factor {layer.factor.shape} must be vectors of one length"
        numbers = (layer.shift, layer.factor)
    else:
        if layer.activation not in ACTIVATIONS:
            return f"unknown activation '{layer.activation}'; use one of {', '.join(ACTIVATIONS)}"
        if layer.weights.ndim != 2 or layer.weights.size == 0 or layer.bias.shape != layer.weights.shape[:1]:
            return f"weights {layer.weights.shape} and bias {layer.bias.shape} do not fit; they must be [n_out, n_in] and [n_out]"
        numbers = (layer.weights, layer.bias)
    if not all(np.isfinite(n).all() for n in numbers):
        return "a NaN or infinite number among its parameters; train or export the network again"
    return ""


def _range_problem(lowest: Vector | None, highest: Vector | None, n_inputs: int) -> str:
    if lowest is None and highest is None:
        return ""
    if lowest is None or highest is None:
        return "trained range: only one of minimum and maximum is given; give both or none"
    if lowest.shape != (n_inputs,) or highest.shape != (n_inputs,):
        return f"trained range: needs {n_inputs} minima and maxima, has {lowest.size} and {highest.size}"
    if not (np.isfinite(lowest).all() and np.isfinite(highest).all() and (lowest < highest).all()):
        return "trained range: every minimum must be finite and below its maximum"
    return ""
