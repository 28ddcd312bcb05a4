# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What may be wrong: every kind of cause as a family of elementary laws, none of which is a formula of its own.

A kind is known by its features (odd or even, growing faster or slower than linear, one side, threshold, memory of amplitude
or of rate, slow in time), and its family is a set of basis functions with exactly those features, on a grid of shapes. A sum
of a few of them with the signs of the kind comes close to any curve of that kind; the textbook law is a sum of one.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.polynomial import Legendre
from numpy.typing import NDArray
from scipy import fft
from scipy.linalg import solve_banded

import penode_gen

from ..batch import Batch

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Basis:
    """One elementary law at a place: `law` is a named one, or an expression; `gain` names the argument that multiplies it,
    `shapes` are the others; `sign` is that of the gain (0: either). `series` is its force for gain 1, per recording."""

    kind: str
    place: int
    law: str
    gain: tuple[str, str]
    shapes: dict[str, tuple[float, str]]
    sign: int
    series: tuple[Array, ...] = field(repr=False)
    companion: bool = False  # may help another of its kind, but is no cause alone
    settled: bool = False  # acted already long before the start
    fixed: dict[str, tuple[float, str]] = field(default_factory=dict)  # shapes that are known
    least: dict[str, float] = field(default_factory=dict)  # least values of shapes: smaller ones make no difference that can be seen


VALUED = ("bias", "scale", "delay", "roll_off", "rail", "sharpness", "clock")  # faults of a value alone; the others add a series
ROLLED = 0.006  # [s] lag of the filter that a sensor may be behind: it only has to be of the size of one
CLOCK = "clock_drift"  # kind of an effect that is not on the list, but looks like one that is


@dataclass(frozen=True, eq=False)
class Fault:
    """One elementary fault of a sensor: `series` is its contribution to that sensor for gain 1, per recording."""

    kind: str
    sensor: int
    what: str
    sign: int
    series: tuple[Array, ...] = field(repr=False)
    shape: float = 0.0
    companion: bool = False

    def of(self, y: Array, recording: int) -> Array:
        """What it adds for gain 1 to a simulated signal [..., n]; a fault of scale must not depend on what was measured."""
        match self.what:
            case "scale_side":
                return np.abs(y)
            case "scale_bend":
                return y * y * y / max(self.shape, 1e-300) ** 2
            case "scale_drift":
                return y * (np.arange(y.shape[-1]) / max(map(len, self.series)) - 0.5)
            case "clip":
                return -np.sign(self.shape) * np.maximum(np.sign(self.shape) * y - abs(self.shape), 0.0)
        return self.series[recording]


@dataclass(frozen=True, eq=False)
class Motion:
    """Deflection, rate [n] of a place in one recording, and the time [s] since its start."""

    s: Array
    v: Array
    t: Array


def size(motions: Sequence[Motion]) -> tuple[float, float]:
    """What deflection and rate reach, but for a thousandth of the time."""
    pairs = [(np.quantile(np.abs(m.s), 0.999), np.quantile(np.abs(m.v), 0.999)) for m in motions]
    return tuple(float(max(p[k] for p in pairs)) for k in (0, 1))


MEMORY = """
[model]
name = "memory"
sample_time = "1 s"
substeps = 4
[parameters]
one = { value = 1, unit = "N" }
width = { value = 1, unit = "m" }
drag = { value = 1, unit = "N*s/m" }
gap = { value = 1, unit = "m" }
bend = { value = 0.7, unit = "1" }
share = { value = 0.65, unit = "1" }
lag = { value = 1, unit = "s" }
[inputs]
x = { unit = "m" }
[elements]
wen = { between = ["x", "ground"], law = "bouc_wen", force = "one", presliding = "width" }
dahl = { between = ["x", "ground"], law = "dahl_friction", force = "one", presliding = "width" }
loop = { between = ["x", "ground"], law = "bouc_wen_loop", force = "one", presliding = "width", bend = "bend", share = "share" }
loose = { between = ["x", "ground"], law = "loose_damper", damping = "drag", gap = "gap", relaxation = "lag" }
[outputs]
loose = { value = "F_loose", unit = "N" }
wen = { value = "wen_slip", unit = "1" }
dahl = { value = "dahl_slip", unit = "1" }
loop = { value = "loop_slip", unit = "1" }
"""


