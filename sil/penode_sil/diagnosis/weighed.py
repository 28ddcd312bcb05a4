# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The diagnosis of recordings that a model misses by more than sensor noise: by innovations, see `evidence`."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from . import applied, measuring, numerics, real
from .catalogue import values as of_values
from .catalogue.drives import INPUTS
from .evidence.bench import UNSTATED, build
from .evidence.colour import shape
from .evidence.gain import Level
from .evidence.observer import Record, sample_noise
from .fit import Fit, Problem
from .judging import ENOUGH
from .noise import UNSEEN, Experiment
from .residual import Channel, rms
from .resolving import resolved
from .result import Cause, Gain, Named, Value
from .rounds import MIN_GAIN
from .study import Study, fitted, guessed, look
from .worth import WORTH

Array = NDArray[np.float64]
MIN_UNMODELLED = 0.0055  # of all forces, and worth MIN_GAIN: true causes leave less, 0.003 of the levels tried at most
UNMODELLED = 0.02  # size from which on a model is wrong everywhere; 0.01 may be that, or a curve that stands for another one


@dataclass(frozen=True)
class Misfit:
    """The unmodelled force that an explanation leaves beyond the noise of sensors: `size`, as a share of all forces; 0 if it may be chance,
    infinite if it follows the measurement worse than the model as it is: its curves hold along its own way alone, and bend away beside it.
    Beyond UNMODELLED innovations have to decide, without inputs at any size; else only a simpler answer of theirs counts. `likelihood`: log
    likelihood of its innovations, in steps of `update` samples; infinite where sensor noise is all that is left."""

    size: float = 0.0
    likelihood: float = np.inf
    update: int = 0


@dataclass(frozen=True, eq=False)
class Weighed:
    """What a diagnosis needs of it: the study with the motion that it has seen, causes, verdict, notes, explanations, text and model of the
    extended file, gain, hold-out, and the training as the extended model has it."""

    study: Study
    causes: tuple[Cause, ...]
    verdict: str
    notes: tuple[str, ...]
    explanations: tuple[dict[str, object], ...]
    text: str
    model: Model
    gain: dict[str, Gain]
    held: list[Channel]
    fit: Fit
    explained: float  # share taken of the residual in a free run, or of the power of the innovations, whichever is larger
    level: float  # the unmodelled force beside all that was found, as a share of all forces
    laws: int  # of all causes named
    numerics: dict[str, object]  # error of the deployed step; parameters that the file only guesses are at their fitted values
    likelihood: float  # log likelihood of the innovations with the named causes
    update: int  # samples for each innovation
    withheld: tuple[Cause, ...] = ()  # causes that are small, which the extended model has
    without: Callable[[Collection[tuple[str, str]]], Weighed] | None = None  # the same without laws or offsets, the rest fitted again

    @property
    def of_inputs(self) -> bool:
        """Do they explain it by inputs that are not what drove the plant? The search by sensor noise does not know of these."""
        return self.verdict == "explained" and any(c.kind in INPUTS for c in self.causes)

    def worsens(self) -> bool:
        """Does its model predict the hold-out worse than the file's, with a sensor?"""
        return any(g.worsened for g in self.gain.values())

    def mends(self) -> bool:
        """Does its model predict the hold-out better than the file's, with every sensor?"""
        return bool(self.gain) and all(g.after_rmse < g.before_rmse for g in self.gain.values())

    def follows_better(self, other: Misfit) -> bool:
        """Do its causes follow the recordings better than another explanation does?"""
        return self.verdict == "explained" and self.update == other.update and self.likelihood > other.likelihood


def supports(model: Model) -> bool:
    """Can innovations judge a model? Not yet where motion is prescribed, for nothing moves, nor laws of networks."""
    return bool(model.bodies or (model.states and not model.elements)) and not model.networks


