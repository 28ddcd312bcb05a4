# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise from recordings at standstill, instead of the model file's."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Input, Model, Signal

from ...errors import RecordingError, UserError
from ...recordings import aliases, pick, read
from ...recordings.measured import Measured
from ...recordings.raster import SHORTEST

Array = NDArray[np.float64]
Channel = TypeVar("Channel", Signal, Input)


def with_noise_at_rest(model: Model, paths: Iterable[Path], channels: Iterable[str], train: Sequence[Measured]) -> Model:
    """The model with the noise of each sensor and input [SI, standard deviation of a sample] as `paths`, recordings at standstill, show it
    about a straight line, for what drifts is no noise. Channels that are not there, or do not change (a resolution too coarse to show
    noise), keep what the model file states. UserError for a recording without any channel of the model, or in which something moves."""
    paths = list(paths)
    pairs = aliases(channels, [*(i.name for i in model.inputs), *(s.name for s in (*model.sensors, *model.outputs))])
    found: dict[str, list[float]] = {}
    problems: list[str] = []
    for path in paths:
        try:
            for name, noise in _of(path, model, pairs, train).items():
                found.setdefault(name, []).append(noise)
        except UserError as exc:
            problems += exc.problems
    if problems:
        raise RecordingError(*problems)

    def quiet(s: Channel) -> Channel:
        return replace(s, noise=float(np.sqrt(np.mean(np.square(found[s.name]))))) if s.name in found else s

    return replace(model, sensors=tuple(map(quiet, model.sensors)), inputs=tuple(map(quiet, model.inputs)))


def _of(path: Path, model: Model, pairs: dict[str, str], train: Sequence[Measured]) -> dict[str, float]:
    """Noise of each channel of a recording that changes."""
    signals: dict[str, Signal | Input] = {**{i.name: i for i in model.inputs}, **{s.name: s for s in model.sensors}}
    tables = read(path, [*signals, "time"], pairs)
    held = [s for s in signals.values() if any(t.find(s.name, s.unit) for t in tables)]
    if not held:
        raise RecordingError(f"{path}: it holds no sensor or input of the model; record at least one of: {', '.join(signals)}")
    found = {}
    for s in held:
        x = pick(tables, s.name, s.unit).channel(s.name, s.unit)
        if len(x) < SHORTEST:
            raise RecordingError(
                f"{path}: channel {s.name} has {len(x)} samples; a noise needs at least {SHORTEST}, record longer", channel=s.name
            )
        noise = deviation(x)
        moving = [deviation(m.z[s.name][m.mask[s.name]]) for m in train if s.name in m.z and m.mask[s.name].any()]
        if moving and noise >= min(moving):
            raise RecordingError(
                f"{path}: {s.name} varies by {noise:.3g} {units.si(s.unit)}, "
                f"in a recording of motion by {min(moving):.3g} {units.si(s.unit)}; "
                "--still takes a recording in which nothing moves"
            )
        if noise > 0.0:
            found[s.name] = noise
    return found


def deviation(x: Array) -> float:
    """Standard deviation [unit of x] about the straight line that fits best."""
    t = np.linspace(-1.0, 1.0, len(x))
    return float(np.sqrt(np.sum((x - np.polyval(np.polyfit(t, x, 1), t)) ** 2) / (len(x) - 2)))
