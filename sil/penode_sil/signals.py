# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Input signals as functions of continuous time: MiL takes them as they are, SiL and PiL sample them.

Each has value(t) and slope(t) for an array of times [s], and knots(): the times at which a derivative jumps, so that
an integrator can stop there. All in SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.special import fresnel

Array = NDArray[np.float64]


class Signal(Protocol):
    """What every kind of signal can do."""

    def value(self, t: Array) -> Array: ...

    def slope(self, t: Array) -> Array: ...

    def knots(self) -> tuple[float, ...]: ...


class Smooth:
    """A signal without knots."""

    def knots(self) -> tuple[float, ...]:
        return ()


@dataclass(frozen=True)
class Constant(Smooth):
    """The same value at all times."""

    level: float

    def value(self, t: Array) -> Array:
        return np.full_like(np.asarray(t, dtype=float), self.level)

    def slope(self, t: Array) -> Array:
        return np.zeros_like(np.asarray(t, dtype=float))


def _phase(t: Array, frequency: float, rate: float, phase: float) -> Array:
    """Phase [rad] of a sine whose frequency [Hz] is frequency + rate*t."""
    return phase + 2.0 * math.pi * (frequency * t + 0.5 * rate * t * t)


@dataclass(frozen=True)
class Chirp(Smooth):
    """amplitude * sin(phase(t)) with frequency [Hz] = frequency + rate*t, phase [rad] at t = 0."""

    amplitude: float
    frequency: float
    rate: float
    phase: float

    def value(self, t: Array) -> Array:
        return self.amplitude * np.sin(_phase(t, self.frequency, self.rate, self.phase))

    def slope(self, t: Array) -> Array:
        omega = 2.0 * math.pi * (self.frequency + self.rate * t)
        return self.amplitude * omega * np.cos(_phase(t, self.frequency, self.rate, self.phase))


@dataclass(frozen=True)
class VelocityChirp(Smooth):
    """The exact integral from 0 of velocity * sin(phase(t)); phase as in Chirp.

    With tau = t + frequency/rate the phase is pi*rate*tau^2 + c, so that the integral is one of Fresnel's.
    """

    velocity: float
    frequency: float
    rate: float
    phase: float

    def value(self, t: Array) -> Array:
        t = np.asarray(t, dtype=float)
        if self.rate == 0.0:
            if self.frequency == 0.0:
                return self.velocity * math.sin(self.phase) * t
            omega = 2.0 * math.pi * self.frequency
            return self.velocity / omega * (math.cos(self.phase) - np.cos(omega * t + self.phase))
        sign, rate = math.copysign(1.0, self.rate), abs(self.rate)
        scale = math.sqrt(2.0 * rate)
        c = self.phase - math.pi * self.frequency**2 / self.rate
        s1, c1 = fresnel((t + self.frequency / self.rate) * scale)
        s0, c0 = fresnel(self.frequency / self.rate * scale)
        return self.velocity / scale * (sign * (s1 - s0) * math.cos(c) + (c1 - c0) * math.sin(c))

    def slope(self, t: Array) -> Array:
        return self.velocity * np.sin(_phase(np.asarray(t, dtype=float), self.frequency, self.rate, self.phase))


def _smootherstep(x: Array) -> tuple[Array, Array]:
    """0 to 1 over x in [0, 1] with two continuous derivatives, and its derivative."""
    x = np.clip(x, 0.0, 1.0)
    return x**3 * (10.0 - 15.0 * x + 6.0 * x * x), 30.0 * x * x * (1.0 - x) ** 2


@dataclass(frozen=True)
class Ramp:
    """From 0 to height over [start, start + rise], with continuous velocity and acceleration."""

    height: float
    start: float
    rise: float

    def value(self, t: Array) -> Array:
        return self.height * _smootherstep((np.asarray(t, dtype=float) - self.start) / self.rise)[0]

    def slope(self, t: Array) -> Array:
        return self.height / self.rise * _smootherstep((np.asarray(t, dtype=float) - self.start) / self.rise)[1]

    def knots(self) -> tuple[float, ...]:
        return (self.start, self.start + self.rise)


@dataclass(frozen=True)
class Bump:
    """height/2 * (1 - cos(2 pi (t - start)/passing)) while it is passed, else 0."""

    height: float
    start: float
    passing: float

    def _angle(self, t: Array) -> Array:
        return 2.0 * math.pi * np.clip((np.asarray(t, dtype=float) - self.start) / self.passing, 0.0, 1.0)

    def value(self, t: Array) -> Array:
        return 0.5 * self.height * (1.0 - np.cos(self._angle(t)))

    def slope(self, t: Array) -> Array:
        angle = self._angle(t)
        inside = (angle > 0.0) & (angle < 2.0 * math.pi)
        return np.where(inside, self.height * math.pi / self.passing * np.sin(angle), 0.0)

    def knots(self) -> tuple[float, ...]:
        return (self.start, self.start + self.passing)


