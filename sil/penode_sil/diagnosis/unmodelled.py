# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The unmodelled force that an explanation leaves beyond the noise of sensors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .evidence.bench import build
from .evidence.colour import shape
from .evidence.gain import Level
from .evidence.observer import Record, sample_noise
from .fit import Fit, Problem
from .noise import UNSEEN
from .residual import rms
from .rounds import MIN_GAIN
from .study import Study

Array = NDArray[np.float64]
UNMODELLED = 0.02  # size from which on a model is wrong everywhere; 0.01 may be that, or a curve that stands for another one
MIN_UNMODELLED = 0.0055  # of all forces, and worth MIN_GAIN: true causes leave less, 0.003 of the levels tried at most


@lru_cache(maxsize=2)  # the search asks, and the engine asks for the same again
def unmodelled(study: Study, fit: Fit, log: Callable[[str], None]) -> float:
    """The unmodelled force beside an explanation, as a share of all forces; 0 if it may be chance, infinite if the explanation follows the
    measurement worse than the model as it is: its curves hold along its own way alone, and bend away beside it. One fit by innovations."""
    if _is_noise(study, fit):
        return 0.0
    values = {f.target: f.value for f in fit.free if isinstance(f.target, str)}
    known = {n: replace(p, value=values.get(n, p.value), exact=True) for n, p in fit.model.parameters.items()}
    model = replace(fit.model, parameters=known)
    plain = [f for f in fit.free if isinstance(f.target, str) or f.target[0] == "start"]
    problem = Problem(fit.model, study.experiments, study.metrics, study.set_name, study.linear.fastest)
    records = []
    for e, x in enumerate(study.experiments):  # what faults of sensors explain is taken out of the recordings
        alone = np.array(problem.simulate(e, plain, np.zeros((1, len(plain))))[0][0])
        records.append(replace(Record.of(x), y=np.where(x.good, x.y - fit.simulated[e] + alone, np.nan)))
    noise = sample_noise(records, np.array([s.noise for s in model.sensors]))
    nominal = build(
        study.model, study.places, records, noise, study.linear.fastest, study.set_name, shape=shape(study.experiments, study.levels)
    )
    bench = build(model, study.places, records, noise, study.linear.fastest, study.set_name, nominal)
    still = bench.problem().solve(bench.fit.free, bench.gains(bench.fit).at(Level(0.0, 1.0)), 12)
    gained = bench.fit.likelihood - still.likelihood
    better = bench.fit.likelihood - nominal.fit.likelihood
    log(f"unmodelled force beside it: {bench.level.size:.3g} of all forces, {gained:.0f} nats; nominal model: {-better:.0f}")
    if better < -MIN_GAIN * len(nominal.free):
        return float("inf")
    return bench.level.size if gained > MIN_GAIN and bench.level.size > MIN_UNMODELLED else 0.0


def _is_noise(study: Study, fit: Fit) -> bool:
    """Does an explanation leave of every sensor no more than its stated noise? Slow noise looks like an unmodelled force."""
    return within(study, fit.simulated, np.array([s.noise for s in study.model.sensors]))


def within(study: Study, simulated: Sequence[Array], noise: Array) -> bool:
    """Does a simulation leave of every sensor no more than its noise [n_z]?"""
    for j, most in enumerate(noise):
        left = np.concatenate([(e.y - z)[e.good[:, j], j] for e, z in zip(study.experiments, simulated, strict=True)])
        if left.size and rms(left) > UNSEEN * most:
            return False
    return True
