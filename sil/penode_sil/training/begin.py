# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a training starts other than from nothing: networks and parameters of an earlier one, of a diagnosis, or of somebody else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import Model
from penode_gen.networks import Affine, Network
from penode_gen.reading.network_files import read_network

from ..errors import NetworkError, WrongUse
from .curve import Curve
from .curves import grid
from .dense import Dense
from .port import Port

Array = NDArray[np.float64]
BESIDE = {"diagnosis.json": "model_extended.toml", "training.json": "model_trained.toml"}


@dataclass(frozen=True)
class Start:
    """`parameters`: values in SI by name; `networks`: by name. What is not among them starts from nothing."""

    parameters: Mapping[str, float] = field(default_factory=dict)
    networks: Mapping[str, Network] = field(default_factory=dict)


def read(paths: Sequence[Path], model: Model) -> Start:
    """What files say of the parameters and networks of a model: model files (also those that lie beside a diagnosis.json or a
    training.json), and networks, called as in the model unless it has only one. UserError for a file of another model."""
    parameters: dict[str, float] = {}
    networks: dict[str, Network] = {}
    for given in paths:
        path = given.with_name(BESIDE[given.name]) if given.name in BESIDE else given
        if path != given and not path.exists() and path.with_name("model_rejected.toml").exists():
            raise WrongUse(f"--from {given}: its model was rejected, for it predicts worse than the nominal one; leave --from out")
        if path.suffix.lower() == ".toml":
            other = penode_gen.load(path)
            found = {n: p.value for n, p in other.parameters.items() if n in model.parameters}
            own = {n: v for n, v in other.sets["default"].networks.items() if n in model.networks} if other.sets else {}
            if not found and not own:
                raise WrongUse(
                    f"--from {given}: {path.name} has no parameter and no network of {model.path}; give a file that was made from it"
                )
            parameters |= found
            networks |= own
        elif path.suffix.lower() in (".onnx", ".json"):
            name = path.stem if path.stem in model.networks else next(iter(model.networks)) if len(model.networks) == 1 else ""
            if not name:
                raise WrongUse(
                    f"--from {given}: {model.path} has no network {path.stem}; name the file after one of {', '.join(model.networks)}"
                )
            try:
                networks[name] = read_network(path)
            except NetworkError as exc:
                raise NetworkError(f"--from {exc}") from exc
        else:
            raise WrongUse(
                f"--from {given}: neither a model file (.toml), nor a network (.onnx, .json), nor a diagnosis.json; give one of these"
            )
    for name, network in networks.items():
        inputs = len(model.networks[name].input_units)
        if (network.n_inputs, network.n_outputs) != (inputs, 1):
            raise NetworkError(
                f"--from: network {name} has inputs and outputs {network.n_inputs} and {network.n_outputs}, the model's {inputs} and 1; "
                "give one of that shape"
            )
        if all(isinstance(layer, Affine) for layer in network.layers):
            raise NetworkError(f"--from: network {name} scales its input and has no layer with weights; give one that has, or leave it out")
    return Start(parameters, {n: v for n, v in networks.items() if not _silent(v)})


def _silent(network: Network) -> bool:
    """Is it 0 everywhere, as one that was never trained?"""
    last = next(layer for layer in reversed(network.layers) if not isinstance(layer, Affine))
    return not last.weights.any()


def ratios(start: Start, free: Sequence[str], model: Model, before: Array) -> Array:
    """Parameters over their nominal values; those of before where the start does not determine them."""
    return np.array(
        [start.parameters[n] / model.parameters[n].value if n in start.parameters else b for n, b in zip(free, before, strict=True)]
    )


def curve(port: Port, network: Network, reach: float) -> Curve:
    """A network of one input as a curve on a regular grid, over the range of its training, else to `reach` both ways."""
    low, high = (
        (float(v[0]) for v in (network.input_min, network.input_max))
        if network.input_min is not None and network.input_max is not None
        else (-reach, reach)
    )
    reach = max(high, -low)
    knots = grid(port, min(low, -1e-3 * reach), max(high, 1e-3 * reach), port.knots) if port.zero else grid(port, low, high, port.knots)
    values = network.evaluate(knots[:, None])[:, 0]
    zero = int(np.flatnonzero(knots == 0.0)[0]) if port.zero else -1
    return Curve(knots, values - values[zero] if port.zero else values, zero)


def dense(port: Port, network: Network, scale: Array, size: float) -> Dense:
    """A network of any shape as numbers to train, its scaling folded into the first and last weights."""
    parts: list[tuple[Array, Array]] = []
    kinds: list[str] = []
    factor, shift = np.ones(network.n_inputs), np.zeros(network.n_inputs)  # of the first layer's input: x factor + shift
    for layer in network.layers:
        if not isinstance(layer, Affine):
            w, b = layer.weights, layer.bias
            parts.append((w * factor, b + w @ shift) if not parts else (w.copy(), b.copy()))
            kinds.append(layer.activation)
            continue
        by = layer.factor, (-layer.shift * layer.factor if layer.form == "centre" else layer.shift)
        if parts:
            w, b = parts[-1]
            parts[-1] = by[0][:, None] * w, by[0] * b + by[1]
        else:
            factor, shift = factor * by[0], shift * by[0] + by[1]
    parts[0] = parts[0][0] * scale, parts[0][1]
    parts[-1] = parts[-1][0] / size, parts[-1][1] / size
    width = (network.n_inputs, *(len(b) for _, b in parts))
    theta = np.concatenate([v.ravel() for part in parts for v in part])
    return Dense(width, tuple(kinds), theta, np.array(scale), size, port.zero)
