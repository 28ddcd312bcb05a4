# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Half-car with pitch and two-mass drive with something hidden: equations by hand, Runge-Kutta of order 4 in steps of half a millisecond,
many cases at once (the last axis of every array). Knows nothing of the program that explains.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SAMPLE = 1e-3
HALVES = 4  # of half a step: the inputs are known there
KINDS = {"halfcar": ("friction", "stop", "inertia", "nothing"), "drive": ("backlash", "cubic", "friction", "nothing")}
WHERE = {  # the ends between which the hidden force acts
    ("halfcar", "friction"): ("rear", "wheel_r"),
    ("halfcar", "stop"): ("front", "wheel_f"),
    ("halfcar", "inertia"): ("pitch", "ground"),
    ("drive", "backlash"): ("shaft_in", "load"),
    ("drive", "cubic"): ("shaft_in", "load"),
    ("drive", "friction"): ("load", "ground"),
}
TOLERANCE = 0.003  # of the model files; true values lie within 0.4 of it, one deviation


@dataclass(frozen=True)
class Case:
    """One recording: inputs u [n, n_u], sensors y [n, n_z] with noise, and the hidden force [n] as it acted (0 without)."""

    plant: str
    kind: str
    seed: int
    time: Array
    u: Array
    y: Array
    hidden: Array


def integrate(rates: Callable[[Array, Array], Array], u: Array, n_x: int) -> Array:
    """States [n, n_x, cases] at every sample from rest; u [2 steps + 1, n_u, cases] at half steps."""
    h = 2.0 * SAMPLE / HALVES
    x = np.zeros((n_x, u.shape[2]))
    found = [x]
    for k in range(0, len(u) - 1, 2):
        k1 = rates(x, u[k])
        k2 = rates(x + 0.5 * h * k1, u[k + 1])
        k3 = rates(x + 0.5 * h * k2, u[k + 1])
        k4 = rates(x + h * k3, u[k + 2])
        x = x + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
        if (k + 2) % HALVES == 0:
            found.append(x)
    return np.array(found)


def noises(t: Array, low: float, high: float, fall: float, rng: np.random.Generator) -> Array:
    """A sum of sines [n] of random phase that begins smoothly, 1 at most about; amplitudes fall with frequency to that power."""
    f = np.arange(low, high, 0.125)
    size = f**-fall * rng.uniform(0.5, 1.0, len(f))
    phase = rng.uniform(0.0, 2.0 * np.pi, len(f))
    wave = sum(a * np.sin(2.0 * np.pi * x * t + p) for a, x, p in zip(size, f, phase, strict=True))
    begin = np.clip(t / 0.5, 0.0, 1.0)
    return wave * begin**3 * (10.0 - 15.0 * begin + 6.0 * begin**2) / (2.0 * np.sqrt(np.sum(size**2) / 2.0))


def drawn(rng: np.random.Generator, **values: float) -> dict[str, float]:
    """True values near those of the model file."""
    return {k: v * (1.0 + 0.4 * TOLERANCE * float(np.clip(rng.standard_normal(), -2.0, 2.0))) for k, v in values.items()}


