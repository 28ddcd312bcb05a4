# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The state of a diagnosis: a model against its recordings, with noise, places, and values that are free within tolerance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model, Parameter, Signal

from ..evidence.prior import SHARE
from ..plant import plant
from ..plant.plant import KEPT, Linear, Place
from .fit import Fit, Free, Problem
from .noise import Experiment, Metric, metric, sensor_levels
from .smoother import Seen, smooth

Array = NDArray[np.float64]
SKEW = 0.001  # of a sample: channels are never sampled at exactly the same time
LIMIT = 1.5  # tolerances: farther than that a parameter is wrong, which is a cause
GUESSED_TOLERANCE = 0.5  # tolerance above which a parameter counts as a guess: it may change the behaviour of the plant entirely


@dataclass(frozen=True, eq=False)
class Study:
    """Everything that does not depend on a hypothesis."""

    model: Model
    set_name: str
    experiments: tuple[Experiment, ...]
    places: tuple[Place, ...]
    linear: Linear
    levels: tuple[Array, ...]
    metrics: tuple[Metric, ...]
    null: Fit
    seen: tuple[Seen, ...] = ()
    moving: bool = True  # start states are free


def guessed(model: Model) -> list[str]:
    """Parameters that are only guesses."""
    return [name for name, p in model.parameters.items() if p.tolerance > GUESSED_TOLERANCE]


def uncertain(p: Parameter, guessed: float = 1e3) -> Free:
    """A parameter within its tolerance. One that is only guessed (above 100 %), or unknown, keeps its sign and moves by ratios; an unknown
    one is at most `guessed` times as large or small as the file has it."""
    size, most = abs(p.value), LIMIT * p.tolerance
    if p.tolerance <= 1.0:
        sigma, far = size * p.tolerance * SHARE, size * most
        return Free(p.name, p.value, sigma, sigma=sigma, origin=p.value, low=p.value - far, high=p.value + far)
    known = np.isfinite(most)
    ends = sorted((p.value / (guessed if not known else 1.0 + most), p.value * (guessed if not known else 1.0 + most)))
    sigma = size * p.tolerance * SHARE if known else np.inf
    return Free(p.name, p.value, size, log=True, sigma=sigma, origin=p.value, low=ends[0], high=ends[1])


def nuisances(model: Model, experiments: Sequence[Experiment]) -> tuple[Free, ...]:
    """Parameters within tolerance and all start states."""
    free = [uncertain(p) for p in model.parameters.values() if p.tolerance > 0.0 and p.value != 0.0]
    skew = SKEW * model.sample_time
    free += [Free(("skew", j), 0.0, skew, sigma=skew, low=-3.0 * skew, high=3.0 * skew) for j in range(len(model.sensors))]
    for e in range(len(experiments)):
        for i, start in enumerate(model.start):
            unit = 1e-3 if i < len(model.bodies) else 1e-2 if i < 2 * len(model.bodies) else 1.0
            free.append(Free(("start", e, i), start, unit))
    return tuple(free)


def watched(model: Model, found: Sequence[Place]) -> Model:
    """The model with deflection and rate of every place as further sensors."""
    ends = {b.name: (b.position, b.velocity) for b in model.bodies}
    signals = []
    for k, p in enumerate(found):
        texts = (f"s_{p.elements[0][0]}", f"v_{p.elements[0][0]}") if p.elements else ends[p.ends[0]]
        signals += [Signal(f"{q}_place{k}", text, p.unit(unit)) for q, text, unit in zip("sv", texts, ("m", "m/s"), strict=True)]
    return replace(model, sensors=(*model.sensors, *signals))


MOVING = 10.0  # chi2 that a free start state must gain: recordings start at rest unless they show the contrary


def begin(model: Model, experiments: Sequence[Experiment], set_name: str = "default") -> Study:
    """The study with start states as they are likely: at rest, or free."""
    free = null_study(model, experiments, set_name)
    rest = replace(free, null=refit(free, [f for f in free.null.free if f.target[0] != "start"]), moving=False)
    freedom = MOVING * len(model.states) * len(experiments)
    return rest if rest.null.cost <= free.null.cost + freedom else free


def refit(study: Study, free: Sequence[Free]) -> Fit:
    """The null fit with other nuisances."""
    return Problem(study.model, study.experiments, study.metrics, study.set_name, study.linear.fastest).solve(free)


