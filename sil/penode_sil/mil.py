# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Model in the loop: the exact solution that every target is compared with, in float64 with tight tolerances.

The inputs are functions of continuous time. The integrator stops and starts anew wherever the right-hand side changes
its form: at parameter exchanges, at both ends of a hold, and at the knots of the inputs. The kinks that ReLU networks
have within a piece are left to the step control; LSODA needs a third of DOP853's evaluations for them, DOP853 starts
faster, which counts where pieces are short (a recording has a knot at each sample).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import Model

from .errors import ModelError
from .late import Held, driving
from .scenario import Instance, Scenario, staging_samples
from .signals import Signal

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver  # slow to load

Array = NDArray[np.float64]
RTOL, ATOL = 1e-11, 1e-13
SHORT = 0.02  # [s] pieces below it are for DOP853
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
    edges = sorted(cut for cut in cuts if 0.0 <= cut <= duration)
    pieces = []
    for begin, end in itertools.pairwise(edges):
        middle = 0.5 * (begin + end)
        name = [name for time, name in changes if time < middle][-1]
        pieces.append(_Piece(begin, end, name, any(a < middle < b for a, b in holds)))
    return pieces


class _Inputs:
    """All inputs and their rates at one time, seen from within a piece (at its end: the rate before the knot)."""

    def __init__(self, signals: tuple[Signal, ...], begin: float, end: float):
        self.signals, self.begin, self.last = signals, begin, float(np.nextafter(end, begin))
        middle = np.array(0.5 * (begin + end))
        self.steps = {i: float(signal.value(middle)) for i, signal in enumerate(signals) if isinstance(signal, Held)}

    def __call__(self, t: float) -> tuple[Array, Array]:
        at, inside = np.array(t), np.array(min(max(t, self.begin), self.last))
        u = np.array([float(signal.value(at)) for signal in self.signals])
        return u, np.array([float(signal.slope(inside)) for signal in self.signals])

    def before(self, t: float) -> tuple[Array, Array]:
        """The same for the equations: at the end of the piece, what moves in steps has not moved yet."""
        u, udot = self(t)
        for i, level in self.steps.items():
            u[i] = level
        return u, udot


def _solver(system: penode_gen.Numeric, source: _Inputs, piece: _Piece, x: Array) -> OdeSolver:
    """A solver of the equations over a piece, from its first state on."""
    from scipy.integrate import DOP853, LSODA  # here, for other commands need not wait for it

    method = DOP853 if piece.end - piece.begin < SHORT else LSODA
    solver: OdeSolver = method(lambda t, state: system.rates(state, *source.before(t)), piece.begin, x, piece.end, rtol=RTOL, atol=ATOL)
    return solver


def _step(solver: OdeSolver, what: str) -> None:
    """One step of a solver. UserError if `what` it solves cannot be continued."""
    message = solver.step()
    if solver.status == "failed" or not np.all(np.isfinite(solver.y)):
        why = message or "a state is not finite"
        raise ModelError([f"{what} cannot be continued after {solver.t:.6g} s ({why}); the model is unstable there"])


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
    equations = {name: penode_gen.numeric(model, name) for name in model.sets}
    x = np.array(equations[instance.set].initial_state(), dtype=float)
    for name, value in (initial or {}).items():
        x[model.states.index(name)] = value
    rows_x = np.empty((times.size, x.size))
    rows_y, rows_z = np.empty((times.size, len(model.outputs))), np.empty((times.size, len(model.sensors)))
    done = 0

    def keep(row: int, state: Array, system: penode_gen.Numeric, source: _Inputs) -> None:
        u, udot = source(float(times[row]))
        rows_x[row], rows_y[row], rows_z[row] = state, system.outputs(state, u, udot), system.sensors(state, u, udot)

    for piece in _pieces(instance, duration, set_length, model.sample_time, knots):
        system, source = equations[piece.set], _Inputs(signals, piece.begin, piece.end)
        # a sample that lies on the end of a piece belongs to it: the set before an exchange
        last = int(np.searchsorted(times, piece.end, side="right"))
        if piece.held:
            for row in range(done, last):
                keep(row, x, system, source)
                rows_y[row] = rows_y[max(row - 1, 0)]  # outputs are held as well, sensors are not
            done = last
            continue
        solver = _solver(system, source, piece, x)
        while done < last and times[done] <= piece.begin:
            keep(done, x, system, source)
            done += 1
        while solver.status == "running":
            _step(solver, f"{model.path}: the exact solution of {instance.name}")
            reached = int(np.searchsorted(times, solver.t, side="right"))
            if reached > done:
                between = solver.dense_output()
                for row in range(done, reached):
                    keep(row, solver.y if times[row] == solver.t else between(times[row]), system, source)
                done = reached
                progress(solver.t)
        x = solver.y
    return Trajectory(rows_x, rows_y, rows_z, tuple(round(e.time / model.sample_time) + 1 for e in instance.exchanges))


def run(
    model: Model, scenario: Scenario, instance: Instance, times: Array, set_length: int, progress: Progress = lambda t: None
) -> Trajectory:
    """The exact solution of one instance of a scenario."""
    return solve(model, instance, scenario.inputs, scenario.duration, times, set_length, scenario.initial, progress)
