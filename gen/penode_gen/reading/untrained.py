# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks that a model file gives a shape and no numbers yet: they are 0 everywhere until `penode train` has written them."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from ..networks import ACTIVATIONS, Affine, Dense, Network, NetworkError

WIDEST = 4096  # neurons of a layer, at most


def untrained(entry: dict[str, Any], n_inputs: int, name: str) -> Network:
    """The network of `layers` (widths of the hidden ones) and `activation`, all weights 0, between scalings. Raises NetworkError. Biases of
    hidden layers are -1: a neuron whose argument is 0 may switch anywhere, which leaves the target nothing to prove promises with."""
    layers, activation = entry.get("layers", []), entry.get("activation", "relu")
    if not layers or not all(isinstance(w, int) and not isinstance(w, bool) and 0 < w <= WIDEST for w in layers):
        raise NetworkError(f"{name}: layers must list the widths of the hidden layers, like [16, 16]")
    if activation not in ACTIVATIONS or activation == "step":
        raise NetworkError(f"{name}: activation '{activation}' cannot be trained; use relu, tanh, sigmoid or softplus")
    width = (n_inputs, *layers, 1)
    dense = [
        Dense(np.zeros((o, i)), np.full(o, -1.0 if k < len(layers) else 0.0), activation if k < len(layers) else "identity")
        for k, (i, o) in enumerate(itertools.pairwise(width))
    ]
    scales = Affine(np.zeros(n_inputs), np.ones(n_inputs), "centre"), Affine(np.zeros(1), np.ones(1), "rescale")
    return Network((scales[0], *dense, scales[1]), None, None, f"{name} (untrained)")