def null_study(model: Model, experiments: Sequence[Experiment], set_name: str = "default") -> Study:
    """Null fit: nothing but tolerances, start states and noise."""
    experiments = tuple(experiments)
    found = plant.places(model, set_name)
    declared = np.array([s.noise for s in model.sensors])
    free = nuisances(model, experiments)
    guess = [np.where(declared > 0.0, declared, 1e-2 * np.std(e.y, axis=0) + 1e-12) for e in experiments]
    levels = [np.tile(sigma**2, (e.band, 1)) for sigma, e in zip(guess, experiments, strict=True)]
    metrics = [metric(e, x, np.zeros((e.band, len(declared), len(model.inputs)))) for e, x in zip(experiments, levels, strict=True)]
    problem = Problem(model, experiments, metrics, set_name, 0.0)
    _z, x = problem.simulate(0, (), np.zeros((1, 0)), model.states)
    pick = np.linspace(0, len(x[0]) - 1, 12).astype(int) if model.networks else [0]
    linear = plant.linearise(model, found, np.array(x[0][pick]), experiments[0].u[pick])
    for _ in range(2):
        fit = problem.solve(free, 6, 0.5)
        for e, experiment in enumerate(experiments):
            h = linear.transfer(experiment.frequencies)[:, : len(declared), : len(model.inputs)]
            residual = np.where(experiment.good, experiment.y - fit.simulated[e], 0.0)
            levels[e] = sensor_levels(experiment, residual, declared, h)
            metrics[e] = metric(experiment, levels[e], h)
        problem = Problem(model, experiments, metrics, set_name)
        free = fit.free
        if guessed(model):  # what the file says is no point to linearise about
            linear = plant.linearise(fitted(model, fit.free), found, np.array(x[0][pick]), experiments[0].u[pick])
    fit = problem.solve(free)
    return Study(model, set_name, experiments, found, linear, tuple(levels), tuple(metrics), fit)


def fitted(model: Model, free: Sequence[Free]) -> Model:
    """The model with the parameters as they are fitted."""
    values = {f.target: f.value for f in free if isinstance(f.target, str)}
    changed = {name: replace(p, value=values[name]) for name, p in model.parameters.items() if name in values}
    return replace(model, parameters={**model.parameters, **changed})


def _metrics_of(study: Study, fit: Fit) -> list[Metric]:
    """Metrics of the noise as the residual of a fit shows it, see sensor_levels."""
    declared = np.array([s.noise for s in study.model.sensors])
    metrics = []
    for e, z in zip(study.experiments, fit.simulated, strict=True):
        h = study.linear.transfer(e.frequencies)[:, : len(declared), : len(study.model.inputs)]
        metrics.append(metric(e, sensor_levels(e, np.where(e.good, e.y - z, 0.0), declared, h, robust=False), h))
    return metrics


def loss(study: Study, fit: Fit) -> float:
    """-2 log likelihood of a fit with the noise that suits it best: what absorbs less into noise is worth more."""
    total = sum(f.offset**2 for f in fit.free)
    for e, m, z in zip(study.experiments, _metrics_of(study, fit), fit.simulated, strict=True):
        r = m(np.where(e.good, e.y - z, 0.0))
        total += float(r @ r) + m.volume
    return total


def watch(study: Study, fit: Fit) -> list[Array]:
    """Sensors, then deflection and rate of every place, as a fit simulates them: [n, n_z + 2 places] per recording."""
    more = 2 * len(study.places)
    wide = [widened(e, more) for e in study.experiments]
    problem = Problem(watched(fit.model, study.places), wide, study.metrics, study.set_name)
    start = np.zeros((1, len(fit.free)))
    return [np.array(problem.simulate(e, fit.free, start)[0][0]) for e in range(len(study.experiments))]


def look(study: Study, fit: Fit) -> tuple[Seen, ...]:
    """The smoothed motion around a fit."""
    n_z = len(study.model.sensors)
    parts = zip(study.experiments, study.metrics, study.levels, watch(study, fit), strict=True)
    return tuple(smooth(e, m, x, study.linear, study.places, z[:, :n_z], z[:, n_z:]) for e, m, x, z in parts)


@lru_cache(maxsize=KEPT)
def widened(e: Experiment, more: int) -> Experiment:
    """The experiment for a model with more sensors than were measured."""
    n = len(e.time)
    return replace(e, y=np.hstack([e.y, np.zeros((n, more))]), good=np.hstack([e.good, np.zeros((n, more), bool)]))
