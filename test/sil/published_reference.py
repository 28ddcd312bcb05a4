# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The published quarter vehicle written down by hand in numpy, float64. Shares nothing with the generator or the C."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SHARE_OF_ALTERED = 0.5  # the altered set scales the output layer's weights of the damper


class Network:
    """One of the published networks: min-max normalisation around four dense layers."""

    def __init__(self, path: Path, last: float = 1.0):
        data = json.loads(path.read_text())
        self.low, self.high = float(data["normalise"]["min"][0]), float(data["normalise"]["max"][0])
        self.out_low, self.out_high = float(data["denormalise"]["min"][0]), float(data["denormalise"]["max"][0])
        self.layers = [(np.array(layer["weights"]), np.array(layer["bias"]), layer["activation"]) for layer in data["layers"]]
        weights, bias, activation = self.layers[-1]
        self.layers[-1] = (last * weights, bias, activation)

    def __call__(self, value: float) -> float:
        h = np.array([(value - self.low) / (self.high - self.low)])
        for weights, bias, activation in self.layers:
            h = weights @ h + bias
            if activation == "relu":
                h = np.where(h > 0.0, h, 0.0)
        return float(h[0] * (self.out_high - self.out_low) + self.out_low)


class QuarterVehicle:
    """States z_b, z_w, v_b, v_w."""

    def __init__(self, folder: Path, altered: bool = False):
        self.spring = Network(folder / "spring.json")
        self.damper = Network(folder / "damper.json", SHARE_OF_ALTERED if altered else 1.0)

    def rates(self, x: Array, road: float) -> Array:
        z_b, z_w, v_b, v_w = x
        s, v = z_b - z_w, v_b - v_w
        force = 10_000.0 * s + 800.0 * v + self.spring(s) + self.damper(v)
        return np.array([v_b, v_w, -force / 350.0, (force - 300_000.0 * (z_w - road)) / 90.0])


def road_of_chirp(t: Array) -> Array:
    """Integral of 0.15 m/s * sin(pi/2 + 2 pi (t + t^2/8)) by Gauss-Legendre on every millisecond, exact to 1e-15 m.

    The phase turns by at most 2 pi * 16 Hz * 1 ms = 0.1 rad in a piece, so that 6 nodes leave (0.1)^12/12! of it.
    """
    nodes, weights = np.polynomial.legendre.leggauss(6)
    edges = np.arange(round(t[-1] * 1000) + 1) * 1e-3
    middle = 0.5e-3 * (nodes + 1.0)
    at = edges[:-1, None] + middle
    pieces = 0.15 * np.sin(np.pi / 2 + 2 * np.pi * (at + 0.125 * at * at)) @ weights * 0.5e-3
    integral = np.concatenate([[0.0], np.cumsum(pieces)])
    return integral[np.round(t * 1000).astype(int)]
