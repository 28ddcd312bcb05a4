# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Model files for the tests of the generator, and their equations written down a second time by hand."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np

# A mass on a moving foot with everything the generator knows: a tunable mass, a network of two inputs, smooth friction,
# a state that is not mechanical, a linear algebraic loop, and the rate of an input.
RICH = """
[model]
name = "rich"
sample_time = "{h} s"
method = "{method}"
substeps = {substeps}
input = "{input}"
outside = "{outside}"
fade_width = 0.5

[parameters]
m = {{ value = 2, unit = "kg", tunable = true }}
k = {{ value = 50, unit = "N/m" }}
tau = {{ value = 50, unit = "ms" }}

[inputs]
F = {{ unit = "N" }}
z = {{ unit = "m" }}

[bodies]
mass = {{ mass = "m", position = "q", velocity = "v", start_position = "10 mm" }}

[elements]
foot = {{ between = ["mass", "z"], law = "linear_spring", stiffness = "k" }}
{foot_damper}
friction = {{ between = ["mass", "ground"], law = "stribeck_friction", breakaway = "3 N", coulomb = "2 N", \
stribeck = "0.2 m/s", transition = "0.3 m/s" }}
net = {{ between = ["mass", "ground"], law = "network", network = "n2", inputs = ["deflection", "rate"] }}
push = {{ between = ["mass", "ground"], law = "expression", force = "F_lag - F" }}

[states]
F_lag = {{ unit = "N", start = 0.5 }}

[variables]
w = {{ unit = "N" }}

[equations]
lag = "der(F_lag)*tau = w - F_lag"
loop = "2*w - F = 0.5*w + 0.3*F_foot"

[networks]
n2 = {{ inputs = ["m", "m/s"], output = "N" }}

[outputs]
q = {{ value = "q", unit = "m" }}
a = {{ value = "der(v)", unit = "m/s^2" }}

[sensors]
w = {{ value = "w", unit = "N" }}

[sets.default]
n2 = "n2.json"

[sets.heavy]
m = "4 kg"
"""

# One network and nothing else: outputs = network(inputs).
BARE = """
[model]
name = "bare"
sample_time = "1 ms"
input = "held"
outside = "{outside}"
fade_width = 0.5
[inputs]
{inputs}
[networks]
net = {{ inputs = {units}, output = "1" }}
[variables]
y = {{ unit = "1" }}
[equations]
only = "y = net({names})"
[outputs]
y = {{ value = "y", unit = "1" }}
[sets.default]
net = "net.json"
"""


def network_file(path: Path, sizes: list[int], activations: list[str], seed: int, low: float = -1.0, high: float = 1.0) -> dict:
    """Write a random network as JSON, trained on [low, high] in every input; returns what was written."""
    draw = np.random.default_rng(seed)
    layers = [
        {"activation": a, "weights": (draw.standard_normal((n, m)) / np.sqrt(m)).tolist(), "bias": (0.3 * draw.standard_normal(n)).tolist()}
        for (m, n), a in zip(itertools.pairwise(sizes), activations, strict=True)
    ]
    n = sizes[0]
    data = {
        "normalise": {"kind": "min-max", "min": [-0.5] * n, "max": [1.5] * n},
        "layers": layers,
        "denormalise": {"kind": "min-max", "min": [0.5], "max": [3.0]},
        "trained_range": {"min": [low] * n, "max": [high] * n},
    }
    path.write_text(json.dumps(data))
    return data


def rich(
    folder: Path,
    method: str = "rk4",
    h: float = 1e-3,
    input: str = "linear",
    outside: str = "extrapolate",
    substeps: int = 1,
    activation: str = "tanh",
    low: float = -1.0,
    high: float = 1.0,
) -> Path:
    """Write the rich model and its network; the damper to the foot needs the input's rate, so a held input has none."""
    damper = 'foot_d = { between = ["mass", "z"], law = "linear_damper", damping = "3 N*s/m" }' if input != "held" else ""
    network_file(folder / "n2.json", [2, 5, 7, 1], [activation, "softplus", "identity"], 5, low, high)
    path = folder / f"rich_{method}_{input}_{outside}_{substeps}_{activation}_{h:g}_{low:g}.toml"
    path.write_text(RICH.format(method=method, h=h, input=input, outside=outside, substeps=substeps, foot_damper=damper))
    return path


def activate(name: str, x: np.ndarray) -> np.ndarray:
    """Activations by NumPy."""
    return {
        "relu": lambda: np.maximum(x, 0.0),
        "identity": lambda: x,
        "tanh": lambda: np.tanh(x),
        "step": lambda: np.where(x < 0, 0.0, 1.0),
        "sigmoid": lambda: 1.0 / (1.0 + np.exp(-x)),
        "softplus": lambda: np.log1p(np.exp(-np.abs(x))) + np.maximum(x, 0.0),
    }[name]()


def network_by_hand(data: dict, x: np.ndarray) -> float:
    """The JSON form evaluated in float64."""
    low, high = (np.array(data["normalise"][k]) for k in ("min", "max"))
    h = (np.asarray(x, float) - low) / (high - low)
    for layer in data["layers"]:
        h = activate(layer["activation"], np.array(layer["weights"]) @ h + np.array(layer["bias"]))
    low, high = data["denormalise"]["min"][0], data["denormalise"]["max"][0]
    return float(h[0] * (high - low) + low)


def rich_by_hand(data: dict, t: float, x: np.ndarray, force, foot, foot_rate, damping: float = 3.0, mass: float = 2.0) -> np.ndarray:
    """Right-hand side of the rich model; force, foot, foot_rate are functions of time."""
    q, v, lag = x
    pull = 50.0 * (q - foot(t))
    w = (force(t) + 0.3 * pull) / 1.5
    friction = np.sqrt(2.0 * np.e) * 1.0 * np.exp(-((v / 0.2) ** 2)) * v / 0.2 + 2.0 * np.tanh(v / 0.3)
    total = pull + damping * (v - foot_rate(t)) + friction + network_by_hand(data, np.array([q, v])) + lag - force(t)
    return np.array([v, -total / mass, (w - lag) / 0.05])
