# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Fits of a law, or of none, to recordings, with MuJoCo as the model: damped Gauss-Newton with differences, everything relative."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from . import effects
from .effects import Effect
from .engine import COARSE, Array, Unstable, run
from .plants import Plant

NUDGE = 1e-3  # relative, of differences
ENOUGH = 1e-3  # relative fall of the sum of squares below which a fit has ended
CHORD = 0.9  # share of the sum of squares that a step leaves, above which derivatives are taken again
FARTHEST = 0.5  # of any number, relative, in a step
FREE = {  # numbers of an effect that a fit changes, where not all
    "position_dependent_friction": ("force", "variation")
}


@dataclass(frozen=True)
class Record:
    """A recording: what was sent [n], where it began, signals without noise and as written [n, sensors]."""

    u: Array | None
    start: Mapping[str, float]
    clean: Array
    seen: Array


@dataclass(frozen=True)
class State:
    """What a simulation takes: parameters, effects, start positions of each recording."""

    values: Mapping[str, float]
    effects: tuple[Effect, ...]
    starts: tuple[Mapping[str, float], ...]


def simulate(
    plant: Plant,
    values: Mapping[str, float],
    hidden: Sequence[Effect],
    u: Array | None,
    start: Mapping[str, float],
    rows: int,
    step: float = COARSE,
) -> Array:
    """Signals [rows, sensors] before noise, for the commands; wrong parameters take the place of those given. Raises Unstable."""
    wrong = {e.place: e.numbers["value"] for e in hidden if e.kind == "wrong_parameter"}
    inside = effects.in_plant(list(hidden), plant)
    if late := effects.late(hidden):
        inside.actuator = {k: x for k, x in inside.actuator.items() if k not in effects.HISTORY}
    job = plant.job({**values, **wrong}, inside)
    job.late = late
    job.start.update(start)
    r = run(job, rows, step, u, effects.reach(list(hidden)), plant.road)
    return effects.sensed(list(hidden), plant, plant.columns(r.y))


class Fit:
    """A fit of parameters, start positions and sizes of `hidden`; parameters with a tolerance are held by it, `fixed` ones do not move."""

    def __init__(
        self,
        plant: Plant,
        tolerance: float | None,
        records: Sequence[Record],
        clean: bool,
        hidden: Sequence[Effect],
        fixed: Sequence[str] = (),
    ) -> None:
        self.plant, self.tolerance = plant, tolerance
        self.records, self.data = records, [r.clean if clean else r.seen for r in records]
        self.noise = np.array([s.noise for s in plant.sensors])
        nominal = {k: v for k, (v, _) in plant.values.items()}
        self.first = State(nominal, tuple(hidden), tuple(r.start for r in records))
        kept = {*plant.exact, *fixed, *(e.place for e in hidden if e.kind == "wrong_parameter")}
        self.free = [k for k in nominal if k not in kept]
        self.sizes = [(i, k) for i, e in enumerate(hidden) for k in FREE.get(e.kind, tuple(e.numbers))]
        self.begins = [(i, k) for i, r in enumerate(records) for k in r.start]
        self.x = np.zeros(len(self.free) + len(self.sizes) + len(self.begins))
        self.residual = self._residual(self.x)

    def state(self, x: Array) -> State:
        """What is simulated at x."""
        values = dict(self.first.values)
        for k, d in zip(self.free, x, strict=False):
            values[k] *= max(1 + d, 0.05)
        changed, rest = list(self.first.effects), x[len(self.free) :]
        for (i, k), d in zip(self.sizes, rest, strict=False):
            changed[i] = replace(changed[i], numbers={**changed[i].numbers, k: self.first.effects[i].numbers[k] * (1 + d)})
        starts = [dict(s) for s in self.first.starts]
        for (i, k), d in zip(self.begins, rest[len(self.sizes) :], strict=True):
            starts[i][k] += d
        return State(values, tuple(changed), tuple(starts))

    def _residual(self, x: Array) -> Array:
        s = self.state(x)
        out = []
        for r, y, start in zip(self.records, self.data, s.starts, strict=True):
            out.append((simulate(self.plant, s.values, s.effects, r.u, start, len(y)) - y) / self.noise)
        self.measured = sum(o.size for o in out)
        held = x[: len(self.free)] / self.tolerance if self.tolerance else np.zeros(0)
        return np.concatenate([*(o.ravel() for o in out), held])

    def solve(self, rounds: int = 6, enough: float = ENOUGH) -> Fit:
        """Improve until little changes, at most `rounds` times; each round uses its derivatives as long as they help."""
        damping = 1e-4
        for _ in range(rounds):
            before = self.energy
            a = np.column_stack([(self._residual(self.x + NUDGE * e) - self.residual) / NUDGE for e in np.eye(len(self.x))])
            gram = a.T @ a
            for _ in range(5):
                was = self.energy
                step = np.linalg.solve(gram + damping * np.diag(np.diag(gram) + 1e-9), -a.T @ self.residual)
                if self._improved(np.asarray(step * min(1.0, FARTHEST / max(float(np.abs(step).max()), 1e-9)))):
                    damping /= 4
                    if self.energy > CHORD * was:
                        break
                else:
                    damping *= 20
            if before - self.energy < enough * before:
                break
        return self

    def _improved(self, step: Array) -> bool:
        """Take a step if it improves."""
        try:
            residual = self._residual(self.x + step)
        except Unstable:
            return False
        if float(residual @ residual) >= self.energy:
            return False
        self.x, self.residual = self.x + step, residual
        return True

    @property
    def ratio(self) -> float:
        """RMS of the residual over the noise."""
        return float(np.sqrt(np.mean(self.residual[: self.measured] ** 2)))

    @property
    def energy(self) -> float:
        """Sum of squares of the residual over the noise."""
        return float(np.sum(self.residual**2))

    def elsewhere(self, record: Record) -> float:
        """The same ratio on another recording, from its own start."""
        s = self.state(self.x)
        y = simulate(self.plant, s.values, s.effects, record.u, record.start, len(record.seen))
        return float(np.sqrt(np.mean(((y - record.seen) / self.noise) ** 2)))
