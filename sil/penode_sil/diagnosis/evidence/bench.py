# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model on its recordings before any hypothesis: corrections, free values, forces, and the unmodelled one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model, Parameter

from ..plant.plant import Place
from ..study.fit import Free
from .colour import Colour, is_white
from .fit import Fit, Problem, likelihood
from .gain import Gains, Level, driven_by_noise, linear
from .observer import MAX_TURN, MIN_STEPS, Filter, Predictor, Record, augmented, bias, scale
from .prior import SHARE, Stated

Array = NDArray[np.float64]
UPDATES = 16  # a period of the motion
UNSTATED = 0.05  # tolerance of a parameter for which the file has none
FAR = 1e3  # factor off the file's value, or off the expected motion, beyond which nothing is believed
SIZES = (0.0, 1e-4, 3e-4, 1e-3, 3e-3, 0.01, 0.03, 0.1, 0.3)  # unmodelled force, relative to all forces: levels that are tried
CORRELATION = 0.5  # updates for which it stays: about white. One that stays longer winds up against a friction that sticks
AGAIN = 6  # iterations with another level
TURNS = 3  # how often levels and values are fitted in turn


@dataclass(frozen=True, eq=False)
class Bench:
    """An augmented model, its recordings and what is known of both: `forces` [unmodelled] rms acceleration of each body (without bodies,
    rms rate of each state), `noise` [n_z] of a sample."""

    model: Model
    set_name: str
    places: tuple[Place, ...]
    records: tuple[Record, ...]
    base: Model  # of which the filter is: the nominal one, augmented, without laws that are steep where it stands still
    free: tuple[Free, ...]
    update: int
    forces: Array
    noise: Array
    fastest: float
    level: Level
    fit: Fit
    nominal: tuple[Free, ...] = ()  # free values as the model file has them
    linear: Mapping[str, float] = field(default_factory=dict)  # values fitted to the model alone; empty before that fit
    colour: Colour | None = None  # of the noise; None: white

    @property
    def step(self) -> float:
        return self.records[0].step

    def problem(self, model: Model | None = None) -> Problem:
        """Fits of this model, or of one with more in it."""
        predictor = Predictor(model or self.model, self.records, self.update, self.set_name, self.fastest)
        return Problem(predictor, self.colour or Colour.none(self.noise, self.update))

    def gains(self, fit: Fit | None = None, model: Model | None = None) -> Gains:
        """The linearised plant with the values that a fit of the model alone found, scales of sensors left at 1 (see Predictor._scales). It
        stays the same when forms are added: the best line along the motion (Booton, IRE Trans. Circuit Theory 1, 1954), so that forms
        that do the same are compared under one filter."""
        model = model or self.model
        scales = {scale(s.name) for s in self.model.sensors}
        values = {name: x for name, x in (self.linear or ({} if fit is None else fit.values)).items() if name not in scales}
        noise = np.array([i.noise for i in self.base.inputs])
        return Gains(
            self.base.states, model.states, linear(self.base, values), noise, self.forces, self.noise, self.update * self.step, self.update
        )


def parameter(p: Parameter) -> Free | None:
    """A parameter with its prior; None for one that is known. It keeps its sign: a mass, a stiffness, a damping below zero is none."""
    if p.exact or p.value == 0.0:
        return None
    size = abs(p.value)
    if p.tolerance <= 1.0:
        sigma = size * (p.tolerance or UNSTATED) * SHARE
        low, high = (0.0, np.inf) if p.value > 0.0 else (-np.inf, 0.0)
        return Stated(p.name, p.value, sigma, sigma=sigma, origin=p.value, low=low, high=high)
    sigma = np.log1p(p.tolerance) * SHARE  # infinite for one that is unknown
    ends = sorted((p.value / FAR, p.value * FAR))
    return Free(p.name, p.value, size, log=True, sigma=sigma, origin=p.value, low=ends[0], high=ends[1])


