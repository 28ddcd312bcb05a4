# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What actuators that delay or hold samples make of input signals, as functions of continuous time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from .signals import Signal

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Delayed:
    """A signal `late` [s]; before that, as it was at time 0."""

    signal: Signal
    late: float

    def value(self, t: Array) -> Array:
        return self.signal.value(np.maximum(np.asarray(t, dtype=float) - self.late, 0.0))

    def slope(self, t: Array) -> Array:
        t = np.asarray(t, dtype=float) - self.late
        return np.where(t < 0.0, 0.0, self.signal.slope(np.maximum(t, 0.0)))

    def knots(self) -> tuple[float, ...]:
        return (self.late, *(knot + self.late for knot in self.signal.knots()))


@dataclass(frozen=True)
class Held:
    """A signal that is taken every `period` [s] from time 0 on, and held, for `duration` [s]."""

    signal: Signal
    period: float
    duration: float

    def value(self, t: Array) -> Array:
        taken = np.floor(np.asarray(t, dtype=float) / self.period + 1e-6)  # a time that rounding has put before a step belongs to it
        return self.signal.value(taken * self.period)

    def slope(self, t: Array) -> Array:
        return np.zeros_like(np.asarray(t, dtype=float))

    def knots(self) -> tuple[float, ...]:
        return tuple((np.arange(round(self.duration / self.period) + 1) * self.period).tolist())


def driving(model: Model, inputs: Mapping[str, Signal], duration: float) -> tuple[Signal, ...]:
    """The inputs of a model and behind them what its actuators make of their samples."""
    known = {signal.name: inputs[signal.name] for signal in model.inputs}
    for s in model.sampled:
        source = known[s.source]
        known[s.name] = Delayed(source, s.time) if s.law == "delay" else Held(source, s.time, duration)
    return tuple(known.values())
