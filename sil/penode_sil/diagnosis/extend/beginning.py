# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a prediction of a recording begins: at rest, or at the states that its first samples show; never at a start fitted to all of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from ..evidence.colour import Colour
from ..evidence.fit import Problem
from ..evidence.observer import Filter, Predictor, Record, augmented, sample_noise
from ..study.fit import Free, Problem as OutputError
from ..study.noise import Experiment
from ..study.residual import noise_rms
from ..study.study import MOVING, Study

Array = NDArray[np.float64]
FIRST = 50  # samples that a start is fitted to


def begins_at_rest(model: Model, e: Experiment, study: Study, set_name: str = "") -> bool:
    """Does a recording begin with the start states of the model file, as the training does? Yes, if the nominal model follows its first
    FIRST samples from there, or if `model` does and other states gain no more than MOVING each, in chi2."""
    if study.moving:
        return False
    problem = OutputError(study.model, [e], (), study.set_name, study.linear.fastest)
    z = problem.simulate(0, study.null.free, np.zeros((1, len(study.null.free))), ())[0][0]
    off = np.mean((np.where(e.good, e.y - z, 0.0) / noise_rms(study))[:FIRST] ** 2, axis=0)
    if off.max(initial=0.0) < MOVING:
        return True
    own, free, problem_of, by = _first(model, e, study, set_name)
    gain = 2.0 * (problem_of.solve(free, by).likelihood - problem_of.at(free, by).likelihood)
    return bool(gain <= MOVING * len(own))


def start_of(model: Model, e: Experiment, study: Study, set_name: str = "", at_rest: bool | None = None) -> Array:
    """Start states [n_x] of a model, the nominal one or one that extends it, for a recording: those of the model file where it begins
    `at_rest` (None: by `begins_at_rest`), else the likeliest ones of the first FIRST samples. Hidden states of laws begin at rest."""
    start = np.array(model.start, dtype=float)
    if not any(name in study.model.states for name in model.states):
        return start
    if begins_at_rest(model, e, study, set_name) if at_rest is None else at_rest:
        return start
    own, free, problem, by = _first(model, e, study, set_name)
    start[own] = [f.value for f in problem.solve(free, by).free]
    return start


def _first(model: Model, e: Experiment, study: Study, set_name: str) -> tuple[list[int], tuple[Free, ...], Problem, Filter]:
    """Which states are the nominal model's, these as free start states, and the problem of fitting them to the first FIRST samples."""
    own = [i for i, name in enumerate(model.states) if name in study.model.states]
    problem = OutputError(study.model, study.experiments[:1], (), study.set_name, study.linear.fastest)
    x = np.array(problem.simulate(0, study.null.free, np.zeros((1, len(study.null.free))), study.model.states)[1][0])
    size = dict(zip(study.model.states, 3.0 * np.sqrt(np.mean(np.where(np.abs(x) < 1e12, x, 0.0) ** 2, axis=0)) + 1e-9, strict=True))
    record = Record.of(e)
    few = replace(record, u=record.u[:FIRST], y=record.y[:FIRST])
    wide = augmented(model)
    noise = sample_noise([record], np.array([s.noise for s in model.sensors]))
    at = {i: float(model.start[i]) for i in own}
    free = tuple(Free(("start", 0, i), at[i], 0.01 * size[model.states[i]], sigma=size[model.states[i]], origin=at[i]) for i in own)
    predictor = Predictor(wide, [few], 1, set_name or study.set_name, study.linear.fastest)
    return own, free, Problem(predictor, Colour.none(noise, 1)), Filter.none(len(wide.states), len(noise))
