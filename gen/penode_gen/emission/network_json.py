# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A network as JSON that reading/json_file.py reads back with the same bits."""

from __future__ import annotations

import json
from typing import Any

from ..networks import Affine, Layer, Network


def to_json(network: Network) -> str:
    """The file's text: every layer with its own numbers, scalings with shift and factor."""
    table: dict[str, Any] = {"layers": [_layer(layer) for layer in network.layers]}
    if network.input_min is not None and network.input_max is not None:
        table["trained_range"] = {"min": network.input_min.tolist(), "max": network.input_max.tolist()}
    return json.dumps(table, indent=1) + "\n"


def _layer(layer: Layer) -> dict[str, Any]:
    if isinstance(layer, Affine):
        return {"form": layer.form, "shift": layer.shift.tolist(), "factor": layer.factor.tolist()}
    return {"activation": layer.activation, "weights": layer.weights.tolist(), "bias": layer.bias.tolist()}
