# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What drives the plants: a controller that holds its command between samples, a command without feedback, a road, a swing let go."""

from __future__ import annotations

import numpy as np

from .engine import SAMPLE, Array, Command
from .plants import Plant

LONG = {"train_1": 6000, "train_2": 6000, "holdout_1": 4000}  # rows
SIZE = {"holdout_1": 0.85}  # of the excitation, so that the hold-out seldom goes where the training has not been
FADE = 1.0  # s in which a reference begins


def waves(rng: np.random.Generator, rows: int, low: float, high: float, size: float, fall: float) -> tuple[Array, Array, Array]:
    """Sines of drawn frequency and phase, falling with frequency, with first and second derivative; RMS `size`, at rest at first."""
    t = np.arange(rows) * SAMPLE
    x, dx, ddx = np.zeros(rows), np.zeros(rows), np.zeros(rows)
    for f in np.exp(rng.uniform(np.log(low), np.log(high), 24)):
        w, a, p = 2 * np.pi * f, f**-fall, rng.uniform(0, 2 * np.pi)
        x += a * np.sin(w * t + p)
        dx += a * w * np.cos(w * t + p)
        ddx -= a * w * w * np.sin(w * t + p)
    s = np.clip(t / FADE, 0, 1)
    g, dg, ddg = s**3 * (10 - 15 * s + 6 * s * s), 30 * s * s * (1 - s) ** 2 / FADE, 60 * s * (1 - s) * (1 - 2 * s) / FADE**2
    k = size / float(np.sqrt(np.mean(x**2)))
    return k * g * x, k * (dg * x + g * dx), k * (ddg * x + 2 * dg * dx + g * ddx)


def controller(rng: np.random.Generator, plant: Plant, rows: int, size: float) -> Command:
    """Feed-forward of the nominal plant and a PD law on a position and a rate with noise, as whole steps of a 12 bit converter."""
    x, dx, ddx = waves(rng, rows, *plant.band, size * plant.travel, 0.6)
    forward = plant.forward(x, dx, ddx)
    w = 2 * np.pi * float(rng.uniform(1.5, 3.5))
    kp, kd = plant.inertia * w * w, plant.inertia * 1.4 * w
    jitter = plant.sensors[0].noise * rng.standard_normal(rows)
    count = 8 * float(np.abs(forward).max()) / 4096

    def command(k: int, q: Array, v: Array) -> float:
        u = forward[k] + kp * (x[k] - q[0] + jitter[k]) + kd * (dx[k] - v[0])
        return count * round(float(u) / count)

    return command


def open_loop(rng: np.random.Generator, plant: Plant, rows: int, size: float) -> Array:
    """The command that would move the nominal plant along a reference, without feedback."""
    forward = plant.forward(*waves(rng, rows, *plant.band, size * plant.travel, 0.6))
    count = 8 * float(np.abs(forward).max()) / 4096
    return np.asarray(count * np.round(forward / count))


def command(rng: np.random.Generator, plant: Plant, rows: int, size: float = 1.0) -> Command | Array | None:
    """What drives one recording; `size`: of the motion that is asked for, over the plant's."""
    if plant.road:
        return waves(rng, rows, *plant.band, size * plant.travel, 1.3)[0]
    if not plant.actuator:
        return None
    return open_loop(rng, plant, rows, size) if plant.anchored and rng.random() < 0.4 else controller(rng, plant, rows, size)


def start(rng: np.random.Generator, plant: Plant, size: float = 1.0) -> dict[str, float]:
    """Positions that a recording starts from; all but a free swing are at rest."""
    return {"q": float(size * rng.choice([-1, 1]) * rng.uniform(0.7, 1.2))} if plant.name == "pendulum" else {}