def with_tolerances(model: Model) -> Model:
    """The model with a tolerance of each parameter: where its file states none and does not call it exact, UNSTATED."""
    known = {n: p if p.exact or p.tolerance or not p.value else replace(p, tolerance=UNSTATED) for n, p in model.parameters.items()}
    return replace(model, parameters=known)


def build(
    model: Model,
    places: Sequence[Place],
    records: Sequence[Record],
    noise: Array,
    fastest: float,
    set_name: str = "default",
    shape: Array | None = None,
) -> Bench:
    """The bench of a plain model: `noise` [n_z] of its sensors, `fastest` natural frequency [Hz]. `shape` [f, n_z]: spectrum of
    the noise as a fit has left it; it counts if the recordings are likelier with it."""
    wide = augmented(model)
    free = [f for f in map(parameter, model.parameters.values()) if f]
    spans = np.array([max(np.nanstd(np.concatenate([r.y[:, j] for r in records])), noise[j]) for j in range(len(noise))])
    means = np.array(
        [
            max(abs(np.nanmean(r.y[:, j])) for r in records) if any(np.isfinite(r.y[:, j]).any() for r in records) else 0.0
            for j in range(len(noise))
        ]
    )
    for s, span, mean in zip(model.sensors, spans, means, strict=True):
        free.append(Free(bias(s.name), 0.0, span, sigma=span + mean))
    plain = Fit((), Filter.none(0, 0), *(np.zeros(0),) * 2, np.zeros(0, bool), np.zeros(0), 0.0, 0.0)
    longest = sum(map(len, records)) * records[0].step
    first = int(np.clip(round(1.0 / (UPDATES * max(fastest, 2.0 / longest)) / records[0].step), 1, 200))
    forces = np.ones(len(driven_by_noise(wide.states)))
    bench = Bench(
        wide, set_name, tuple(places), tuple(records), augmented(model), (), first, forces, noise, fastest, Level(0.0, 1.0), plain
    )
    bench, x = _moved(bench, model, spans)
    starts = []
    for e, states in enumerate(x):
        for i, start in enumerate(model.start):
            size = max(float(np.std(states[:, i])), 1e-9)
            starts.append(
                Free(
                    ("start", e, i),
                    float(states[0, i]),
                    0.1 * size,
                    sigma=3.0 * size + 3.0 * abs(float(np.mean(states[:, i]))),
                    origin=start,
                )
            )
    found = fit_null(replace(bench, free=(*free, *starts), nominal=(*free, *starts)))
    if shape is None or is_white(shape):
        return found
    colour = Colour.of(shape, noise, bench.update, UPDATES // 2)
    other = fit_null(replace(bench, free=(*free, *starts), nominal=(*free, *starts), colour=colour))
    return max(found, other, key=lambda b: b.fit.cost)


def _moved(bench: Bench, model: Model, spans: Array) -> tuple[Bench, list[Array]]:
    """The bench with the update and the forces that its motion asks for, and the states [n, n_x] that follow the measurement."""
    n_q, fastest = len(model.bodies), bench.fastest
    x: list[Array] = []
    followed: tuple[Bench, list[Array]] | None = None
    for again in range(3):
        scale = bench.forces if again else _guess(bench, model, spans)
        x = _followed(replace(bench, forces=scale))
        if not n_q and not bench.places:
            rates = np.concatenate([np.gradient(smooth(s, bench.update), bench.step, axis=0) for s in x])
            moving = np.sqrt(np.mean(rates**2, axis=0))
            if not np.isfinite(moving).all():  # it does not follow: what was guessed has to do
                return replace(bench, forces=scale), [np.where(np.abs(s) < np.inf, s, 0.0) for s in x]
            bench = replace(bench, forces=np.maximum(moving, 1e-12))
            continue
        if not n_q:
            return replace(bench, update=_update(bench, _period([r.u for r in bench.records], bench))), x
        rates = np.concatenate([s[:, n_q : 2 * n_q] for s in x])
        slopes = np.concatenate([np.gradient(smooth(s[:, n_q : 2 * n_q], bench.update), bench.step, axis=0) for s in x])
        v, a = (np.sqrt(np.mean(r**2, axis=0)) for r in (rates, slopes))
        if not (np.isfinite(v).all() and np.all(a < FAR * scale)):  # it does not follow: what did, or was guessed, has to do
            return followed or (replace(bench, forces=scale), [np.where(np.abs(s) < np.inf, s, 0.0) for s in x])
        followed = replace(bench, forces=scale), x
        period = float(np.min(2.0 * np.pi * v / np.maximum(a, 1e-300)))
        bench = replace(
            bench, forces=np.maximum(a, 1e-12), update=_update(bench, period), fastest=max(fastest, MAX_TURN * UPDATES * MIN_STEPS / period)
        )
    return bench, x


def _period(signals: Sequence[Array], bench: Bench) -> float:
    """The shortest period [s] of signals [n, .] per recording, by their rms and that of their rates."""
    rates = np.concatenate([np.gradient(smooth(s, 1), bench.step, axis=0) for s in signals])
    moving = np.std(np.concatenate(signals), axis=0)
    return float(np.min(2.0 * np.pi * moving / np.maximum(np.sqrt(np.mean(rates**2, axis=0)), 1e-300)))


def _update(bench: Bench, period: float) -> int:
    """Samples between corrections, for a motion of this period [s]."""
    return int(np.clip(round(period / UPDATES / bench.step), 1, max(len(r) for r in bench.records) // 40 or 1))


def _followed(bench: Bench) -> list[Array]:
    """States [n, n_x] of every recording, corrected as if all forces were unmodelled."""
    by = bench.gains().at(Level(1.0, 2.0 * bench.update * bench.step))
    return [np.array(m[0]) for m in bench.problem().predictor.predict((), np.zeros((1, 0)), by, states=bench.model.states)[2]]


def _guess(bench: Bench, model: Model, spans: Array) -> Array:
    """Forces that would move the sensors about as much as they do."""
    if not model.bodies:
        return np.full(len(bench.forces), float(np.max(spans)) / (UPDATES * bench.update * bench.step))
    gains = bench.gains()
    noisy, step = driven_by_noise(gains.names), gains.period
    reach = np.abs(gains.plant.c @ np.linalg.matrix_power(np.eye(len(gains.plant.a)) + gains.plant.a * step, 3)[:, noisy])
    return np.array([float(np.min(spans / np.maximum(reach[:, k], 1e-300))) for k in range(len(noisy))])


def smooth(x: Array, width: int) -> Array:
    """Means over about `width` samples on either side, of signals [n, .]."""
    total = np.cumsum(np.vstack([np.zeros((1, x.shape[1])), x]), axis=0)
    low, high = (np.clip(np.arange(len(x)) + side, 0, len(x)) for side in (-width, width + 1))
    means: Array = (total[high] - total[low]) / (high - low)[:, None]
    return means


def fit_null(bench: Bench) -> Bench:
    """The bench with its free values fitted, first as a free run, then in turn with the level of the unmodelled forces."""
    problem = bench.problem()
    n_x = len(bench.model.states)
    fit = problem.solve(bench.free, Filter.none(n_x, len(bench.noise)), 12)
    level = Level(0.0, 1.0)
    for _ in range(TURNS):
        level, fit = fit_level(bench, problem, fit, level)
    return replace(bench, free=fit.free, level=level, fit=fit, linear=fit.values)


def fit_level(bench: Bench, problem: Problem, fit: Fit, level: Level) -> tuple[Level, Fit]:
    """The likeliest level, and the values fitted with it, from those of a fit."""
    gains = bench.gains(fit, problem.predictor.model)
    period = gains.period
    tried = [level] + [Level(size, CORRELATION * period) for size in SIZES]
    filters = [gains.at(some) for some in tried]
    nu = problem.nu(fit.free, np.zeros((len(tried), len(fit.free))), Filter.many(filters))
    worth = [likelihood(n, np.isfinite(n), problem.floor)[1] for n in nu]
    best = int(np.argmax(worth))
    again = tried[best], problem.solve(fit.free, filters[best], AGAIN)
    return max((level, fit), again, key=lambda f: f[1].cost)
