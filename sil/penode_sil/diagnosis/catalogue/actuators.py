# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Actuators between a recorded input and the plant, which the model file does not have. One row a kind.

One value of a kind is fitted; it is 0 where the actuator passes its input on unchanged. A limit is fitted as its inverse, 0 for no limit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .memory import lag

Array = NDArray[np.float64]
TINY = np.finfo(float).tiny
Entry = Mapping[str, tuple[str, float, str]]  # of each argument of a law: end of a parameter's name ("": none), value, unit


@dataclass(frozen=True, eq=False)
class Drive:
    """An input as recorded: its `series` [n] by recording, `step` [s] apart; `update` [s] between innovations, `period` [s] of the
    motion."""

    series: Sequence[Array]
    step: float
    update: float
    period: float

    @cached_property
    def spread(self) -> float:
        return float(np.maximum(np.std(np.concatenate(list(self.series))), TINY))

    @cached_property
    def longest(self) -> float:
        """Length of the longest recording [s]."""
        return self.step * max(map(len, self.series))

    @cached_property
    def largest(self) -> float:
        """But for a thousandth of the time: one spike does not count."""
        return float(np.maximum(np.quantile(np.abs(np.concatenate(list(self.series))), 0.999), TINY))


@dataclass(frozen=True, eq=False)
class Value:
    """How the value of a kind is fitted: where that begins, its natural unit, the deviation of its prior, and its bounds."""

    start: float
    unit: float
    sigma: float
    low: float = -np.inf
    high: float = np.inf


@dataclass(frozen=True, eq=False)
class Actuator:
    """A kind of actuator. `output(u, values, step)`: its output [runs, n] for the recorded input u [runs, n] and a value for each run
    [runs]; `fitted`: how its value is fitted, and `tried`: values that a score test compares, where the effect is not proportional to
    it; `small`: it is about so where they are small; `size`: name and unit in a report ("": the unit of the input, "/s" behind it), and
    `shown` that for a value; `law` of [actuators] that does the same, empty if there is none, and its `entry` for a value; `order` of
    actuators in series, as in the model file; `by_change`: the value alone does not say how much of the input it changes;
    `smoothed`: the output at the rows where the input is held between them, if that moves as a line and not in steps; `constant`: it adds
    the same at all times, which has no rate; `late`: by the same time everywhere, which a model file has in samples."""

    output: Callable[[Array, Array, float], Array]
    fitted: Callable[[Drive], Value]
    size: tuple[str, str]
    shown: Callable[[float], float] = float
    law: str = ""
    entry: Callable[[float], Entry] = lambda value: {}
    tried: Callable[[Drive], Sequence[float]] | None = None
    order: int = 0
    by_change: bool = False
    small: bool = True
    smoothed: Callable[[Array, Array, float], Array] | None = None
    constant: bool = False
    late: bool = False

    def change(self, drive: Drive, value: float) -> float:
        """Rms difference of output and recorded input, relative to the standard deviation of the input."""
        values = np.array([value])
        moved = np.concatenate([self.output(u[None, :], values, drive.step)[0] - u for u in drive.series])
        return float(np.sqrt(np.mean(moved**2))) / drive.spread


def lagging(x: Array, tau: float, step: float) -> Array:
    """A signal [n] from 0, joined by straight lines, behind a first-order lag: exact, as the model file's own, so that no delay of half a
    sample has to make up for it."""
    a = np.exp(-step / tau)
    before = tau / step - a / (1.0 - a)  # weight of the sample before
    return lag(x + before * (np.concatenate([x[:1], x[:-1]]) - x), tau, step)


def _amplified(u: Array, values: Array, step: float) -> Array:
    return u * (1.0 + values[:, None])


def _shifted(u: Array, values: Array, step: float) -> Array:
    return u + values[:, None]


def _lag(u: Array, values: Array, step: float) -> Array:
    return np.array([x[0] + lagging(x - x[0], max(tau, 1e-3 * step), step) for x, tau in zip(u, values, strict=True)])


def _lag_of_steps(u: Array, values: Array, step: float) -> Array:
    before = np.concatenate([u[:, :1], u[:, :-1]], axis=1)
    return np.array([x[0] + lag(x - x[0], max(tau, 1e-3 * step), step) for x, tau in zip(before, values, strict=True)])


def _dead(u: Array, values: Array, step: float) -> Array:
    width = values[:, None]
    return np.maximum(u - width, 0.0) + np.minimum(u + width, 0.0)


def _saturated(u: Array, values: Array, step: float) -> Array:
    limit = 1.0 / np.maximum(values[:, None], TINY)
    return np.clip(u, -limit, limit)


def _late(u: Array, values: Array, step: float) -> Array:
    at = np.arange(u.shape[-1])
    return np.array([np.interp(at - d, at, x) for x, d in zip(u, values / step, strict=True)])