@lru_cache(maxsize=2)  # the search asks, and the engine asks for the same again
def misfit(study: Study, fit: Fit, log: Callable[[str], None] = lambda text: None) -> Misfit:
    """The misfit of an explanation."""
    if not supports(study.model) or _is_noise(study, fit):
        return Misfit()
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
    log(
        f"unmodelled force beside it: {bench.level.size:.3g} of all forces, {gained:.0f} nats; "
        f"it follows better than the nominal model by {better:.0f}"
    )
    if better < -MIN_GAIN * len(nominal.free):
        return Misfit(np.inf, bench.fit.likelihood, bench.update)
    return Misfit(bench.level.size if gained > MIN_GAIN and bench.level.size > MIN_UNMODELLED else 0.0, bench.fit.likelihood, bench.update)


def _is_noise(study: Study, fit: Fit) -> bool:
    """Does an explanation leave of every sensor no more than its stated noise? Slow noise looks like an unmodelled force."""
    return _within(study, fit, np.array([s.noise for s in study.model.sensors]))


def _within(study: Study, fit: Fit, noise: Array) -> bool:
    """Does an explanation leave of every sensor no more than its noise [n_z]?"""
    for j, most in enumerate(noise):
        left = np.concatenate([(e.y - z)[e.good[:, j], j] for e, z in zip(study.experiments, fit.simulated, strict=True)])
        if left.size and rms(left) > UNSEEN * most:
            return False
    return True


def weigh(study: Study, unused: Sequence[Experiment], log: Callable[[str], None]) -> Weighed:
    """Causes by innovations, the model with them, and what it gains."""
    model, study = study.model, replace(study, seen=look(study, study.null))
    return _written(
        study, unused, real.answer(model, study.places, study.experiments, study.linear.fastest, study.set_name, log, study.levels)
    )


def _written(study: Study, unused: Sequence[Experiment], found: real.Answer) -> Weighed:
    """An answer in a model file, and what that is worth."""
    model, bench = study.model, found.found.bench
    made = applied.apply(model, bench, found.run, found.terms, found.offsets)
    text, extended = resolved(study, made.text)
    measured = _measured(study, bench.noise)
    gain, more, held = measuring.measure(measured, extended, unused) if unused else ({}, [], [])
    scale = np.array([s.noise or 1.0 for s in model.sensors])
    after = tuple(measuring.started(extended, e, study)[1] for e in study.experiments)
    fit = replace(study.null, simulated=after)
    left = max(
        rms((e.y - z)[e.good]) / max(rms(e.y[e.good] - np.mean(e.y[e.good])), 1e-300) for e, z in zip(study.experiments, after, strict=True)
    )
    powers = [
        sum(float(np.sum(((e.y - z) * e.good / scale) ** 2)) for e, z in zip(study.experiments, zs, strict=True))
        for zs in (study.null.simulated, after)
    ]
    causes, notes = _plausible(model, found.causes)
    known = replace(
        found.run, free=tuple(f for f in found.run.free if f.target in guessed(model))
    )  # the others may compensate for laws that were added
    numbers, coarse = numerics.numerics(replace(measured, model=fitted(model, known)))
    share = max(1.0 - powers[1] / powers[0], found.taken, 0.0)  # the first without what sensors and inputs are off by
    stated = np.array([s.noise for s in model.sensors])
    quiet = _within(study, fit, np.where(stated > 0.0, stated, bench.noise))
    verdict = _verdict(found, causes, share, max(left, bench.level.size), quiet)
    if coarse and verdict != "unexplained":
        causes, verdict = (*causes, coarse), "explained" if verdict == "no_discrepancy" else verdict
    explanations = _explanations(causes, found.explanations)
    notes = (*notes, *found.notes, *made.left, *more)
    laws = sum(max(len(x.form.parts), 1) for a in found.found.named for x in a.terms)
    likelihood = found.found.plain.fit.likelihood
    return Weighed(
        measured,
        causes,
        verdict,
        notes,
        explanations,
        text,
        extended,
        gain,
        held,
        fit,
        share,
        bench.level.size,
        laws,
        numbers,
        likelihood,
        bench.update,
        found.withheld,
        lambda gone: _written(study, unused, found.without(gone)),
    )


