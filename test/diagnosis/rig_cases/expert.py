# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What an expert reaches who knows the true law: parameters, hidden arguments and starts, fitted to the recordings as written."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from .recordings import Recording
from .rig import Rig
from .signals import late, none
from .solver import Array, half_steps, simulate

FLOOR = 0.002  # of a signal: no model is better
UNSTATED = 0.05  # tolerance where none is stated
ROOM = 1.5  # tolerances that a parameter may move, while the true law is fitted; 1 without it
ROWS = 8000  # that a fit takes, of all recordings together
START = 50  # rows that the start of a hold-out is fitted to
FAR = 1e6

Values = Mapping[str, float]


def drive(rig: Rig, recording: Recording, delay: float | None = None) -> Array:
    """Inputs at half steps in SI units, read from a recording: held or by a spline."""
    half = half_steps(recording.times, rig.steps)
    found = []
    for i in rig.inputs:
        y = recording.inputs[i.name] * i.si
        if not i.held:
            found.append(CubicSpline(recording.times, y)(half))
        elif delay is None:
            found.append(np.repeat(y[:-1, None], half.shape[1], axis=1))
        else:
            found.append(late(recording.times, y, half, delay))
    return np.stack(found, axis=2) if found else none(half, recording.times)


def weights(rig: Rig, recordings: Sequence[Recording]) -> dict[str, float]:
    """What an error of each sensor is measured in: noise and quantisation, and a share of the signal."""
    spread = {s.name: np.std(np.concatenate([r.sensors[s.name] for r in recordings])) for s in rig.sensors}
    return {s.name: float(np.hypot(s.noise, FLOOR * spread[s.name])) for s in rig.sensors}


def errors(rig: Rig, recording: Recording, law: Values, start: Array, inputs: Array, rows: int | None = None) -> dict[str, Array]:
    """Predicted minus recorded sensors; 0 in empty cells."""
    times = recording.times[:rows]
    states, found = simulate(rig.plant, times, inputs[: len(times) - 1], rig.vector(law), start, rig.steps)
    shown = rig.shown(states, found)
    out = {}
    for s in rig.sensors:
        off = shown[s.name] - recording.sensors[s.name][:rows]
        off = np.nan_to_num(off, nan=FAR, posinf=FAR, neginf=-FAR) + law.get(f"offset_{s.name}", 0.0)
        out[s.name] = np.where(recording.empty[s.name][:rows], 0.0, off)
    return out


def begin(rig: Rig, recording: Recording) -> Array:
    """The start of a recording: the stated one, or by sight where it starts in motion."""
    plan = recording.plan
    return np.array(rig.start(recording.sensors, recording.times), dtype=float) if plan.free else plan.start


@dataclass
class Fit:
    """Least squares over parameters (prior: tolerances), hidden arguments and starts of recordings in motion."""

    rig: Rig
    recordings: Sequence[Recording]
    law: Values  # what holds beside parameters and hidden arguments
    hidden: Values
    wide: Collection[str]
    names: list[str] = field(init=False)
    inputs: list[Array] = field(init=False)
    starts: list[Array] = field(init=False)

    def __post_init__(self) -> None:
        self.names = [p.name for p in self.rig.parameters if not p.exact]
        self.inputs = [drive(self.rig, r) for r in self.recordings]
        self.starts = [begin(self.rig, r) for r in self.recordings]

    def unpacked(self, v: Array) -> tuple[dict[str, float], list[Array]]:
        """Values of parameters and hidden arguments, and starts."""
        values = self.rig.nominal()
        spread = {p.name: p.tolerance or UNSTATED for p in self.rig.parameters}
        for name, x in zip(self.names, v, strict=False):
            values[name] *= float(np.exp(x * (1.0 if name in self.wide else spread[name])))
        at = len(self.names)
        for name, first in self.hidden.items():
            values[name] = float(first * (v[at] if name in self.rig.linear else np.exp(v[at])))
            at += 1
        starts = []
        for start, r in zip(self.starts, self.recordings, strict=True):
            if r.plan.free:
                start = start + v[at : at + len(start)] * self.rig.scatter
                at += len(start)
            starts.append(start)
        return values, starts

    def run(self) -> dict[str, float]:
        """The values that fit best."""
        w = weights(self.rig, self.recordings)
        every = max(1, sum(len(r.times) for r in self.recordings) // ROWS)

        def residuals(v: Array) -> Array:
            values, starts = self.unpacked(v)
            out = [v[: len(self.names)]]
            for r, start, known in zip(self.recordings, starts, self.inputs, strict=True):
                inputs = drive(self.rig, r, values["delay"]) if "delay" in values else known
                off = errors(self.rig, r, {**self.law, **values}, start, inputs)
                out += [np.clip(off[s.name][::every] / w[s.name], -FAR, FAR) for s in self.rig.sensors]
            return np.concatenate(out)

        moving = sum(len(s) for s, r in zip(self.starts, self.recordings, strict=True) if r.plan.free)
        first = np.array([0.0] * len(self.names) + [float(n in self.rig.linear) for n in self.hidden] + [0.0] * moving)
        limit = np.full(len(first), np.inf)
        for k, name in enumerate(self.names):
            if name not in self.wide:
                limit[k] = ROOM if self.hidden else 1.0
        best = least_squares(residuals, first, bounds=(-limit, limit), max_nfev=40, diff_step=1e-4)
        return self.unpacked(best.x)[0]


def holdout(rig: Rig, recordings: Sequence[Recording], law: Values) -> dict[str, float]:
    """RMS errors of the sensors, in their units. A start in motion is fitted to the first rows."""
    w = weights(rig, recordings)
    found: dict[str, list[Array]] = {s.name: [] for s in rig.sensors}
    for r in recordings:
        inputs, start = drive(rig, r, law.get("delay")), begin(rig, r)

        def residuals(v: Array, r: Recording = r, inputs: Array = inputs, start: Array = start) -> Array:
            off = errors(rig, r, law, start + v * rig.scatter, inputs, min(START, len(r.times)))
            return np.concatenate([off[s.name] / w[s.name] for s in rig.sensors])

        if r.plan.free:
            start = start + least_squares(residuals, np.zeros(len(start)), max_nfev=30).x * rig.scatter
        for name, off in errors(rig, r, law, start, inputs).items():
            found[name].append(off[~r.empty[name]])
    return {name: float(np.sqrt(np.mean(np.concatenate(off) ** 2))) for name, off in found.items()}


@dataclass
class Study:
    """Hold-out errors of the nominal values, of values fitted within their tolerances, and of the true law fitted."""

    nominal: dict[str, float]
    refitted: dict[str, float]
    expert: dict[str, float]
    fitted: dict[str, float]

    @property
    def gain(self) -> float:
        """How many times better the true law is than either, in the sensor that shows it best."""
        return min(max(x[s] / self.expert[s] for s in x) for x in (self.nominal, self.refitted))


def study(rig: Rig, recordings: Sequence[Recording]) -> Study:
    """Both fits of a rig."""
    train, held_out = ([r for r in recordings if r.plan.held_out == which] for which in (False, True))
    plain = Fit(rig, train, rig.absent, {}, ()).run()
    nominal, refitted = (holdout(rig, held_out, {**rig.absent, **v}) for v in (rig.nominal(), plain))
    if rig.null:
        return Study(nominal, refitted, refitted, plain)
    law = {**rig.absent, **rig.law}
    fitted = Fit(rig, train, law, rig.hidden, rig.wide).run()
    return Study(nominal, refitted, holdout(rig, held_out, {**law, **fitted}), fitted)
