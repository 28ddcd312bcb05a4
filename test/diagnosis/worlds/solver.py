# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Compiles world.c and runs plants made of coordinates, places and laws."""

from __future__ import annotations

import ctypes
import hashlib
import os
import subprocess
import tempfile
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SOURCE = Path(__file__).with_name("world.c")
LAWS = (
    "linear wave rub atan stribeck power one_side stop play skew knee fade hysteresis maxwell lift pressed aerated sine mount constant"
).split()
STEP = 1.0 / 4000.0  # s; the fastest mode, 90 Hz, turns by 0.14 a step: the rule errs by 0.14^5/120 = 5e-7 a step
FINER = 4  # parts of a step where a pocket of gas acts: 1e4 /s at its wall, 0.6 a part, stable up to 2.5


class Runaway(ValueError):
    """A simulation left all bounds."""


@cache
def library() -> ctypes.CDLL:
    """world.c, compiled once for each content; several processes may do so at once."""
    name = hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    target = Path(tempfile.gettempdir()) / f"penode-worlds-{os.getuid()}" / f"{name}.so"
    if not target.exists():
        target.parent.mkdir(exist_ok=True)
        part = target.with_suffix(f".{os.getpid()}")
        subprocess.run(["gcc", "-O2", "-fPIC", "-shared", "-o", str(part), str(SOURCE), "-lm"], check=True)
        part.rename(target)
    return ctypes.CDLL(str(target))


@dataclass
class Law:
    """Force of a place: one of LAWS with its parameters; `role` is nominal, mis or effect0, effect1."""

    place: str
    law: str
    p: list[float]
    role: str = "nominal"


@dataclass
class Plant:
    """Coordinates with inertia, places (coefficients of coordinates, then inputs), gains of inputs as forces, laws."""

    inertia: list[float]
    inputs: list[str]
    places: dict[str, list[float]]
    gains: Array  # [n, n_u]
    laws: list[Law] = field(default_factory=list)

    def add_mass(self, mass: float, on: int) -> str:
        """One more coordinate, and the place between coordinate `on` and it."""
        n = len(self.inertia)
        for row in self.places.values():
            row.insert(n, 0.0)
        self.inertia.append(mass)
        self.gains = np.vstack([self.gains, np.zeros((1, len(self.inputs)))])
        row = [0.0] * (n + 1 + len(self.inputs))
        row[on], row[n] = 1.0, -1.0
        self.places[f"mass{n}"] = row
        return f"mass{n}"


@dataclass
class Run:
    """Per sample: q, rates, accelerations [N, n]; deflection and rate of each place [N]; force of each law [N]."""

    q: Array
    dq: Array
    ddq: Array
    s: dict[str, Array]
    v: dict[str, Array]
    force: list[Array]


def denser(x: Array, times: int) -> Array:
    """Rows joined by straight lines, so many for one."""
    if times == 1 or not x.shape[1]:
        return x if times == 1 else np.zeros(((len(x) - 1) * times + 1, 0))
    at = np.arange((len(x) - 1) * times + 1) / times
    return np.column_stack([np.interp(at, np.arange(len(x)), c) for c in x.T])


def run(plant: Plant, u: Array, ext: Array, start: Array, every: int, h: float = STEP) -> Run:
    """Simulate; u [steps + 1, n_u] and ext [steps + 1, n] at every step, start [2 n], a sample every so many steps."""
    n, nu, nl, steps = len(plant.inertia), len(plant.inputs), len(plant.laws), len(ext) - 1
    du = np.gradient(u, h, axis=0) if nu else u
    fine = FINER if any(x.law == "aerated" for x in plant.laws) else 1
    names = list(plant.places)
    A = np.array([plant.places[k] for k in names])
    p = np.zeros((nl, 8))
    for i, one in enumerate(plant.laws):
        p[i, : len(one.p)] = one.p
    out = np.zeros((steps // every + 1, 3 * n + nl))
    ints = [np.array([LAWS.index(x.law) for x in plant.laws], np.int32), np.array([names.index(x.place) for x in plant.laws], np.int32)]
    held = [np.ascontiguousarray(x, float) for x in (plant.inertia, A, plant.gains)]
    held += ints + [np.ascontiguousarray(x, float) for x in (p, *(denser(x, fine) for x in (u, du, ext)), start)]
    ptr = [x.ctypes.data_as(ctypes.c_void_p) for x in held]
    if library().world_run(
        n,
        nu,
        len(names),
        nl,
        *ptr,
        ctypes.c_long(steps * fine),
        ctypes.c_double(h / fine),
        every * fine,
        out.ctypes.data_as(ctypes.c_void_p),
    ):
        raise Runaway
    us, dus = u[::every][: len(out)], du[::every][: len(out)]
    q, dq = out[:, :n], out[:, n : 2 * n]
    s = {k: q @ A[i, :n] + us @ A[i, n:] for i, k in enumerate(names)}
    v = {k: dq @ A[i, :n] + dus @ A[i, n:] for i, k in enumerate(names)}
    return Run(q, dq, out[:, 2 * n : 3 * n], s, v, [out[:, 3 * n + i] for i in range(nl)])
