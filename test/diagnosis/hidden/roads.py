# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Inputs as functions of time: chirps, ISO 8608 roads, bumps and mixtures, smooth and band-limited to about 35 Hz."""

from collections.abc import Callable

import numpy as np

ISO_CLASSES = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}  # m^3 at 0.1 cycles/m, centre of the class
BAND = (0.2, 35.0)  # Hz; below, a vehicle follows; above, the contact patch of the tyre averages

Input = Callable[[np.ndarray], np.ndarray]  # time [s], uniform -> value


def fade_in(time: np.ndarray, seconds: float) -> np.ndarray:
    """0 to 1 with two continuous derivatives."""
    u = np.clip(time / seconds, 0, 1)
    return u**3 * (10 - 15 * u + 6 * u**2)


def chirp(amplitude: float, first: float, last: float, duration: float, constant_velocity: bool, phase: float = 0.0) -> Input:
    """Logarithmic sweep; the amplitude [m], or with constant velocity [m/s]."""

    def of(time: np.ndarray) -> np.ndarray:
        rate = np.log(last / first) / duration
        frequency = first * np.exp(rate * time)
        level = amplitude / (2 * np.pi * frequency) if constant_velocity else amplitude
        return level * (np.sin(2 * np.pi * (frequency - first) / rate + phase) - np.sin(phase) * np.exp(-time)) * fade_in(time, 0.5)

    return of


def coloured(rng: np.random.Generator, psd: Callable[[np.ndarray], np.ndarray], band: tuple[float, float] = BAND) -> Input:
    """Gaussian process with the one-sided PSD [unit^2/Hz] of frequency [Hz] inside the band; the same draw at every call."""
    seed = int(rng.integers(2**63))

    def of(time: np.ndarray) -> np.ndarray:
        draw, step = np.random.default_rng(seed), time[1] - time[0]
        n = 1 << (len(time) - 1).bit_length()
        f = np.fft.rfftfreq(n, step)
        inside = (f >= band[0]) & (f <= 3 * band[1])
        level = np.zeros(len(f))
        level[inside] = np.sqrt(psd(f[inside]) / (1 + (f[inside] / band[1]) ** 8) * n / (4 * step))
        both = draw.standard_normal((2, len(f)))
        return np.fft.irfft(level * (both[0] + 1j * both[1]), n)[: len(time)]

    return of


def iso8608(rng: np.random.Generator, road_class: str, speed: float) -> Input:
    """Road height [m] at a constant speed [m/s]: waviness 2, so the PSD in time is G(n0) n0^2 speed / f^2."""
    return coloured(rng, lambda f: ISO_CLASSES[road_class] * 0.1**2 * speed / f**2)


def bumps(rng: np.random.Generator, duration: float, speed: float, count: int) -> Input:
    """Bumps and potholes of (1 - cos) form, 10 to 60 mm, 0.6 to 4 m long."""
    start = np.sort(rng.uniform(0.5, duration - 1.0, count))
    length = np.maximum(rng.uniform(0.6, 4.0, count) / speed, 0.06)  # s
    height = rng.choice([-1, 1], count) * rng.uniform(0.01, 0.06, count)

    def of(time: np.ndarray) -> np.ndarray:
        u = np.clip((time[:, None] - start) / length, 0, 1)
        return (0.5 * height * (1 - np.cos(2 * np.pi * u))).sum(axis=1)

    return of


def draw(rng: np.random.Generator, duration: float) -> tuple[str, Input]:
    """A random road [m] of at least this duration, flat at its start."""
    kind = rng.choice(["chirp of amplitude", "chirp of velocity", "iso", "iso", "bumps", "mixed", "mixed"])
    speed = rng.uniform(6, 30)
    road_class = rng.choice(list("ABCD"), p=[0.1, 0.3, 0.35, 0.25])
    label, parts = kind, []
    if kind.startswith("chirp"):
        first, last = rng.uniform(0.3, 0.8), rng.uniform(16, 25)
        parts = [chirp(rng.uniform(2e-3, 8e-3) if "amp" in kind else rng.uniform(0.05, 0.3), first, last, duration, "vel" in kind)]
    if kind in ("iso", "mixed"):
        label = f"{kind} {road_class} at {speed:.1f} m/s"
        parts.append(iso8608(rng, road_class, speed))
    if kind in ("bumps", "mixed"):
        parts.append(bumps(rng, duration, rng.uniform(4, 12), int(rng.integers(4, 12))))

    def of(time: np.ndarray) -> np.ndarray:
        total = sum(part(time) for part in parts)
        return (total - total[0]) * fade_in(time, 1.0)

    return str(label), of


def draw_other(rng: np.random.Generator, duration: float, level: float) -> tuple[str, Input]:
    """A random force or prescribed motion of about this level: sweep, noise or some sines of slowly changing amplitude."""
    kind = rng.choice(["sweep", "noise", "sines"])
    if kind == "sweep":
        part = chirp(level, rng.uniform(0.3, 0.6), rng.uniform(8, 15), duration, False)
    elif kind == "noise":
        corner = rng.uniform(2, 6)
        part = coloured(rng, lambda f: 0.15 * level**2 / corner / (1 + (f / corner) ** 4), (0.2, 20.0))
    else:
        f, phase = rng.uniform(0.4, 6, 3), rng.uniform(0, 2 * np.pi, 3)
        slow = rng.uniform(0.03, 0.1)

        def part(time: np.ndarray) -> np.ndarray:
            waves = np.sin(2 * np.pi * f * time[:, None] + phase) / np.sqrt(f)
            return level * waves.sum(axis=1) * (0.55 + 0.45 * np.sin(2 * np.pi * slow * time + phase[0]))

    def of(time: np.ndarray) -> np.ndarray:
        total = part(time)
        return (total - total[0]) * fade_in(time, 1.0)

    return str(kind), of
