# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The world as it is: masses on one axis and force laws between them, integrated by plant.c at 20 kHz."""

import ctypes
import hashlib
import os
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache
from pathlib import Path

import numpy as np

GROUND, MOTION, AUXILIARY = -1, -2, -3
TABLE_HALF = 4096
RATE = 4000.0  # Hz, of all noise-free signals; every sample rate of a recording divides it
KNOT_RATE = RATE  # Hz, of the inputs; a cubic runs through them
STEPS = 5  # a signal sample: 20 kHz

Curve = Callable[[np.ndarray], np.ndarray]
Track = Callable[[np.ndarray, np.ndarray], np.ndarray]  # (time [s], input) -> values at the same times


class Kind(IntEnum):
    """Laws of plant.c."""

    LINEAR = 0
    RATE_CURVE = 1
    DEFLECTION_CURVE = 2
    BRISTLE = 3
    LUGRE = 4
    SLIDER = 5
    SERIES = 6
    HEATED = 7
    TRACK = 8
    SKYHOOK = 9
    TRACK_SPRING = 10
    CONTACT = 11


@dataclass(frozen=True)
class Law:
    """A force between two ends that pulls them together; `curve` is its static part, `p` what plant.c says."""

    kind: Kind
    a: int
    b: int
    p: tuple[float, ...] = ()
    curve: Curve | None = None
    scale: float = 1e-3  # where the table turns from linear to logarithmic
    reach: float = 20.0  # last argument of the table


@dataclass(frozen=True)
class World:
    """What is simulated. `inverse` overrules the inverse mass matrix; `auxiliary` makes the second input of the first."""

    masses: tuple[float, ...]  # kg
    laws: Mapping[str, Law]
    inverse: np.ndarray | None = None
    auxiliary: Track = field(default=lambda time, motion: np.ones_like(time))
    felt: Track = field(default=lambda time, motion: motion)  # the motion that acts, of the one that is measured


@dataclass(frozen=True)
class Motion:
    """Noise-free signals at RATE: positions, velocities, accelerations [n, masses], reaction [n]; last states of the laws."""

    z: np.ndarray
    v: np.ndarray
    a: np.ndarray
    reaction: np.ndarray
    memory: Mapping[str, float]


class _Law(ctypes.Structure):
    _fields_ = [
        ("kind", ctypes.c_int),
        ("a", ctypes.c_int),
        ("b", ctypes.c_int),
        ("unused", ctypes.c_int),
        ("p", ctypes.c_double * 4),
        ("table", ctypes.c_void_p),
        ("scale", ctypes.c_double),
        ("per_step", ctypes.c_double),
    ]


class _Plant(ctypes.Structure):
    _fields_ = [
        ("masses", ctypes.c_int),
        ("laws", ctypes.c_int),
        ("inverse", ctypes.c_void_p),
        ("law", ctypes.POINTER(_Law)),
        ("motion", ctypes.c_void_p),
        ("auxiliary", ctypes.c_void_p),
        ("knot_rate", ctypes.c_double),
        ("knots", ctypes.c_size_t),
    ]


@cache
def _library() -> ctypes.CDLL:
    source = Path(__file__).with_name("plant.c")
    folder = Path(__file__).parents[3] / "build" / "diagnosis"
    built = folder / f"plant-{hashlib.sha256(source.read_bytes()).hexdigest()[:16]}.so"
    if not built.exists():
        folder.mkdir(parents=True, exist_ok=True)
        part = built.with_suffix(f".{os.getpid()}")
        subprocess.run(["gcc", "-O2", "-std=c99", "-shared", "-fPIC", "-o", part, source, "-lm"], check=True)
        part.replace(built)
    library = ctypes.CDLL(str(built))
    library.simulate.argtypes = [ctypes.POINTER(_Plant), ctypes.c_void_p, ctypes.c_double, ctypes.c_size_t, ctypes.c_int, ctypes.c_void_p]
    return library


def knots(duration: float) -> np.ndarray:
    """Times [s] at which an input of this duration has to be given: two before 0 and three after the end."""
    return (np.arange(round(duration * KNOT_RATE) + 6) - 2) / KNOT_RATE


def simulate(world: World, motion: np.ndarray, start: np.ndarray | None = None, steps: int = STEPS) -> Motion:
    """Response to an input given at `knots`; from rest, or from `start` [2, masses]. ArithmeticError if it blows up."""
    n, laws = len(world.masses), list(world.laws.values())
    count = int((len(motion) - 6) / KNOT_RATE * RATE + 0.5)
    time = (np.arange(len(motion)) - 2) / KNOT_RATE
    keep, table = [], (_Law * len(laws))()
    for slot, law in zip(table, laws, strict=True):
        slot.kind, slot.a, slot.b, slot.scale = law.kind, law.a, law.b, law.scale
        slot.p[: len(law.p)] = law.p
        if law.curve is not None:
            slot.per_step = TABLE_HALF / np.arcsinh(law.reach / law.scale)
            points = law.scale * np.sinh(np.arange(-TABLE_HALF, TABLE_HALF + 1) / slot.per_step)
            keep.append(np.zeros_like(points) + law.curve(points))
            slot.table = keep[-1].ctypes.data
    inverse = np.diag(1.0 / np.array(world.masses)) if world.inverse is None else world.inverse
    inputs = [np.ascontiguousarray(x, dtype=float) for x in (inverse, world.felt(time, motion), world.auxiliary(time, motion))]
    x = np.zeros(2 * n + len(laws))
    if start is not None:
        x[: 2 * n] = np.ravel(start)
    out = np.empty((count, 3 * n + 1))
    plant = _Plant(n, len(laws), inputs[0].ctypes.data, table, inputs[1].ctypes.data, inputs[2].ctypes.data, KNOT_RATE, len(motion))
    if _library().simulate(plant, x.ctypes.data, RATE, count, steps, out.ctypes.data):
        raise ArithmeticError("the hidden plant is unstable")
    z, v, a = (out[:, i * n : (i + 1) * n] for i in range(3))
    return Motion(z, v, a, out[:, -1], dict(zip(world.laws, x[2 * n :], strict=True)))
