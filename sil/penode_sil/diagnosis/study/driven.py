# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings for a diagnosis, and the decision by the sensors on an input that the file repeats between samples.

Such an input may have moved in steps (a controller's output, a rig), or smoothly, and only the logger repeated it. Rows do not tell
one from the other; the sensors do: a plant that is driven by steps follows them half an interval later, and shakes with them. When a
step came, between a row and the next one, they tell as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from penode_gen.model import Model

from ...errors import ModelError
from ...recordings.measured import Measured
from ..plant.compiling import moving
from . import noise
from .noise import Experiment
from .study import Study, begin, loss, refit


def experiment(m: Measured, model: Model, smooth: bool = False) -> Experiment:
    """A recording as the diagnosis sees it; sensors that it does not have count as not good. `smooth`: no input is held, unless the model
    file says so."""
    n, names = len(m.time), [s.name for s in model.sensors]
    if not names:
        raise ModelError([f"{model.path}: no sensor to compare with a recording; describe what was measured in [sensors]"])
    y = np.column_stack([m.z.get(k, np.zeros(n)) for k in names])
    good = np.column_stack([m.mask.get(k, np.zeros(n, bool)) for k in names])
    channels = m.quality.channels
    laws = [channels[k].noise if k in channels else None for k in names]
    declared = np.array([i.noise for i in model.inputs])
    slow = [channels[k].interval if k in channels else 0.0 for k in names]
    least = model.sample_time if model.interpolation == "held" else 0.0
    smooth = smooth and not least
    held = np.array([max(channels[i.name].interval if not smooth and _is_held(m, i.name) else 0.0, least) for i in model.inputs])
    u = m.u if m.smooth is None or not smooth else m.smooth
    return noise.prepare(m.title, m.time, u, np.where(good, y, 0.0), good, declared, laws, slow, held)


def _is_held(m: Measured, name: str) -> bool:
    return name in m.quality.channels and m.quality.channels[name].how == "held"


def settled(
    model: Model, train: Sequence[Measured], holdout: Sequence[Measured], set_name: str
) -> tuple[list[Experiment], list[Experiment], list[str]]:
    """Training and hold-out with held inputs as the training's sensors are likelier to have met them, in steps or smooth, and a note."""
    if model.interpolation == "held":
        return [experiment(m, model) for m in train], [experiment(m, model) for m in holdout], []
    names = [i.name for i in model.inputs if any(_is_held(m, i.name) for m in (*train, *holdout))]
    smooth = [[experiment(m, model, smooth=True) for m in ms] for ms in (train, holdout)]
    if not names:
        return smooth[0], smooth[1], []
    what = f"{', '.join(names)}: repeated between samples; "
    if moving(model):  # the rate of a step is endless
        return smooth[0], smooth[1], [f"{what}taken as smooth, because the model uses an input's rate"]
    held = [[experiment(m, model) for m in ms] for ms in (train, holdout)]
    study, lead = _led(model, held[0], set_name)
    other = begin(model, smooth[0], set_name)
    better = loss(other, other.null) - loss(study, study.null)
    margin = f"by {abs(better):.3g} of -2 ln(likelihood) of the sensors"
    if better < 0.0:
        return smooth[0], smooth[1], [f"{what}the plant was driven by a smooth one, {margin}"]
    held = [[_ahead(e, lead) for e in es] for es in held]
    when = f", {1e3 * lead * model.sample_time:.3g} ms before the rows that show them"
    return held[0], held[1], [f"{what}the plant was driven by its steps{when}, {margin}"]


def _led(model: Model, experiments: Sequence[Experiment], set_name: str) -> tuple[Study, float]:
    """The study of the experiments with the lead of their steps, in samples, with which the model fits best."""
    lead, near = 0.5, 0.1  # anywhere between two rows, at first; a parabola goes through the costs that far to either side
    for _ in range(2):
        study = begin(model, [_ahead(e, lead) for e in experiments], set_name)
        before, here, after = (_cost(study, lead + d) for d in (-near, 0.0, near))
        bend = before - 2.0 * here + after
        move = 0.5 * near * (before - after) / bend if bend > 0.0 else np.sign(before - after)
        lead = float(np.clip(lead + move, 0.0, 1.0))
    return begin(model, [_ahead(e, lead) for e in experiments], set_name), lead


def _cost(study: Study, lead: float) -> float:
    """Cost of the null fit with another lead, in the metric of the study."""
    moved = replace(study, experiments=tuple(_ahead(e, lead) for e in study.experiments))
    return refit(moved, study.null.free).cost


def _ahead(e: Experiment, lead: float) -> Experiment:
    return e if e.held is None else replace(e, lead=lead)