def halfcar(kinds: list[str], seeds: list[int], seconds: float) -> list[Case]:
    """Half-cars over the same road front and rear, 20 m/s and 2.6 m apart."""
    t = np.arange(round(seconds / SAMPLE) * HALVES + 1) * SAMPLE / HALVES
    rngs = [np.random.default_rng([seed, 1]) for seed in seeds]
    stated = {"m": 600.0, "J": 900.0, "mf": 40.0, "mr": 45.0, "cf": 18e3, "cr": 21e3, "df": 1300.0, "dr": 1500.0, "tf": 19e4, "tr": 20e4}
    each = [drawn(rng, **stated) for rng in rngs]
    for one, kind, rng in zip(each, kinds, rngs, strict=True):
        one["J"] *= 1.0 + (rng.choice([-1.0, 1.0]) * rng.uniform(0.12, 0.25) if kind == "inertia" else 0.0)
    p = {k: np.array([one[k] for one in each]) for k in stated}
    level = np.array([rng.uniform(90.0, 180.0) if k == "friction" else 0.0 for k, rng in zip(kinds, rngs, strict=True)])
    width = np.array([rng.uniform(0.01, 0.03) for rng in rngs])
    stiff = np.array([rng.uniform(4e4, 9e4) if k == "stop" else 0.0 for k, rng in zip(kinds, rngs, strict=True)])
    gap = np.array([rng.uniform(0.008, 0.014) for rng in rngs])
    heights = []
    for rng in rngs:
        long = noises(np.arange(len(t) + 520) * SAMPLE / HALVES, 0.5, 18.0, 1.2, rng) * 0.012
        heights.append(np.stack([long[520:] - long[520], long[:-520]]))
    u = np.moveaxis(np.array(heights), 0, -1).transpose(1, 0, 2)
    u = u * np.clip(t / 0.3, 0.0, 1.0)[:, None, None] ** 3
    a, b = 1.2, 1.4

    def parts(x: Array) -> tuple[Array, ...]:
        z, theta, wf, wr, v, omega, vf, vr = x
        sf, sr = z - a * theta - wf, z + b * theta - wr
        rf, rr = v - a * omega - vf, v + b * omega - vr
        return sf, rf, sr, rr, -stiff * np.maximum(-sf - gap, 0.0), level * np.tanh(rr / width)

    def rates(x: Array, road: Array) -> Array:
        sf, rf, sr, rr, stop, rub = parts(x)
        front, rear = p["cf"] * sf + p["df"] * rf + stop, p["cr"] * sr + p["dr"] * rr + rub
        tyre_f, tyre_r = p["tf"] * (x[2] - road[0]), p["tr"] * (x[3] - road[1])
        turn = (a * front - b * rear) / p["J"]
        return np.stack([*x[4:], -(front + rear) / p["m"], turn, (front - tyre_f) / p["mf"], (rear - tyre_r) / p["mr"]])

    x = integrate(rates, u, 8)
    road = u[::HALVES]
    acc = np.array([rates(xk, uk)[4:] for xk, uk in zip(x, road, strict=True)])
    sf, _, sr, _, stop, rub = parts(x.transpose(1, 0, 2))
    clean = np.stack([acc[:, 0] - a * acc[:, 1], acc[:, 0] + b * acc[:, 1], acc[:, 2], acc[:, 3], sf, sr], axis=1)
    noise = np.array([0.01, 0.01, 0.03, 0.03, 2e-5, 2e-5])
    cases = []
    for i, (kind, seed, rng) in enumerate(zip(kinds, seeds, rngs, strict=True)):
        hidden = {"friction": rub[:, i], "stop": stop[:, i], "inertia": (p["J"][i] - 900.0) * acc[:, 1, i]}.get(kind, np.zeros(len(x)))
        y = clean[:, :, i] + noise * rng.standard_normal(clean.shape[:2])
        cases.append(Case("halfcar", kind, seed, t[::HALVES], road[:, :, i], y, hidden))
    return cases


def drive(kinds: list[str], seeds: list[int], seconds: float) -> list[Case]:
    """Two-mass drives under a torque that reverses often."""
    t = np.arange(round(seconds / SAMPLE) * HALVES + 1) * SAMPLE / HALVES
    rngs = [np.random.default_rng([seed, 2]) for seed in seeds]
    stated = {"jm": 0.02, "jl": 0.8, "k": 900.0, "d": 3.0, "dl": 0.5, "dm": 0.03}
    each = [drawn(rng, **stated) for rng in rngs]
    p = {k: np.array([one[k] for one in each]) for k in stated}
    gap = np.array([rng.uniform(1e-3, 2.5e-3) if k == "backlash" else 0.0 for k, rng in zip(kinds, rngs, strict=True)])
    cubic = np.array([rng.uniform(4e6, 1e7) if k == "cubic" else 0.0 for k, rng in zip(kinds, rngs, strict=True)])
    level = np.array([rng.uniform(0.4, 1.2) if k == "friction" else 0.0 for k, rng in zip(kinds, rngs, strict=True)])
    width = np.array([rng.uniform(0.05, 0.15) for rng in rngs])
    u = np.stack([2.5 * noises(t, 0.5, 10.0, 0.7, rng) for rng in rngs], axis=-1)[:, None, :]

    def parts(x: Array) -> tuple[Array, ...]:
        s, r = x[0] / 3.0 - x[1], x[2] / 3.0 - x[3]
        return s, r, -p["k"] * np.clip(s, -gap, gap) + cubic * s**3, level * np.tanh(x[3] / width)

    def rates(x: Array, tau: Array) -> Array:
        s, r, shaft, rub = parts(x)
        torque = p["k"] * s + p["d"] * r + shaft
        return np.stack([x[2], x[3], (tau[0] - p["dm"] * x[2] - torque / 3.0) / p["jm"], (torque - p["dl"] * x[3] - rub) / p["jl"]])

    x = integrate(rates, u, 4)
    _, _, shaft, rub = parts(x.transpose(1, 0, 2))
    cases = []
    for i, (kind, seed, rng) in enumerate(zip(kinds, seeds, rngs, strict=True)):
        hidden = {"backlash": shaft[:, i], "cubic": shaft[:, i], "friction": rub[:, i]}.get(kind, np.zeros(len(x)))
        y = x[:, :2, i] + 1e-6 * rng.standard_normal((len(x), 2))
        cases.append(Case("drive", kind, seed, t[::HALVES], u[::HALVES, :, i], y, hidden))
    return cases


def cases(plant: str, number: int, seed: int, seconds: float = 6.0) -> list[Case]:
    """So many cases, their kinds in turn."""
    kinds = [KINDS[plant][i % 4] for i in range(number)]
    made = {"halfcar": halfcar, "drive": drive}[plant](kinds, [seed + i for i in range(number)], seconds)
    return [case if case.hidden.any() else replace(case, kind="nothing") for case in made]  # a stop that is never reached
