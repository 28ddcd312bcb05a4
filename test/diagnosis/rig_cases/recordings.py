# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A recording of a rig, as its logger writes it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .rig import Input, Plan, Rig, Sensor
from .solver import Array, half_steps, simulate

SETTLED = 60  # rows at the begin of which none is lost or empty


@dataclass
class Recording:
    """Time stamps, inputs and sensors in their units, empty cells of sensors."""

    plan: Plan
    times: Array
    inputs: dict[str, Array]
    sensors: dict[str, Array]
    empty: dict[str, np.ndarray]


def logged(signal: Input, plan: Plan, states: Array, inputs: Array, times: Array, rng: np.random.Generator) -> Array:
    """An input as it is recorded, in its unit."""
    true = plan.command(times) if plan.command else signal.true(states, inputs)
    y = true / signal.si + signal.white * rng.standard_normal(len(times))
    return np.round(y / signal.step) * signal.step if signal.step else y


def measured(rig: Rig, states: Array, found: Array, rng: np.random.Generator) -> dict[str, Array]:
    """The sensors, with nonlinearity, bias, noise and quantisation."""
    shown = rig.shown(states, found)
    out = {}
    for s in rig.sensors:
        y = shown[s.name]
        if s.bent and not rig.null:
            y = y + s.bent * y * np.abs(y) / np.max(np.abs(y))
        y = y + s.bias + s.white * rng.standard_normal(len(y))
        out[s.name] = np.round(y / s.step) * s.step if s.step else y
    return out


def record(rig: Rig, plan: Plan, rng: np.random.Generator) -> Recording:
    """Simulates a plan on the actual sampling times. Half of the recordings of null cases are sampled without jitter."""
    n, logger = plan.rows, rig.logger
    jitter = 0.0 if rig.null and rng.random() < 0.5 else logger.jitter
    even = np.arange(n) * rig.sample
    times = even + rig.sample * jitter * rng.uniform(-1, 1, n)
    times -= times[0]
    inputs = plan.drive(half_steps(times, rig.steps), times)
    states, found = simulate(rig.plant, times, inputs, rig.vector(rig.true), plan.start, rig.steps)
    if not np.all(np.isfinite(states)):
        raise ValueError(f"the states of {rig.name} left all bounds")
    rows = np.vstack([inputs[:, 0, :], inputs[-1:, -1, :]])
    kept_inputs = {i.name: logged(i, plan, states, rows, times, rng) for i in rig.inputs}
    kept_sensors = measured(rig, states, found, rng)
    keep = np.ones(n, bool)
    if logger.lost:
        keep[rng.choice(np.arange(SETTLED, n - 5), logger.lost, replace=False)] = False
    stamps = np.round((times if logger.stamped else even)[keep], 6)
    empty = {s.name: np.zeros(len(stamps), bool) for s in rig.sensors}
    if logger.empty:
        for cells in empty.values():
            cells[rng.choice(np.arange(SETTLED, len(stamps)), logger.empty, replace=False)] = True
    kept_inputs, kept_sensors = ({name: y[keep] for name, y in some.items()} for some in (kept_inputs, kept_sensors))
    return Recording(plan, stamps, kept_inputs, kept_sensors, empty)


def write(rig: Rig, recording: Recording, path: Path) -> None:
    """A CSV file whose header states names and units."""
    signals: list[Input | Sensor] = [*rig.inputs, *rig.sensors]
    columns = [*recording.inputs.values(), *recording.sensors.values()]
    full = np.zeros(len(recording.times), bool)
    gaps = [recording.empty.get(s.name, full) for s in signals]
    lines = [",".join(["time [s]", *(f"{s.name} [{s.unit}]" for s in signals)])]
    for k, t in enumerate(recording.times):
        stamp = f"{t:.6f}".rstrip("0").rstrip(".")
        lines.append(",".join([stamp, *("" if gap[k] else f"{y[k]:.7g}" for y, gap in zip(columns, gaps, strict=True))]))
    path.write_text("\n".join(lines) + "\n")
