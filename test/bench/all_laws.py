# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model with all that the generator can print into a step: every law, every function, every kind of layer."""

from __future__ import annotations

import itertools
import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import penode_gen
from penode_gen.laws import LAWS

MODEL = """
[model]
name = "all_laws"
sample_time = "1 ms"
fade_width = 0.5

[parameters]
length = {{ value = 30, unit = "mm" }}
rate = {{ value = 1, unit = "m/s", tunable = true }}
load = {{ value = 5, unit = "N" }}
time = {{ value = 20, unit = "ms" }}

[inputs]
z = {{ unit = "m" }}

[bodies]
mass = {{ mass = "2 kg", position = "q", velocity = "w" }}

[elements]
{elements}
wide = {{ between = ["mass", "z"], law = "network", network = "wide", inputs = ["deflection", "rate"] }}
steps = {{ between = ["mass", "z"], law = "network", network = "steps" }}
shape = {{ between = ["mass", "z"], law = "expression", force = "load*y" }}

[states]
lag = {{ unit = "N" }}

[variables]
a = {{ unit = "1" }}
b = {{ unit = "1" }}
y = {{ unit = "1" }}

[equations]
a = "a = (q - z)/length"
b = "b = w/rate"
y = "y = where(a < b, exp(a), where(b >= 2, tanh(b)*a, sigmoid(a))) + softplus(a)*sign(b) + min(a, b)*max(b, abs(a)) - a/(1 + b^2)"
lag = "der(lag)*time*(2 + sigmoid(b)) = F_shape - lag"

[networks]
wide = {{ inputs = ["m", "m/s"], output = "N" }}
steps = {{ inputs = ["m"], output = "N" }}

[outputs]
q = {{ value = "q", unit = "m" }}
a_mass = {{ value = "der(w)", unit = "m/s^2" }}

[sets.default]
wide = "wide.json"
steps = "steps.json"
"""

# Widths of the layers, and their activations: blocks of 16, 4 and 1 rows; a step has no slope, so it stands apart.
NETWORKS = {
    "wide": ((2, 21, 17, 16, 5, 1), ("relu", "tanh", "sigmoid", "softplus", "identity")),
    "steps": ((1, 5, 4, 1), ("step", "relu", "identity")),
}
EDGE = (0.05, 1.0)  # of the trust envelope, on both sides


def all_laws(folder: Path) -> penode_gen.Model:
    """Write the model and its networks into a folder, and load it."""
    elements = []
    for law, about in LAWS.items():
        arguments = "".join(f', {name} = "0.03 {unit}"' for name, unit in about.arguments.items())
        elements.append(f'{law} = {{ between = ["mass", "ground"], law = "{law}"{arguments} }}')
    for name, (sizes, activations) in NETWORKS.items():
        (folder / f"{name}.json").write_text(json.dumps(_network(sizes, activations)))
    (folder / "all_laws.toml").write_text(MODEL.format(elements="\n".join(elements)))
    return penode_gen.load(folder / "all_laws.toml")


def _network(sizes: Sequence[int], activations: Sequence[str]) -> dict[str, object]:
    """A network of random weights, in the JSON form."""
    draw = np.random.default_rng(1)
    layers = [
        {"activation": activation, "weights": draw.normal(size=(n, m)).tolist(), "bias": draw.normal(size=n).tolist()}
        for (m, n), activation in zip(itertools.pairwise(sizes), activations, strict=True)
    ]
    edges = {"min": [-edge for edge in EDGE[: sizes[0]]], "max": list(EDGE[: sizes[0]])}
    return {"normalise": {"kind": "min-max"} | edges, "layers": layers, "trained_range": edges}