@cache
def _memory() -> Batch:
    """Laws with memory under prescribed motion; one sample is one second."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "memory.toml"
        path.write_text(MEMORY)
        return Batch(penode_gen.load(path), exact=False)


def slips(s: Array, widths: Sequence[float]) -> Array:
    """Slip [3 widths, n] of the laws bouc_wen, dahl_friction and, about between them, bouc_wen_loop, starting without force."""
    z = _memory().run((s - s[0])[:, None], parameters={"width": np.asarray(widths)}, outputs=("wen", "dahl", "loop")).y
    return np.clip(np.concatenate([z[:, :, k] for k in range(3)]), -1.0, 1.0)


def losses(s: Array, step: float, gaps: Sequence[float], taus: Sequence[float]) -> Array:
    """Force [pairs, n] of the law loose_damper with damping 1 N*s/m, for pairs of gap and relaxation time."""
    parameters = {"gap": np.asarray(gaps), "lag": np.asarray(taus) / step}
    return _memory().run((s - s[0])[:, None], parameters=parameters, outputs=("loose",)).y[:, :, 0] / step


def lag(x: Array, tau: float, step: float) -> Array:
    """First-order lag of x."""
    a = np.exp(-step / tau)
    return solve_banded((1, 0), np.stack([np.ones_like(x), np.full_like(x, -a)]), (1.0 - a) * x, check_finite=False)


def warm(v: Array, t: Array, work: float, cooling: float) -> Array:
    """State of the law heating_damper along rates v at times t, from cold."""
    heated = v * v * (t[1] - t[0]) / work
    grown = np.cumsum(heated) + t / cooling
    return np.exp(-grown) * np.cumsum(np.exp(grown) * heated)


STRIBECK = "force*tanh(v/knee)*(1 + rise*exp(-(v/width)^2))"  # the textbook's, with a knee
BENDS = {x: f"k*(knee*(softplus(2*{x}/knee) - 0.6931471805599453) - {x})" for x in "sv"}  # slope -k here, k there, and tanh between
KNEE = "-k*round*(softplus((v - knee)/round) - softplus((-v - knee)/round))"  # of a damper, rounded


def bent(x: Array, knee: float) -> Array:
    """The law BENDS for k = 1."""
    return knee * (np.logaddexp(0.0, 2.0 * x / knee) - np.log(2.0)) - x


HALVES = ("k*(max(s - gap, 0) - max(s, 0))", "k*(min(s + gap, 0) - min(s, 0))")  # of a play: what it takes of a spring to either side


def sensor_faults(
    sensor: int, signals: Sequence[Array], times: Sequence[Array], step: float, kinds: Collection[str] = ()
) -> Iterator[Fault]:
    """All elementary faults of a sensor that should measure `signals`, or those of some kinds."""
    return filter(None, _sensor_faults(sensor, signals, times, step, kinds))


def _sensor_faults(
    sensor: int, signals: Sequence[Array], times: Sequence[Array], step: float, kinds: Collection[str]
) -> Iterator[Fault | None]:
    """The same, None for what is not wanted."""

    series: dict[tuple[str, float], tuple[Array, ...]] = {}  # of a fault with its shape, whatever its kind and sign

    def fault(kind, what, sign, function, shape=0.0, companion=False) -> Fault | None:
        if kinds and kind not in kinds:
            return None
        if (what, shape) not in series:
            series[what, shape] = tuple(function(y, t) for y, t in zip(signals, times, strict=True))
        return Fault(kind, sensor, what, sign, series[what, shape], shape, companion)

    yield fault("sensor_bias", "bias", 0, lambda y, t: np.ones_like(y))
    yield fault("sensor_scale", "scale", 0, lambda y, t: y)
    yield fault("sensor_delay", "delay", 1, lambda y, t: -np.gradient(y, step))
    yield fault("sensor_delay", "roll_off", 1, lambda y, t: rolled_off(y, ROLLED, step), 0.0, True)
    top = max(float(np.max(np.abs(y))) for y in signals)
    for side in (1, -1):
        for w in (0.3, 0.5, 0.7, 0.85):
            edge = w * top
            yield fault(
                "sensor_clipping", "clip", 1, lambda y, t, side=side, edge=edge: -side * np.maximum(side * y - edge, 0.0), side * edge
            )
    yield fault("sensor_clipping", "scale_bend", -1, lambda y, t: y**3 / max(top, 1e-300) ** 2, top, True)
    # slow or bent forms of the same
    last = max(float(t[-1]) for t in times)
    for w in (0.1, 0.3):
        yield fault("sensor_bias", "warming", 0, lambda y, t, w=w: 1.0 - np.exp(-t / (w * last)), 1.0 / w, True)
    for m in (1, 2, 3, 4):
        yield fault("sensor_bias", "drift", 0, lambda y, t, m=m: Legendre.basis(m, (0.0, last))(t), float(m), True)
    yield fault("sensor_scale", "scale_drift", 0, lambda y, t: y * (t / last - 0.5), 0.0, True)
    yield fault("sensor_scale", "scale_side", 0, lambda y, t: np.abs(y), 0.0, True)
    yield fault("sensor_scale", "scale_bend", 0, lambda y, t: y**3 / max(top, 1e-300) ** 2, top, True)


def rolled_off(y: Array, lag: float, step: float) -> Array:
    """The second derivative of a signal [n], as by a filter; at high frequencies not above that of the signal."""
    both = np.concatenate([y, y[::-1]])  # ends where it began
    s = 2j * np.pi * fft.rfftfreq(len(both), step)
    return fft.irfft(fft.rfft(both) * s * s / (1.0 - (s * lag) ** 2), len(both))[: len(y)]


def clock(signals: Sequence[Array], times: Sequence[Array], step: float) -> Fault:
    """A clock of all sensors [n, n_z] that runs faster than that of the inputs, from the start of each recording on."""
    series = tuple(t[:, None] * np.gradient(y, step, axis=0) for y, t in zip(signals, times, strict=True))
    return Fault(CLOCK, 0, "clock", 0, series)
