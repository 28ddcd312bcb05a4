# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings that drive a model: inputs on the model's raster, and the measured sensors."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from . import recordings, scenario as scenarios
from .errors import Problem, RecordingError, UserError
from .recordings import Recording
from .recordings.uneven import held_rows
from .signals import Samples

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sensed:
    """What a recording holds of one sensor or output: its own sound rows, in SI."""

    unit: str  # of the model file
    time: Array  # [rows] s, as in the file
    values: Array  # [rows]


@dataclass(frozen=True, eq=False)
class Replay:
    """One recording on the model's raster of n samples, SI."""

    plan: scenarios.Scenario
    times: Array  # [n] s, from 0
    offset: float  # s, time of the first sample in the file
    u: Array  # [n, inputs]
    sensed: dict[str, Sensed]


def load(path: Path, model: Model, set_name: str | None, channels: Iterable[str], how: str, note: Callable[[str], None]) -> Replay:
    """Read a recording for a model; `how` says what an input does between two rows of the file. Raises UserError."""
    wanted = {signal.name: signal.unit for signal in model.inputs}
    signals = {s.name: s.unit for s in (*model.sensors, *model.outputs) if s.name not in wanted}
    pairs = recordings.aliases(channels, [*wanted, *signals])
    tables = recordings.read(path, [*wanted, *signals, "time"], pairs)
    sensed, broken = _sensed(tables, signals, path)
    if broken and not wanted and not sensed:
        raise RecordingError(next(iter(broken.values())))
    for name, problem in broken.items():
        note(f"{problem}; {name} is not compared")
    if wanted:
        raster, u, remarks = recordings.on_raster(tables, wanted, model.sample_time)
        if how != "linear":
            u, remarks = _between(tables, wanted, raster, model.sample_time, how)
    else:
        raster, remarks = _clock(path, sensed, model), []
        u = np.zeros((raster.size, 0))
    for remark in remarks:
        note(f"{path}: {remark}")
    times = np.arange(raster.size, dtype=np.float64) * model.sample_time
    inputs = {s.name: Samples(times, column) for s, column in zip(model.inputs, u.T, strict=True)}
    instance = scenarios.Instance(model.name, set_name or next(iter(model.sets)))
    plan = scenarios.Scenario(path.stem, float(times[-1]), inputs, {}, (instance,), path)
    return Replay(plan, times, float(raster[0]), u, sensed)


def _sensed(tables: list[Recording], signals: dict[str, str], path: Path) -> tuple[dict[str, Sensed], dict[str, Problem]]:
    """The sensors that the file holds, and why those that cannot be read are left out."""
    found: dict[str, Sensed] = {}
    broken: dict[str, Problem] = {}
    for name, unit in signals.items():
        try:
            if not any(table.find(name, unit) for table in tables):
                continue
            table = recordings.pick(tables, name, unit)
            time = table.channel("time", "s", finite=False)
            values = table.channel(name, unit, finite=False)
            sound = np.flatnonzero(np.isfinite(time) & np.isfinite(values))
            rows = table.ordered(sound)
        except UserError as exc:
            broken[name] = exc.problems[0]
            continue
        if sound.size:
            found[name] = Sensed(unit, rows.time, values[sound][rows.rows])
    return found, broken


def _clock(path: Path, sensed: dict[str, Sensed], model: Model) -> Array:
    """The raster of a model without inputs: as long as all its sensors were measured."""
    step = model.sample_time
    if not sensed:
        first = next(s.name for s in (*model.sensors, *model.outputs))
        look = f'"penode inspect {path.name} {model.path.name}" lists its columns'
        raise RecordingError(
            f"{path}: it holds no sensor of the model; {look}, then name them, such as --channel {first}=COLUMN", channel=first
        )
    first, last = max(s.time[0] for s in sensed.values()), min(s.time[-1] for s in sensed.values())
    count = int((last - first) / step + 1e-3) + 1
    if last <= first or count < 2:
        raise RecordingError(f"{path}: its sensors share less than two samples of {step * 1e3:g} ms; record them together")
    if count > 1000 * max(s.time.size for s in sensed.values()):
        raise RecordingError(f"{path}: it has far longer gaps than samples; split the recording there")
    raster: Array = first + np.arange(count, dtype=np.float64) * step
    return raster


def _between(tables: list[Recording], wanted: dict[str, str], raster: Array, step: float, how: str) -> tuple[Array, list[str]]:
    """Inputs [n, inputs] on a raster, held or band-limited between the rows of the file; notes."""
    columns, remarks = [], []
    for name, unit in wanted.items():
        table = recordings.pick(tables, name, unit)
        time, values = table.time(), table.channel(name, unit)
        usual = float(np.median(np.diff(time)))
        if how == "held":
            columns.append(values[held_rows(time, raster).clip(0)])
            continue
        grid = time[0] + np.arange(time.size) * (time[-1] - time[0]) / (time.size - 1)
        worst = float(np.max(np.abs(time - grid))) / usual
        if worst > 0.01:  # an error of pi * 1 % at half of the highest frequency
            what = f"rows are off an even clock by {worst:.2g} of their interval"
            raise RecordingError(f"{table.path}: channel {name}: its {what}; replay it with --replay linear or held")
        rows = (raster - time[0]) / usual
        if np.max(np.abs(rows - np.rint(rows))) < 1e-3 and 0.999 * step <= usual <= 1.001 * step:
            columns.append(values[np.rint(rows).astype(int)])
            continue
        kernel = recordings.Kernel(raster, float(time[0]), float(grid[1] - grid[0]), time.size, step)
        columns.append(kernel.apply(values[:, None])[:, 0])
        remarks.append(f"{name} is replayed band-limited from rows {usual * 1e3:.6g} ms apart")
    return np.column_stack(columns), list(dict.fromkeys(remarks))
