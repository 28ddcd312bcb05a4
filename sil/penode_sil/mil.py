# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Model in the loop: the exact solution that every target is compared with, in float64 with tight tolerances.

The inputs are functions of continuous time. The integrator stops and starts anew wherever the right-hand side changes
its form: at parameter exchanges, at both ends of a hold, and at the knots of the inputs.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from .errors import ModelError
from .late import driving
from .reference import compiled
from .reference.accuracy import Unsolved
from .reference.by_scipy import ByScipy
from .scenario import Instance, Scenario, staging_samples
from .signals import Signal

Array = NDArray[np.float64]
Progress = Callable[[float], None]  # gets the time [s] reached


@dataclass(frozen=True, eq=False)
class Trajectory:
    """What an instance did, one row a sample: states x, outputs y, sensors z [n, .]; and the samples that adopted."""

    x: Array
    y: Array
    z: Array
    adopted: tuple[int, ...] = ()


@dataclass(frozen=True)
class _Piece:
    """[begin, end] with one set and one form of the inputs; `held`: the state stands still."""

    begin: float
    end: float
    set: str
    held: bool


def _pieces(instance: Instance, duration: float, set_length: int, sample_time: float, knots: set[float]) -> list[_Piece]:
    """Cut 0..duration wherever something changes its form."""
    changes: list[tuple[float, str]] = [(0.0, instance.set)]
    holds: list[tuple[float, float]] = []
    previous = instance.set
    for exchange in instance.exchanges:
        running = changes[-1][1]
        changes.append((exchange.time, previous if exchange.how == "rollback" else exchange.set))
        previous = running
        if exchange.how == "write" and exchange.hold:
            samples = staging_samples(set_length, exchange.chunk) - 1
            holds.append((exchange.time - samples * sample_time, exchange.time))
    cuts = {0.0, duration} | {time for time, _ in changes} | {time for hold in holds for time in hold} | knots
    edges, tiny = [0.0], 4.0 * np.spacing(duration)
    for cut in sorted(cut for cut in cuts if 0.0 < cut <= duration):
        if cut - edges[-1] > tiny:  # else the same time, but for rounding
            edges.append(cut)
    pieces = []
    for begin, end in itertools.pairwise(edges):
        middle = 0.5 * (begin + end)
        name = [name for time, name in changes if time < middle][-1]
        pieces.append(_Piece(begin, end, name, any(a < middle < b for a, b in holds)))
    return pieces


def _integrator(model: Model, set_name: str, signals: tuple[Signal, ...], x: Array) -> compiled.Compiled | ByScipy:
    """What solves a model from x on: compiled code, but for models whose fastest motion an explicit method would follow in far too many
    steps."""
    if not compiled.available():
        return ByScipy(model)
    found = compiled.Compiled(model)
    u, v = (np.array([float(of(np.array(0.0))) for of in each]) for each in ([s.value for s in signals], [s.slope for s in signals]))
    width = 1e-7 * (1.0 + np.abs(x))
    ends = [[found.rates(set_name, x + sign * step, u, v) for sign in (1.0, -1.0)] for step in np.diag(width)]
    jacobian = np.array([(more - less) / (2.0 * h) for (more, less), h in zip(ends, width, strict=True)]).reshape(x.size, x.size)
    fast = np.isfinite(jacobian).all() and np.abs(np.linalg.eigvals(jacobian)).max(initial=0.0) * model.sample_time > compiled.MANY
    return ByScipy(model) if fast else found


def _seen(signals: tuple[Signal, ...], edges: Array, times: Array) -> tuple[Array, Array]:
    """Inputs and their rates [n, n_u] at `times` [n]; at the end of a piece, the rate before the knot."""
    piece = np.clip(np.searchsorted(edges, times, side="left") - 1, 0, edges.size - 2)
    inside = np.clip(times, edges[piece], np.nextafter(edges[piece + 1], edges[piece]))
    u, v = [s.value(times) for s in signals], [s.slope(inside) for s in signals]
    return np.array(u, dtype=float).reshape(-1, times.size).T, np.array(v, dtype=float).reshape(-1, times.size).T


def solve(
    model: Model,
    instance: Instance,
    inputs: Mapping[str, Signal],
    duration: float,
    times: Array,
    set_length: int,
    initial: dict[str, float] | None = None,
    progress: Progress = lambda t: None,
) -> Trajectory:
    """Exact states, outputs and sensors of one instance at `times` [s] (increasing, within 0..duration)."""
    signals = driving(model, inputs, duration)
    knots = {knot for signal in signals for knot in signal.knots()}
    x = np.array(model.start, dtype=float)
    for name, value in (initial or {}).items():
        x[model.states.index(name)] = value
    integrator = _integrator(model, instance.set, signals, x)
    rows_x, rows_y, rows_z = (np.empty((times.size, n)) for n in (x.size, len(model.outputs), len(model.sensors)))
    done = 0
    pieces = _pieces(instance, duration, set_length, model.sample_time, knots)
    for (name, held), group in itertools.groupby(pieces, key=lambda piece: (piece.set, piece.held)):
        own = list(group)
        edges = np.array([own[0].begin, *(piece.end for piece in own)])
        # a sample that lies on the end of a piece belongs to it: the set before an exchange
        last = int(np.searchsorted(times, edges[-1], side="right"))
        at = slice(done, last)
        rows_x[at] = x
        if not held:
            try:
                rows_x[at], x = integrator.run(name, signals, edges, x, times[at], progress)
            except Unsolved as stop:
                what = f"{model.path}: the exact solution of {instance.name} cannot be continued after {stop.args[0]:.6g} s"
                raise ModelError([f"{what} (no step is small enough); the model is unstable there"]) from stop
        rows_y[at], rows_z[at] = integrator.look(name, rows_x[at], *_seen(signals, edges, times[at]))
        if held:
            rows_y[at] = rows_y[max(done - 1, 0)]  # outputs are held as well, sensors are not
        done = last
    return Trajectory(rows_x, rows_y, rows_z, tuple(round(e.time / model.sample_time) + 1 for e in instance.exchanges))


def run(
    model: Model, scenario: Scenario, instance: Instance, times: Array, set_length: int, progress: Progress = lambda t: None
) -> Trajectory:
    """The exact solution of one instance of a scenario."""
    return solve(model, instance, scenario.inputs, scenario.duration, times, set_length, scenario.initial, progress)