def _later(u: Array, values: Array, step: float) -> Array:
    """By a delay that grows with time: the clock of the input runs slow."""
    at = np.arange(u.shape[-1])
    return np.array([np.interp(at * (1.0 - d), at, x) for x, d in zip(u, values, strict=True)])


def _limited(u: Array, values: Array, step: float) -> Array:
    """Behind a limit of the rate. Lanes that are alike, as most are in finite differences, are computed once."""
    known: dict[tuple[float, bytes], Array] = {}
    for value, x in zip(values, u, strict=True):
        if (key := (float(value), x.tobytes())) not in known:
            known[key] = _followed(x, step * _inverse(float(value)))
    return np.array([known[float(value), x.tobytes()] for value, x in zip(values, u, strict=True)])


def _followed(x: Array, most: float) -> Array:
    """A signal [n] that follows `x` by at most `most` from one sample to the next."""
    now, found = float(x[0]), []
    for target in x.tolist():
        now += min(max(target - now, -most), most)
        found.append(now)
    return np.array(found)


def _inverse(value: float) -> float:
    return float(1.0 / np.maximum(value, TINY))


def _halves(most: float, least: float | None = None) -> list[float]:
    """Values that are tried: the most, and by halves less, down to `least`, or a sixteenth."""
    count = 5 if least is None else int(np.maximum(np.log2(most / least), 1.0))
    return [most * 0.5**k for k in range(count)]


def _gain() -> Actuator:
    def entry(value: float) -> Entry:
        return {"gain": ("gain", 1.0 + value, "1")}

    return Actuator(_amplified, lambda d: Value(0.0, 0.01, 0.3), ("gain", "1"), lambda v: 1.0 + v, "gain", entry, order=3)


def _offset() -> Actuator:
    return Actuator(_shifted, lambda d: Value(0.0, 0.01 * d.spread, d.spread), ("offset", ""), order=5, by_change=True, constant=True)


def _time(d: Drive) -> Value:
    return Value(0.2 * d.step, 0.2 * d.update, 2.0 * d.update, 0.0)


def _drift() -> Actuator:
    def fitted(d: Drive) -> Value:
        """As for a delay, at the end of the longest recording."""
        return Value(0.0, 0.2 * d.update / d.longest, 2.0 * d.update / d.longest)

    return Actuator(_later, fitted, ("drift", "1"), by_change=True)


def _behind() -> Actuator:
    def entry(value: float) -> Entry:
        return {"time": ("lag", value, "s")}

    def tried(d: Drive) -> Sequence[float]:
        return _halves(2.0 * d.update)

    return Actuator(_lag, _time, ("lag", "s"), law="lag", entry=entry, tried=tried, order=4, smoothed=_lag_of_steps)


def _dead_zone() -> Actuator:
    def fitted(d: Drive) -> Value:
        return Value(0.0, 0.05 * d.largest, 0.5 * d.largest, 0.0, d.largest)

    def entry(value: float) -> Entry:
        return {"width": ("width", value, "")}

    return Actuator(
        _dead, fitted, ("width", ""), law="dead_zone", entry=entry, tried=lambda d: _halves(0.5 * d.largest), order=1, small=False
    )


def _saturation() -> Actuator:
    def fitted(d: Drive) -> Value:
        return Value(0.0, 0.05 / d.largest, 2.0 / d.largest, 0.0)

    def entry(value: float) -> Entry:
        return {"limit": ("limit", _inverse(value), "")}

    def tried(d: Drive) -> list[float]:
        return [1.0 / (d.largest * (1.0 - cut)) for cut in _halves(0.75)]

    return Actuator(_saturated, fitted, ("limit", ""), _inverse, "saturation", entry, tried, order=1, small=False)


def _slew_limit() -> Actuator:
    def fitted(d: Drive) -> Value:
        return Value(0.0, 0.05 * d.period / d.largest, 2.0 * d.period / d.largest, 0.0)

    def entry(value: float) -> Entry:
        return {"rate": ("", _inverse(value), "/s")}

    def tried(d: Drive) -> list[float]:
        return [time / d.largest for time in _halves(2.0 * d.period, d.step)]

    return Actuator(_limited, fitted, ("rate", "/s"), _inverse, "slew_limit", entry, tried, small=False)


ACTUATORS: dict[str, Actuator] = {
    "input_gain": _gain(),
    "input_offset": _offset(),
    "input_delay": Actuator(_late, _time, ("delay", "s"), late=True),
    "input_drift": _drift(),
    "input_lag": _behind(),
    "input_dead_zone": _dead_zone(),
    "input_saturation": _saturation(),
    "input_slew_limit": _slew_limit(),
}