ROAD_CLASSES = {"A": 16e-6, "B": 64e-6, "C": 256e-6, "D": 1024e-6}  # geometric means of ISO 8608 [m^3] at N0
N0 = 0.1  # [1/m]
ROAD_BAND = (0.011, 2.83)  # wave numbers of ISO 8608 [1/m]
ROAD_WAVES = 512


@dataclass(frozen=True)
class Road:
    """A road whose displacement PSD is Gd(n) = Gd(n0) (n/n0)^-2 over ROAD_BAND, passed at constant speed [m/s].

    A sum of sines: the band is cut into ROAD_WAVES logarithmic pieces; each holds one wave, at a drawn wave number
    and phase, with the variance Gd * width of the piece. Smooth, and no two pieces are harmonics, so that it does not
    repeat. Faded in over `fade_in` [s], to start at rest at height 0.
    """

    roughness: float
    speed: float
    seed: int
    fade_in: float

    @cached_property
    def _waves(self) -> tuple[Array, Array, Array]:
        """Amplitude [m], angular frequency [rad/s] and phase [rad] of each wave."""
        draw = np.random.default_rng(self.seed)
        edges = np.geomspace(*ROAD_BAND, ROAD_WAVES + 1)
        n = edges[:-1] * (edges[1:] / edges[:-1]) ** draw.random(ROAD_WAVES)
        variance = self.roughness * N0**2 * (1.0 / edges[:-1] - 1.0 / edges[1:])  # integral of Gd over the piece
        return np.sqrt(2.0 * variance), 2.0 * math.pi * n * self.speed, draw.uniform(0.0, 2.0 * math.pi, ROAD_WAVES)

    def _sum(self, t: Array, derivative: bool) -> Array:
        amplitude, omega, phase = self._waves
        flat = np.atleast_1d(t)
        total = np.empty_like(flat)
        for first in range(0, flat.size, 2048):  # bounded memory
            angle = np.multiply.outer(flat[first : first + 2048], omega) + phase
            total[first : first + 2048] = np.cos(angle) @ (amplitude * omega) if derivative else np.sin(angle) @ amplitude
        return total.reshape(np.shape(t))

    def _fade(self, t: Array) -> tuple[Array, Array]:
        if self.fade_in == 0.0:
            return np.ones_like(t), np.zeros_like(t)
        fade, rise = _smootherstep(t / self.fade_in)
        return fade, rise / self.fade_in

    def value(self, t: Array) -> Array:
        t = np.asarray(t, dtype=float)
        return self._fade(t)[0] * self._sum(t, False)

    def slope(self, t: Array) -> Array:
        t = np.asarray(t, dtype=float)
        fade, rise = self._fade(t)
        slope = np.atleast_1d(fade * self._sum(t, True))
        fading = np.atleast_1d(rise > 0.0)
        slope[fading] += np.atleast_1d(rise)[fading] * self._sum(np.atleast_1d(t)[fading], False)
        return slope.reshape(np.shape(t))

    def knots(self) -> tuple[float, ...]:
        return (self.fade_in,) if self.fade_in > 0.0 else ()


@dataclass(frozen=True, eq=False)
class Samples:
    """What is known of a recording: straight lines between its samples, constant outside."""

    time: Array
    level: Array

    def value(self, t: Array) -> Array:
        return np.interp(t, self.time, self.level)

    def slope(self, t: Array) -> Array:
        t = np.asarray(t, dtype=float)
        piece = np.clip(np.searchsorted(self.time, t, side="right") - 1, 0, self.time.size - 2)
        inside = (t >= self.time[0]) & (t < self.time[-1])
        return np.where(inside, np.diff(self.level)[piece] / np.diff(self.time)[piece], 0.0)

    def knots(self) -> tuple[float, ...]:
        return tuple(self.time.tolist())


@dataclass(frozen=True)
class Sum:
    """The sum of other signals."""

    terms: tuple[Signal, ...]

    def value(self, t: Array) -> Array:
        return sum((term.value(t) for term in self.terms), np.zeros_like(np.asarray(t, dtype=float)))

    def slope(self, t: Array) -> Array:
        return sum((term.slope(t) for term in self.terms), np.zeros_like(np.asarray(t, dtype=float)))

    def knots(self) -> tuple[float, ...]:
        return tuple(sorted({knot for term in self.terms for knot in term.knots()}))
