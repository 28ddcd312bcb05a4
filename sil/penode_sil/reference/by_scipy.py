# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The exact solution by SciPy: for stiff models, and where there is no compiler.

The integrator stops and starts anew at both ends of a piece. The kinks that ReLU networks have within are left to the step control.
LSODA is as accurate with ten times the tolerance of compiled code.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import Model

from ..late import Held
from ..signals import Signal
from .accuracy import ATOL, RTOL, Unsolved

if TYPE_CHECKING:
    from scipy.integrate import OdeSolver  # slow to load

Array = NDArray[np.float64]


class Inputs:
    """All inputs and their rates at one time, seen from within a piece (at its end: the rate before the knot)."""

    def __init__(self, signals: Sequence[Signal], begin: float, end: float):
        self.signals, self.begin, self.end, self.last = signals, begin, end, float(np.nextafter(end, begin))
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


class ByScipy:
    """The equations of a model, with one of its sets at a time; methods as those of Compiled."""

    def __init__(self, model: Model):
        self.model = model
        self._equations = {name: penode_gen.numeric(model, name) for name in model.sets}

    def run(
        self, set_name: str, signals: Sequence[Signal], edges: Array, x: Array, times: Array, progress: Callable[[float], None]
    ) -> tuple[Array, Array]:
        """From x [n_x] at edges[0] to edges[-1], the signals being smooth between `edges` [s]: the states at `times` [n] within, [n, n_x],
        and the last state. Raises Unsolved."""
        kept, done = np.empty((times.size, x.size)), int(np.searchsorted(times, edges[0], side="right"))
        kept[:done] = x
        for begin, end in itertools.pairwise(edges):
            solver = self._solver(set_name, Inputs(signals, begin, end), x)
            while solver.status == "running":
                failure = solver.step()
                if failure or solver.t == solver.t_old or not np.all(np.isfinite(solver.y)):  # LSODA goes on without an end
                    raise Unsolved(solver.t)
                reached = int(np.searchsorted(times, solver.t, side="right"))
                if reached > done:
                    between = solver.dense_output()
                    for row in range(done, reached):
                        kept[row] = solver.y if times[row] == solver.t else between(times[row])
                    done = reached
                    progress(solver.t)
            x = solver.y
        return kept, x

    def look(self, set_name: str, x: Array, u: Array, v: Array) -> tuple[Array, Array]:
        """Outputs [n, n_y] and sensors [n, n_z] at x [n, n_x], u and v = du/dt [n, n_u]."""
        system = self._equations[set_name]
        rows = list(zip(x, u, v, strict=True))
        y = np.array([system.outputs(*row) for row in rows]).reshape(len(x), len(self.model.outputs))
        return y, np.array([system.sensors(*row) for row in rows]).reshape(len(x), len(self.model.sensors))

    def _solver(self, set_name: str, source: Inputs, x: Array) -> OdeSolver:
        """A solver of the equations over a piece, from its first state on."""
        from scipy.integrate import LSODA  # here, for other commands need not wait for it

        system = self._equations[set_name]
        solver: OdeSolver = LSODA(
            lambda t, state: system.rates(state, *source.before(t)), source.begin, x, source.end, rtol=10.0 * RTOL, atol=10.0 * ATOL
        )
        return solver
