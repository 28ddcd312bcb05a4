# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Excitations: sums of sines, random steps, chirps; and how a plant sees them between the rows of a recording."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .solver import Array

Wave = Callable[[Array], Array]
Drive = Callable[[Array, Array], Array]  # inputs at half steps, of the times of half steps and of rows
BEFORE = 1e3  # s for which a held signal has had its first value


def sines(rng: np.random.Generator, n: int, band: tuple[float, float], rms: float, slope: float = 0.0) -> Wave:
    """A sum of n sines in a band (Hz), whose amplitudes fall with the frequency to the power of `slope`."""
    low, high = np.log(band)
    f = np.exp(rng.uniform(low, high, n))
    phase = rng.uniform(0, 2 * np.pi, n)
    a = f ** (-slope)
    a *= rms * np.sqrt(2 / np.sum(a * a))

    def wave(t: Array) -> Array:
        parts = a[:, None] * np.sin(2 * np.pi * f[:, None] * np.ravel(t)[None, :] + phase[:, None])
        return np.sum(parts, 0).reshape(np.shape(t))

    return wave


def chirp(band: tuple[float, float], amplitude: float, duration: float) -> Wave:
    """A sine whose frequency (Hz) rises evenly through a band."""
    low, high = band
    return lambda t: amplitude * np.sin(2 * np.pi * (low * t + (high - low) * t * t / 2 / duration))


def stairs(rng: np.random.Generator, duration: float, pause: tuple[float, float], amplitude: float, mean: float = 0.0) -> Wave:
    """Random levels, each held for a random pause (s)."""
    edges, levels = [0.0], [0.0]
    t = rng.uniform(*pause) * 0.3
    while t < duration:
        edges.append(t)
        levels.append(mean + rng.uniform(-1, 1) * amplitude)
        t += rng.uniform(*pause)
    at, value = np.array(edges), np.array(levels)
    return lambda t: value[np.clip(np.searchsorted(at, t + 1e-7, side="right") - 1, 0, len(value) - 1)]


def begun(f: Wave, rise: float) -> Wave:
    """A wave that rises from 0 with two continuous derivatives."""

    def wave(t: Array) -> Array:
        s = np.clip(t / rise, 0, 1)
        return s**3 * (10 - 15 * s + 6 * s * s) * f(t)

    return wave


def in_turn(rest: float, parts: tuple[Wave, ...], ends: tuple[float, ...], limits: tuple[float, float]) -> Wave:
    """0 for `rest` s, then one wave after the other, each up to its end but the last; limited."""

    def wave(t: Array) -> Array:
        y = parts[-1](t)
        for f, end in zip(parts[-2::-1], ends[::-1], strict=True):
            y = np.where(t < end, f(t), y)
        return np.clip(np.where(t < rest, 0.0, y), *limits)

    return wave


def averaged(f: Wave, span: float, n: int) -> Wave:
    """The mean over the last `span` s, of n values."""
    return lambda t: sum((f(t - s) for s in np.linspace(0, span, n)), np.zeros(np.shape(t))) / n


def smooth(*waves: Wave) -> Drive:
    """Inputs that the plant sees as they are."""
    return lambda half, _rows: np.stack([f(half) for f in waves], axis=2)


def none(half: Array, _rows: Array) -> Array:
    """No input."""
    return np.zeros((*half.shape, 1))


def rounded(f: Wave, step: float) -> Wave:
    """A wave quantised to steps."""
    return lambda t: np.round(f(t) / step) * step


def held(f: Wave, step: float, delay: float = 0.0) -> Drive:
    """A controller that puts out a quantised value at each row and holds it; it may act later."""

    def drive(half: Array, rows: Array) -> Array:
        value = rounded(f, step)(rows)
        seen = late(rows, value, half, delay) if delay else np.repeat(value[:-1, None], half.shape[1], axis=1)
        return seen[:, :, None]

    return drive


def late(rows: Array, value: Array, half: Array, delay: float) -> Array:
    """A held signal that acts later by any number of seconds: its mean over a half step around each half step."""
    width = (rows[1] - rows[0]) / (half.shape[1] - 1)
    edges = np.append(rows, rows[-1] + 10 * (rows[-1] - rows[-2]))
    area = np.concatenate([[-BEFORE * value[0], 0], np.cumsum(value * np.diff(edges))])
    edges = np.concatenate([[rows[0] - BEFORE], edges])
    return (np.interp(half - delay + width / 2, edges, area) - np.interp(half - delay - width / 2, edges, area)) / width
