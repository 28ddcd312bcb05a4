# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Excitations and their small errors, at the solver's step."""

from __future__ import annotations

import numpy as np

from . import effects
from .effects import Array
from .solver import STEP

RATE = 1.0 / STEP
LEAD = 2.0  # s before a recording begins: settled, at rest


def rms(x: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.asarray(x) ** 2)))


def beside(f: Array, *columns: Array) -> Array:
    """What is left of f after the columns that free parameters may take."""
    if not columns:
        return f
    a = np.column_stack(columns)
    return f - a @ np.linalg.lstsq(a, f, rcond=None)[0]


def waves(rng: np.random.Generator, seconds: float, low: float, high: float, fall: float) -> Array:
    """Sines of random phase and frequency, falling with frequency, RMS 1, at the solver's step; 0 in the lead, then faded in."""
    t = np.arange(round((seconds + LEAD) * RATE) + 1) * STEP
    f = np.sort(np.exp(rng.uniform(np.log(low), np.log(high), 60)))
    size = f ** (0.5 - fall)
    wave = np.zeros(len(t))
    for a, x, p in zip(size, f, rng.uniform(0, 2 * np.pi, len(f)), strict=True):
        wave += a * np.sin(2 * np.pi * x * t + p)
    return wave / rms(wave) * (0.5 - 0.5 * np.cos(np.pi * np.clip((t - LEAD) / 0.4, 0, 1)))


def coloured(rng: np.random.Generator, n: int) -> Array:
    """Gusts: noise of first order with a corner of 1.5 Hz, RMS 1."""
    y = effects.lagged(rng.standard_normal(n), RATE / (2 * np.pi * 1.5))
    return y / rms(y)


def roads(rng: np.random.Generator, u: Array, error: Array, seconds: float) -> None:
    """Heights under the wheels; a patch of 0.1 m averages them, and a second wheel of the axle sees another track."""
    speed = float(rng.uniform(10, 22))
    size = 0.004 * float(rng.uniform(0.8, 1.5))
    road = size * waves(rng, seconds, 0.4, 20.0, 1.3)
    other = size * waves(rng, seconds, 1.0, 15.0, 1.0)
    patch = max(int(0.1 / speed * RATE), 1)
    for k in range(u.shape[1]):
        late = int(k * 2.6 / speed * RATE)
        u[:, k] = np.concatenate([np.zeros(late), road[: len(road) - late]])
        mean = np.convolve(np.pad(u[:, k], patch, mode="edge"), np.ones(patch) / patch, "same")[patch:-patch]
        error[:, k] = mean - u[:, k] + 0.03 * other
