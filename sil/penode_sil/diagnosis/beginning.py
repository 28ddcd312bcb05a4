# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a prediction of a recording begins: at rest, or at the states that its first samples show; never at a start fitted to all of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from .evidence.fit import Problem
from .evidence.observer import Filter, Predictor, Record, augmented, sample_noise
from .fit import Free, Problem as OutputError
from .noise import Experiment
from .study import Study

Array = NDArray[np.float64]
FIRST = 50  # samples that a start is fitted to


def start_of(model: Model, e: Experiment, study: Study, set_name: str = "") -> Array:
    """Start states [n_x] of a model, the nominal one or one that extends it, for a recording: those of the model file where the training
    began at rest, else the likeliest ones of the first FIRST samples. Hidden states of laws begin at rest."""
    start = np.array(model.start, dtype=float)
    own = [i for i, name in enumerate(model.states) if name in study.model.states]
    if not study.moving or not own:
        return start
    problem = OutputError(study.model, study.experiments[:1], (), study.set_name, study.linear.fastest)
    x = np.array(problem.simulate(0, study.null.free, np.zeros((1, len(study.null.free))), study.model.states)[1][0])
    size = dict(zip(study.model.states, 3.0 * np.sqrt(np.mean(np.where(np.abs(x) < 1e12, x, 0.0) ** 2, axis=0)) + 1e-9, strict=True))
    record = Record.of(e)
    few = replace(record, u=record.u[:FIRST], y=record.y[:FIRST])
    wide = augmented(model, study.places)
    noise = sample_noise([record], np.array([s.noise for s in model.sensors]))
    free = tuple(Free(("start", 0, i), start[i], 0.01 * size[model.states[i]], sigma=size[model.states[i]], origin=start[i]) for i in own)
    predictor = Predictor(wide, [few], 1, set_name or study.set_name, study.linear.fastest)
    fit = Problem(predictor, noise**2).solve(free, Filter.none(len(wide.states), len(noise)))
    for f in fit.free:
        start[f.target[2]] = f.value
    return start
