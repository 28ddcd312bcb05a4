# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Compiles plants.c and runs its plants."""

from __future__ import annotations

import ctypes
import hashlib
import os
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SOURCE = Path(__file__).with_name("plants.c")
PLANTS = "pendulum throttle cart crane axis oscillator motor quarter tanks servo thermal".split()  # in the order of plants.c


@cache
def library() -> ctypes.CDLL:
    """plants.c, compiled once for each content; several processes may do so at once."""
    name = hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    target = Path(tempfile.gettempdir()) / f"penode-rigs-{os.getuid()}" / f"{name}.so"
    if not target.exists():
        target.parent.mkdir(exist_ok=True)
        part = target.with_suffix(f".{os.getpid()}")
        subprocess.run(["gcc", "-O2", "-std=c99", "-fPIC", "-shared", "-o", str(part), str(SOURCE), "-lm"], check=True)
        part.rename(target)
    return ctypes.CDLL(str(target))


def _at(a: Array) -> ctypes.c_void_p:
    return ctypes.c_void_p(a.ctypes.data)


def _flat(a: object) -> Array:
    return np.ascontiguousarray(a, dtype=np.float64)


def rates(plant: str, states: object, inputs: object, parameters: object) -> Array:
    """Rates of the states at one time."""
    x, u, p = _flat(states), _flat(inputs), _flat(parameters)
    found = np.zeros_like(x)
    library().rates(PLANTS.index(plant), _at(x), _at(u), _at(p), _at(found))
    return found


def simulate(plant: str, times: Array, inputs: Array, parameters: Array, start: Array, steps: int) -> tuple[Array, Array]:
    """States and their rates at `times`; inputs [intervals, 2 steps + 1, number] at the half steps of each interval."""
    t, u, p, x = _flat(times), _flat(inputs), _flat(parameters), _flat(start)
    states, found = np.zeros((len(t), len(x))), np.zeros((len(t), len(x)))
    plant_number = PLANTS.index(plant)
    library().simulate(plant_number, len(t), steps, len(x), u.shape[2], *map(_at, (t, u, p, x, states, found)))
    return states, found


def half_steps(times: Array, steps: int) -> Array:
    """Times of the half steps, [intervals, 2 steps + 1]."""
    return times[:-1, None] + np.linspace(0, 1, 2 * steps + 1)[None, :] * np.diff(times)[:, None]