def _measured(study: Study, noise: Array) -> Study:
    """The study with no more noise than samples have [n_z]: that of its null fit has in it what the model misses."""
    levels = tuple(np.tile(noise**2, (len(x), 1)) for x in study.levels)
    experiments = tuple(replace(e, quiet=np.full_like(e.quiet, np.nan)) for e in study.experiments)
    return replace(study, levels=levels, experiments=experiments)


def _explanations(causes: Sequence[Cause], sets: Sequence[tuple[tuple[Named, ...], float]]) -> tuple[dict[str, object], ...]:
    """Sets of causes with their posterior, each with all causes that are named beside those that the sets exchange."""
    first = sets[0][0] if sets else ()
    named = [Named(c.kind, c.where) for c in causes]
    always = [n for n in named if n not in first]
    if not named:
        return ()
    found = []
    for names, posterior in sets or [((), min(c.confidence for c in causes))]:
        whole = [*always, *(n for n in names if n in named or n not in first)]
        found.append({"causes": [{"kind": n.kind, "where": n.where} for n in whole], "posterior": posterior})
    return tuple(found)


def _verdict(found: real.Answer, causes: tuple[Cause, ...], share: float, left: float, quiet: bool) -> str:
    """From what is named, the share of the residual that it takes in a free run, and what is left: the residual with all that was found as
    a share of the signal, or the unmodelled force as a share of all forces. Any model has small deviations, also those that were found;
    `quiet`: noise is all that is left."""
    if causes:
        return "explained" if share > ENOUGH else "partly_explained"
    return "no_discrepancy" if not found.causes and (quiet or (left < WORTH and found.terms)) else "unexplained"


def _plausible(model: Model, causes: tuple[Cause, ...]) -> tuple[tuple[Cause, ...], list[str]]:
    """Causes, none where several parameters have left tolerances that the file states: that is another plant, and what else was found is
    of that; and a note on it. All by one factor, they are the gain of an input that the file does not have."""
    off = [c for c in causes if of_values.is_one(c) and model.parameters[c.where].tolerance <= 1.0]
    if len(off) < 2:
        return causes, []
    if gain := _gain(model, off):
        names = ", ".join(c.where for c in off)
        return (gain, *(c for c in causes if c not in off)), [
            f"{names} changed by a common factor have the same effect; model_extended.toml has that form"
        ]
    stated = [c.where for c in off if model.parameters[c.where].tolerance > 0.0]
    if len(stated) < 2:
        return causes, []
    return (), [f"{', '.join(stated)} would all have to be outside of their tolerances: another plant, or dynamics that the model lacks"]


def _gain(model: Model, off: Sequence[Cause]) -> Cause | None:
    """The gain of the only input, a force, that does what parameters do together: with all masses among them, by one factor, beside which
    each is within its tolerance. A sensor of motion shows forces over masses only."""
    forces = [i for i in model.inputs if units.si(i.unit) in ("N", "N*m")]
    if len(model.inputs) != 1 or not forces or not {b.mass for b in model.bodies} <= {c.where for c in off}:
        return None
    values = [(c.parameters[c.where], model.parameters[c.where]) for c in off]
    low, high = (np.array([v.ci95[k] / p.value for v, p in values]) for k in (0, 1))
    weights = 1.0 / np.maximum(high - low, 1e-300) ** 2
    factor = float(np.sum(weights * 0.5 * (low + high)) / np.sum(weights))
    if factor <= 0.0 or any(abs(v.value / p.value / factor - 1.0) > (p.tolerance or UNSTATED) for v, p in values):
        return None
    gain = Value(1.0 / factor, "1", (1.0 / float(np.max(high)), 1.0 / float(np.min(low))))  # what a model leaves out moves each another way
    others = tuple(Named(c.kind, c.where) for c in off[:3])
    return Cause("input_gain", forces[0].name, {"gain": gain}, min(c.confidence for c in off), others)
