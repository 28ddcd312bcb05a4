# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings as `penode simulate` predicts them: the same reader, starts, generated C and errors."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from . import replay, results, scenario, starts
from .errors import RecordingError, UserError
from .recordings.measured import Measured
from .schedule import instance_calls
from .signals import Samples
from .targets import Sil

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Options:
    """Options of `penode simulate`: parameter set, names of channels, whether start states are fitted to the first samples, and whether
    inputs are held between rows; `sets`: other parameter sets by files of recordings, for models that have them."""

    set_name: str
    channels: Sequence[str] = ()
    measured: bool = False
    held: bool = False
    sets: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        given = [f"--set {self.set_name}"] if self.set_name != "default" else []
        given += [f"--channel '{c}'" if re.search(r"\s", c) else f"--channel {c}" for c in self.channels]
        return " ".join([*given, *["--start measured"] * self.measured, *["--replay held"] * self.held])


@dataclass(frozen=True, eq=False)
class Predicted:
    """What a model makes of a recording: sensors [n, n_z] at `time` [n] of the file; errors by sensor, in its unit: `value`, `unit` and
    `samples`."""

    time: Array
    z: Array
    errors: dict[str, dict[str, Any]]

    def at(self, time: Array) -> Array:
        """Sensors [samples, n_z] at other times of the file [samples]."""
        return np.column_stack([np.interp(time, self.time, z) for z in self.z.T])


def read(m: Measured, model: Model, options: Options) -> replay.Replay:
    """A recording as `penode simulate --input` reads it. Raises UserError, also for one that is no file."""
    if not m.path.is_file():
        raise RecordingError(f"{m.path}: there is no such file")
    how = "held" if options.held else "linear"
    return replay.load(m.path, model, _set(model, options), options.channels, how, lambda text: None)


def known(m: Measured, model: Model, options: Options) -> replay.Replay:
    """A recording that `penode simulate` does not read, as far as it is known."""
    times = m.time - m.time[0]
    inputs = {s.name: Samples(times, u) for s, u in zip(model.inputs, m.u.T, strict=True)}
    instance = scenario.Instance(model.name, _set(model, options) or next(iter(model.sets)))
    plan = scenario.Scenario(m.title, float(times[-1]), inputs, {}, (instance,), m.path)
    units = {s.name: s.unit for s in (*model.sensors, *model.outputs)}
    sensed = {k: replay.Sensed(units[k], m.time[m.shown[k]], z[m.shown[k]]) for k, z in m.z.items() if k in units and m.shown[k].any()}
    return replay.Replay(plan, times, float(m.time[0]), m.u, sensed)


def _set(model: Model, options: Options) -> str | None:
    return options.set_name if options.set_name in model.sets else None


def predict(model: Model, recording: replay.Replay, options: Options) -> Predicted:
    """What `penode simulate` gives for a recording. Raises UserError."""
    instance = recording.plan.instances[0]
    own = options.sets.get(recording.plan.path.name, "")
    instance = replace(instance, set=own) if own in model.sets else instance
    initial = starts.fit(model, instance.set, recording, starts.Start({}, True))[0] if options.measured else {}
    compiled = Sil(model)
    run = compiled.run(recording.u, instance_calls(model, instance, initial, compiled.dtype), instance.set)
    result = results.Result(instance, run.x, run.y, run.z, run.status, (), run)
    return Predicted(recording.times + recording.offset, run.z.astype(float), results.rmse(model, recording, result))


def both(
    models: tuple[Model, Model], recordings: Sequence[replay.Replay], options: Options
) -> tuple[Options, list[tuple[Predicted, Predicted]]]:
    """Every recording by two models, and the options by which: start states are those of the model files where they cannot be fitted to
    the first samples of every recording. Raises UserError."""
    try:
        return options, [(predict(models[0], r, options), predict(models[1], r, options)) for r in recordings]
    except UserError:
        if not options.measured:
            raise
        return both(models, recordings, replace(options, measured=False))
