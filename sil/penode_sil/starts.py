# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a simulation starts: given states, and states fitted to the first samples of the measured sensors."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import Model

from . import scenario as scenarios
from .errors import RecordingError, WrongUse, hint
from .recordings.units import UnitError, quantity
from .replay import Replay
from .schedule import Call
from .targets import Sil

Array = NDArray[np.float64]
GIVEN = re.compile(r"\s*(\w+)\s*=\s*(.+?)\s*")
MEASURED = re.compile(r"\s*measured(?::(\d+))?\s*")


@dataclass(frozen=True)
class Start:
    """Given states (SI), and whether the others are fitted: `samples` of the window, 0 for a window of the default length."""

    given: Mapping[str, float]
    fitted: bool = False
    samples: int = 0


def parse(texts: Iterable[str], model: Model) -> Start:
    """`measured`, `measured:K` and `state=quantity`, as often as need be. Raises UserError."""
    given: dict[str, float] = {}
    fitted, samples = False, 0
    units = scenarios.state_units(model)
    for text in texts:
        if match := MEASURED.fullmatch(text):
            fitted, samples = True, int(match[1] or 0)
            if match[1] is not None and samples < 2:
                raise WrongUse(f'--start: "{text}" fits too few samples; give measured:K with K from 2 on')
            continue
        match = GIVEN.fullmatch(text)
        if match is None:
            raise WrongUse(f'--start: "{text}" is not understood; write measured, measured:K or "state=0.01 m"')
        if match[1] not in units:
            raise WrongUse(f'--start: the model has no state "{match[1]}"; {hint(match[1], units)}')
        try:
            given[match[1]] = quantity(match[2], units[match[1]])
        except UnitError as exc:
            raise WrongUse(f"--start: {match[1]}: {exc}") from exc
    if fitted and set(given) == set(units):
        raise WrongUse("--start: all states are given, so that none is left to be fitted; leave measured out")
    return Start(given, fitted, samples)


def window(model: Model, set_name: str, x: Array, u: Array, shortest: int = 20, longest: float = 5.0) -> int:
    """Samples of half a period (or pi time constants) of the model's slowest motion about x: at least `shortest` samples, at most
    `longest` seconds."""
    system, n = penode_gen.numeric(model, set_name), x.size
    zero = np.zeros_like(u)
    slopes = np.empty((n, n))
    for j in range(n):
        step = np.eye(n)[j] * 1e-6 * max(1.0, abs(x[j]))
        slopes[:, j] = (system.rates(x + step, u, zero) - system.rates(x - step, u, zero)) / (2.0 * step[j])
    speeds = np.abs(np.linalg.eigvals(slopes)) if np.isfinite(slopes).all() else np.zeros(1)
    slowest = float(min((s for s in speeds if s > math.pi / longest), default=math.pi / longest))
    return max(shortest, round(math.pi / slowest / model.sample_time) + 1)


class _Fit:
    """Weighted differences between the model's response and the first samples of the sensors, as a function of the start."""

    def __init__(self, model: Model, set_name: str, replay: Replay, samples: int):
        self.sil, self.set_name = Sil(model, np.float64), set_name
        self.u = replay.u[:samples]
        self.raster = replay.offset + replay.times[:samples]
        self.rows: list[tuple[str, int, Array, Array, float]] = []
        names = {s.name: ("z", i, s) for i, s in enumerate(model.sensors)}
        names |= {s.name: ("y", i, s) for i, s in enumerate(model.outputs) if s.name not in names}
        for name, sensed in replay.sensed.items():
            where, column, signal = names[name]
            inside = (sensed.time >= self.raster[0] - 1e-9) & (sensed.time <= self.raster[-1] + 1e-9)
            values = sensed.values[inside]
            if values.size:
                scale = getattr(signal, "noise", 0.0) or float(np.ptp(sensed.values)) * 1e-3 or 1.0
                self.rows.append((where, column, sensed.time[inside], values, scale))

    def __call__(self, x: Array) -> Array:
        run = self.sil.run(self.u, [Call(0, "state", values=x)], self.set_name)
        parts = [
            (np.interp(time, self.raster, getattr(run, where)[:, column]) - values) / scale
            for where, column, time, values, scale in self.rows
        ]
        return np.concatenate(parts)


