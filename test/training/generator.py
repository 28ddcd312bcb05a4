# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings of a quarter vehicle to train on, from a plant of their own (plant.c): shares no code with what trains.

The setting is that of the predecessor of the neural quarter vehicle model: ISO 8608 road of class D, 1 kHz, 42 s, body and wheel
acceleration with noise of 0.02 and 0.1 m/s^2 times `noise`; 8 s of lead before it, so that the start state is unknown.
"""

from __future__ import annotations

import ctypes
import functools
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FINE = 5e-5  # [s] between samples of the road
LEAD = 8.0  # [s] before a recording
SIGMA = 0.02, 0.1  # [m/s^2]
PLAIN = {"m_b": 350.0, "m_w": 90.0, "c": 1e4, "d": 800.0, "c_t": 3e5, "d_t": 300.0}


class _Plant(ctypes.Structure):
    _fields_ = [(n, ctypes.c_double) for n in ("m_b", "m_w", "c", "d", "c_t", "d_t")]
    _fields_ += [("spring", ctypes.c_int), ("damper", ctypes.c_int), ("spring_by", ctypes.c_double * 4), ("damper_by", ctypes.c_double * 4)]


@dataclass(frozen=True)
class Truth:
    """What the plant is: kinds of spring and damper force of plant.c, and their numbers."""

    spring: int = 1
    spring_by: tuple[float, ...] = (500.0, 0.03, 0.0, 0.0)
    damper: int = 1
    damper_by: tuple[float, ...] = (45.0, 35.0, 0.02, 150.0)
    plain: tuple[tuple[str, float], ...] = tuple(PLAIN.items())

    def force(self, which: int, s: Array, v: Array) -> Array:
        """Spring (0), damper (1) or both (2) at deflections s and rates v."""
        library, plant = _library(), _filled(self)
        return np.array([library.force_of(ctypes.byref(plant), which, a, b) for a, b in zip(s, v, strict=True)])


TWO_INPUTS = Truth(spring=0, damper=3, damper_by=(9000.0, 1.5e5, 60.0, 0.1))
STOPS = Truth(spring=2, spring_by=(2e6, 6e4, 0.025, 0.03), damper=2, damper_by=(900.0, 0.4, 500.0, 0.8))


@functools.cache
def _library() -> ctypes.CDLL:
    folder = Path(tempfile.mkdtemp())
    source = Path(__file__).with_name("plant.c")
    subprocess.run(["gcc", "-std=c99", "-O2", "-fPIC", "-shared", str(source), "-lm", "-o", str(folder / "plant.so")], check=True)
    library = ctypes.CDLL(str(folder / "plant.so"))
    library.force_of.restype = ctypes.c_double
    library.force_of.argtypes = (ctypes.c_void_p, ctypes.c_int, ctypes.c_double, ctypes.c_double)
    library.measure.argtypes = (
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_void_p,
        ctypes.c_int,
        ctypes.c_int,
        ctypes.c_double,
        ctypes.c_void_p,
    )
    return library


def _filled(truth: Truth) -> _Plant:
    plant = _Plant(**dict(truth.plain), spring=truth.spring, damper=truth.damper)
    plant.spring_by[:], plant.damper_by[:] = truth.spring_by, truth.damper_by
    return plant


def road(seed: int, speed: float, seconds: float) -> tuple[Array, Array]:
    """Height [m] and its rate [m/s] of a class D road every FINE seconds: wave numbers 0.01 to 4 /m, random phases."""
    samples = 1 << int(np.ceil(np.log2(seconds / FINE + 3)))
    wave = np.fft.rfftfreq(samples, speed * FINE)
    density = np.where((wave >= 0.01) & (wave <= 4.0), 1024e-6 * (np.maximum(wave, 1e-9) / 0.1) ** -2, 0.0)
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(wave))
    spectrum = np.sqrt(density * samples / (2.0 * speed * FINE)) * np.exp(1j * phases)
    rate = np.fft.irfft(spectrum * 2j * np.pi * wave * speed, samples)
    height = np.fft.irfft(spectrum, samples)
    return height - height[0], rate


@dataclass(frozen=True, eq=False)
class Made:
    """Time, road and its rate, accelerations with noise, and without: deflection and its rate; [n] each, 1 kHz."""

    time: Array
    road: Array
    rate: Array
    a_body: Array
    a_wheel: Array
    deflection: Array
    speed: Array

    def write(self, path: Path, rate: bool = False) -> Path:
        """As a table with units; the road's rate as input where asked for."""
        name, drive = ("u [m/s]", self.rate) if rate else ("z_road [m]", self.road)
        table = np.stack([self.time, drive, self.a_body, self.a_wheel], axis=1)
        np.savetxt(
            path,
            table,
            fmt=["%.6f", "%.15g", "%.9g", "%.9g"],
            delimiter=",",
            comments="",
            header=f"time [s],{name},a_body [m/s^2],a_wheel [m/s^2]",
        )
        return path


def make(truth: Truth, seed: int, noise: float = 1.0, speed: float = 5.0, seconds: float = 42.0) -> Made:
    """A recording."""
    every = round(1e-3 / (2.0 * FINE))
    n = round((LEAD + seconds) * 1000.0)
    height, rate = road(seed, speed, n * 1e-3)
    y = np.zeros((n, 4))
    _library().measure(ctypes.byref(_filled(truth)), height.ctypes.data, rate.ctypes.data, n, every, 2.0 * FINE, y.ctypes.data)
    lead = int(LEAD * 1000)
    shown, rows = y[lead:], slice(lead * 2 * every, n * 2 * every, 2 * every)
    random = np.random.default_rng([seed, 7])
    a_body, a_wheel = (shown[:, i] + noise * s * random.standard_normal(len(shown)) for i, s in enumerate(SIGMA))
    return Made(np.arange(n - lead) * 1e-3, height[rows], rate[rows], a_body, a_wheel, shown[:, 2], shown[:, 3])


def main() -> None:
    """The recordings of `make train`, into the folder named."""
    folder = Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    for name, seed in (("train", 1), ("holdout", 101)):
        print(make(Truth(), seed).write(folder / f"{name}.csv"))


if __name__ == "__main__":
    main()
