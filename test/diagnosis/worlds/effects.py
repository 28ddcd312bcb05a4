# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What may hide: forces as laws of world.c, and changes of inputs and sensors. Sizes grow with x from 1, where a force is some 0.3 of that
at its place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]


@dataclass(frozen=True)
class At:
    """A place as it moves: RMS of deflection, rate and force; its stiffness and damping; seconds of the training; a sign and two shape
    numbers in 0..1."""

    s: float
    v: float
    f: float
    k: float
    d: float
    seconds: float
    sign: float
    z: tuple[float, float]


Built = tuple[str, list[float], dict[str, float]]


def _stribeck(a: At, x: float) -> Built:
    more, rate = 0.8 + a.z[0], (0.3 + 0.4 * a.z[1]) * a.v
    return "stribeck", [0.2 * x * a.f, 0.03 * a.v, rate, more], {"coulomb": 0.2 * x * a.f, "breakaway": 0.2 * x * a.f * (1 + more)}


def _stop(a: At, x: float) -> Built:
    gap = (0.7 + 0.6 * a.z[0]) * a.s
    return "stop", [3 * x * a.k, gap, a.sign, 0.1 * a.s], {"gap": gap, "stiffness": 3 * x * a.k}


def _skew(a: At, x: float) -> Built:
    p = a.sign * 0.5 * x * a.f / a.v
    return "skew", [p, 0.1 * a.v], {"rebound": a.d + p, "compression": a.d - p}


FORCES: dict[str, Callable[[At, float], Built]] = {
    "coulomb_friction": lambda a, x: ("atan", [0.3 * x * a.f, (0.02 + 0.06 * a.z[0]) * a.v], {"force": 0.3 * x * a.f}),
    "stribeck_friction": _stribeck,
    "cubic_spring": lambda a, x: ("power", [0.15 * x * a.f / a.s**3, 3.0, 0.0], {"cubic": 0.15 * x * a.f / a.s**3}),
    "asymmetric_spring": lambda a, x: ("one_side", [0.5 * a.sign * x * a.f / a.s, 0.2 * a.s], {"difference": 0.5 * a.sign * x * a.f / a.s}),
    "bump_stop": _stop,
    "backlash": lambda a, x: ("play", [a.k, 0.3 * x * a.s], {"gap": 0.6 * x * a.s}),
    "asymmetric_damper": _skew,
    "degressive_damper": lambda a, x: ("knee", [0.9 * a.d, a.v / x], {"knee": a.v / x}),
    "quadratic_damper": lambda a, x: ("power", [0.3 * x * a.f / a.v**2, 2.0, 1.0], {"coefficient": 0.3 * x * a.f / a.v**2}),
    "damper_fading": lambda a, x: ("fade", [0.5 * x * a.d, a.seconds], {"loss": 0.5 * x}),
    "bouc_wen": lambda a, x: ("hysteresis", [0.3 * x * a.f, (0.15 + 0.3 * a.z[0]) * a.s], {"force": 0.3 * x * a.f}),
    "maxwell_bushing": lambda a, x: ("maxwell", [0.5 * x * a.f / a.s, (0.5 + a.z[0]) * a.s / a.v], {"stiffness": 0.5 * x * a.f / a.s}),
    "aerated_damper": lambda a, x: ("aerated", [a.d, 0.3 * x * a.s, (0.1 + 0.1 * a.z[0]) * a.d * a.v], {"pocket": 0.6 * x * a.s}),
    "tyre_liftoff": lambda a, x: ("lift", [a.k, a.s * 1.4 / x, 0.1 * a.s], {"preload": 1.4 * a.k * a.s / x}),
    "tyre_damping": lambda a, x: ("linear", [0.0, 0.3 * x * a.f / a.v], {"damping": 0.3 * x * a.f / a.v}),
    "tyre_nonlinear": lambda a, x: ("pressed", [0.3 * x * a.f / a.s**2, 0.1 * a.s], {"quadratic": 0.3 * x * a.f / a.s**2}),
    "constant_force": lambda a, x: ("constant", [-a.sign * 0.3 * x * a.f], {"force": a.sign * 0.3 * x * a.f}),
}
# the size that makes a law stronger without bound; others stop where physics does
LIMITS = {
    "damper_fading": 1.8,
    "degressive_damper": 40.0,
    "backlash": 4.0,
    "aerated_damper": 6.0,
    "tyre_liftoff": 3.0,
    "asymmetric_spring": 1.5,
}
STRUT = (
    "coulomb_friction",
    "stribeck_friction",
    "cubic_spring",
    "asymmetric_spring",
    "bump_stop",
    "backlash",
    "asymmetric_damper",
    "degressive_damper",
    "quadratic_damper",
    "damper_fading",
    "bouc_wen",
    "maxwell_bushing",
    "aerated_damper",
)
TYRE = ("tyre_liftoff", "tyre_damping", "tyre_nonlinear")
INPUT = ("input_gain", "input_offset", "input_delay", "input_lag", "input_hold")
SENSOR = ("sensor_bias", "sensor_scale", "sensor_delay", "sensor_clipping")


def shifted(y: Array, by: float) -> Array:
    """A signal so many (real) samples later; the first value holds before it."""
    t = np.arange(len(y), dtype=float)
    return np.interp(t - by, t, y)


def lagged(y: Array, samples: float) -> Array:
    """A first-order lag, exact for straight lines between close samples."""
    a = np.exp(-1.0 / samples)
    return lfilter([1 - a], [1, -a], y, zi=[a * y[0]])[0]


def held(y: Array, samples: int) -> Array:
    """Steps: each value stays for so many samples."""
    return y[(np.arange(len(y)) // samples) * samples]


def input_changed(kind: str, u: Array, x: float, sign: float, rate: float, like: Array | None = None) -> tuple[Array, dict[str, float]]:
    """The acting input where the recording has u [N] (at `rate` Hz); x as for forces, along `like` (u itself if not given)."""
    like = u if like is None else like
    rms = float(np.sqrt(np.mean(like**2)))
    omega = float(np.sqrt(np.mean(np.gradient(like, 1 / rate) ** 2))) / rms
    if kind == "input_gain":
        return u * (1 + 0.3 * sign * x), {"gain": 1 + 0.3 * sign * x}
    if kind == "input_offset":
        return u + 0.3 * sign * x * rms, {"offset": 0.3 * sign * x * rms}
    if kind == "input_delay":
        return shifted(u, 0.3 * x / omega * rate), {"delay": 0.3 * x / omega}
    if kind == "input_lag":
        return lagged(u, 0.3 * x / omega * rate), {"time": 0.3 * x / omega}
    n = max(int(0.5 * x / omega * rate), 2)
    return held(u, n), {"period": n / rate}


def sensor_changed(kind: str, y: Array, x: float, sign: float, rate: float, like: Array | None = None) -> tuple[Array, dict[str, float]]:
    """What the sensor says of y [N]; x as for forces, along `like` (y itself if not given)."""
    like = y if like is None else like
    rms = float(np.std(like))
    if kind == "sensor_bias":
        return y + 0.3 * sign * x * rms, {"bias": 0.3 * sign * x * rms}
    if kind == "sensor_scale":
        return y * (1 + 0.3 * sign * x), {"scale": 1 + 0.3 * sign * x}
    if kind == "sensor_delay":
        omega = float(np.std(np.gradient(like, 1 / rate))) / rms
        return shifted(y, 0.3 * x / omega * rate), {"delay": 0.3 * x / omega}
    limit = 1.6 * rms / x
    return np.clip(y, -limit, limit), {"limit": limit}