def fit(model: Model, set_name: str, replay: Replay, start: Start) -> tuple[dict[str, float], str]:
    """The start states (SI), and a line that says from what. Least squares over all measured sensors, each in units of its
    noise, by Gauss and Newton with halved steps through the C in double. Raises UserError."""
    states = scenarios.state_units(model)
    x = np.array([start.given.get(name, value) for name, value in zip(model.states, model.start, strict=True)], dtype=float)
    if not replay.sensed:
        names = ", ".join(s.name for s in (*model.sensors, *model.outputs))
        raise RecordingError(f"{replay.plan.path}: --start measured needs a sensor of the model; record one of: {names}")
    count = start.samples or min(window(model, set_name, x, replay.u[0]), max(20, replay.times.size // 4))
    count = min(count, replay.times.size)
    residual = _Fit(model, set_name, replay, count)
    for signal in (*model.outputs, *model.sensors):  # a state that is measured itself starts near its first sample
        if signal.name in replay.sensed and signal.expression in model.states and signal.expression not in start.given:
            x[model.states.index(signal.expression)] = replay.sensed[signal.name].values[0]
    free = [i for i, name in enumerate(model.states) if name not in start.given]
    if sum(values.size for _, _, _, values, _ in residual.rows) < len(free):
        raise RecordingError(
            f"{replay.plan.path}: its first {count} samples measure too little to fit {len(free)} states; "
            "give --start measured:K with a larger K"
        )
    x, unseen = _solve(residual, x, free)
    if not np.isfinite(x).all():
        raise RecordingError(
            f"{replay.plan.path}: no start fits its first samples; give the states with --start, or another window with measured:K"
        )
    parts = [f"{model.states[i]} = {x[i]:.6g} {states[model.states[i]]}".rstrip() for i in free]
    text = f"start fitted to the first {count} samples ({count * model.sample_time:.4g} s): {', '.join(parts)}"
    if unseen:
        text += "; the sensors do not show " + ", ".join(model.states[i] for i in unseen) + ", which start as in the model file"
    return dict(zip(model.states, x.tolist(), strict=True)), text


def _solve(residual: _Fit, x: Array, free: list[int], rounds: int = 20, seen: float = 1e-6) -> tuple[Array, list[int]]:
    """The fitted start, and which states the sensors do not show; a combination of states whose effect is less than `seen` of the
    best-seen one stays as it was."""
    now = residual(x)
    unseen: list[int] = []
    for _ in range(rounds):
        slopes = np.empty((now.size, len(free)))
        for j, i in enumerate(free):
            step = np.zeros_like(x)
            step[i] = 1e-6 * max(1.0, abs(x[i]))
            slopes[:, j] = (residual(x + step) - residual(x - step)) / (2.0 * step[i])
        size = np.linalg.norm(slopes, axis=0)
        unseen = [i for j, i in enumerate(free) if not size[j] > 0.0]
        scaled = slopes / np.where(size > 0.0, size, 1.0)
        change = np.linalg.lstsq(scaled, -now, rcond=seen)[0] / np.where(size > 0.0, size, 1.0)
        share, better = 1.0, False
        while share > 1e-4 and not better:
            trial = x.copy()
            trial[free] += share * change
            then = residual(trial)
            better = bool(np.sum(then**2) < np.sum(now**2))
            share *= 0.5
        if not better:
            break
        gain = 1.0 - np.sum(then**2) / np.sum(now**2)
        x, now = trial, then
        if gain < 1e-9:
            break
    return x, unseen
