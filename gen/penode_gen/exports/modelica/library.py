# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks in Modelica beside the physics: record and block for the NeuralNetwork library, or external C with its block."""

from __future__ import annotations

import numpy as np

from ...model import Model
from ...networks import Affine, Dense, Network
from ...version import VERSION
from ..interface import ExportError
from ..templating import render
from .model import arrays
from .text import array, identifier, quoted, real, unit

_LIBRARY = {"relu": "ReLu", "identity": "Id", "tanh": "Tanh", "sigmoid": "Sigmoid", "softplus": "Softplus", "step": "Step"}


def _described(model: Model, chosen: str) -> list[dict[str, object]]:
    """What the templates see of the networks of a set."""
    if not model.networks:
        raise ExportError(f"{model.path.name}: the model has no network; use --form model")
    found = []
    for name, network in model.sets[chosen].networks.items():
        port = model.networks[name]
        found.append(
            {
                "name": identifier(name),
                "nin": network.n_inputs,
                "nout": network.n_outputs,
                "layers": _layers(network),
                "arrays": [
                    {"name": part, "shape": ", ".join(map(str, v.shape)), "text": array(v, "      ")} for part, v in arrays(network)
                ],
                "description": quoted(port.description or name),
                "units": [unit(u) for u in port.input_units],
                "unit": unit(port.output_unit),
            }
        )
    return found


def _layers(network: Network) -> list[dict[str, object]]:
    found, dense, scale = [], 0, 0
    for layer in network.layers:
        if isinstance(layer, Affine):
            scale += 1
            found.append({"kind": layer.form, "number": scale, "n": layer.n_out, "shift": _c(layer.shift), "factor": _c(layer.factor)})
        else:
            dense += 1
            found.append(_dense(layer, dense))
    return found


def _dense(layer: Dense, number: int) -> dict[str, object]:
    return {
        "kind": "dense",
        "number": number,
        "n": layer.n_out,
        "n_in": layer.n_in,
        "activation": layer.activation,
        "library": _LIBRARY[layer.activation],
        "weights": _c(layer.weights.ravel()),
        "bias": _c(layer.bias),
    }


def _c(values: np.ndarray) -> str:
    """Numbers between the braces of a C array, eight a line."""
    words = [real(v) for v in values]
    return ",\n    ".join(", ".join(words[i : i + 8]) for i in range(0, len(words), 8))


def library(model: Model, chosen: str) -> str:
    """Package of records and blocks of listings 3 and 4."""
    return render("modelica/library.mo.j2", name=identifier(model.name), version=VERSION, networks=_described(model, chosen), chosen=chosen)


def external(model: Model, chosen: str) -> dict[str, str]:
    """A package in a folder: functions and blocks of listings 1 and 2, with their C. File name -> text."""
    context = {"name": identifier(model.name), "version": VERSION, "networks": _described(model, chosen), "chosen": chosen}
    return {
        f"{model.name}_networks/package.mo": render("modelica/external.mo.j2", **context),
        f"{model.name}_networks/Resources/Include/{model.name}_networks.c": render("modelica/networks.c.j2", **context),
    }
