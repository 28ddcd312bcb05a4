# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A rig with one mass on a spring whose foot is moved, and a damper to ground: its model file, its motion by SciPy, and its recordings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import signal

STEP = 2e-3  # s, of a sample
M, K, D = 20.0, 2e4, 120.0  # kg, N/m, N*s/m in the model file
NOISE = 2e-6, 0.02  # m, m/s^2


def model(stated: str = "") -> str:
    """The model file; `stated`: what it says of each parameter beside value and unit, such as ", tolerance = 0.03"."""
    return f"""
[model]
name = "rig"
sample_time = "2 ms"
[parameters]
m = {{ value = {M}, unit = "kg"{stated} }}
k = {{ value = {K}, unit = "N/m"{stated} }}
d = {{ value = {D}, unit = "N*s/m"{stated} }}
[inputs]
foot = {{ unit = "m" }}
[bodies]
mass = {{ mass = "m", position = "z", velocity = "v" }}
[elements]
spring = {{ between = ["mass", "foot"], law = "linear_spring", stiffness = "k" }}
damper = {{ between = ["mass", "ground"], law = "linear_damper", damping = "d" }}
[outputs]
z = {{ value = "z", unit = "m" }}
[sensors]
z = {{ value = "z", unit = "m", noise = {NOISE[0]} }}
a = {{ value = "der(v)", unit = "m/s^2", noise = {NOISE[1]} }}
"""


def tones(t: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
    """A foot [m] that moves in 16 tones from 0.7 to 9 Hz, at times t [s]."""
    found: NDArray[np.float64] = 1.5e-3 * np.sum(
        [np.sin(2 * np.pi * rng.uniform(0.7, 9.0) * t + rng.uniform(0, 2 * np.pi)) for _ in range(16)], axis=0
    )
    return found


def moved(t: NDArray[np.float64], foot: NDArray[np.float64], m: float = M, k: float = K, d: float = D) -> NDArray[np.float64]:
    """Position and acceleration [n, 2] of a rig with these parameters from rest on, the foot in straight lines from sample to sample."""
    plant = signal.StateSpace([[0, 1], [-k / m, -d / m]], [[0], [k / m]], [[1, 0], [-k / m, -d / m]], [[0], [k / m]])
    found: NDArray[np.float64] = signal.lsim(plant, foot, t)[1]
    return found


def write(path: Path, t: NDArray[np.float64], foot: NDArray[np.float64], y: NDArray[np.float64]) -> Path:
    """A recording of the foot and of position and acceleration [n, 2]."""
    np.savetxt(path, np.column_stack([t, foot, y]), delimiter=",", header="time [s],foot [m],z [m],a [m/s^2]", comments="", fmt="%.9g")
    return path
