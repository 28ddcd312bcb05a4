# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What an extended model gains on other data than it was fitted to, with the generated C."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from ...targets import Sil
from ..checks.dropouts import bursts
from ..evidence.blocks import DRAWS
from ..plant import stepped
from ..plant.compiling import moving
from ..result import Gain
from ..study.fit import Free, Problem
from ..study.noise import Experiment, metric
from ..study.residual import Channel, channels, noise_floor, noise_rms
from ..study.restoring import rms
from ..study.smoother import size
from ..study.study import Study, watched, widened
from .beginning import begins_at_rest, start_of

Array = NDArray[np.float64]
SPREAD = {"1": 0.5, "m": 0.01, "m/s": 0.05, "N": 1e-3, "s": 1e-3, "rad": 0.01, "rad/s": 0.05, "N*m": 1e-3}  # of start states of laws


def started(model: Model, e: Experiment, study: Study) -> tuple[Array, Array]:
    """The start state with which a model fits a recording best, all else given, and the sensors [n, n_z] it then predicts."""
    metrics = [metric(e, study.levels[0][:1].repeat(e.band, 0), np.zeros((e.band, len(model.sensors), len(model.inputs))))]
    problem = Problem(model, [e], metrics, study.set_name, study.linear.fastest)
    spread = [1.0] * (2 * len(model.bodies)) + [SPREAD.get(s.unit, 1.0) for s in model.extra_states]
    free = tuple(Free(("start", 0, i), x, 1e-3, sigma=s) for i, (x, s) in enumerate(zip(start_of(model, e, study), spread, strict=True)))
    fit = problem.solve(free)
    return np.array([f.value for f in fit.free]), fit.simulated[0]


def deployed(model: Model, e: Experiment, start: Array, set_name: str) -> Array:
    """Sensors [n, n_z] of the generated C (float) driven by the recorded inputs from a start state."""

    def simulate(one: Model) -> Array:
        instance = Sil(one).instance(set_name)
        if len(start):
            instance.set_state(start)
        return instance.run(e.u).z.astype(float)

    z = stepped.run(model, e, simulate)
    if moving(model):
        z[0] = 2.0 * z[1] - z[2]  # the step knows no rate of an input at its first sample
    return z


def measure(
    study: Study, extended: Model, holdout: Sequence[Experiment], set_name: str = "", lost: Collection[str] = ()
) -> tuple[dict[str, Gain], list[str], list[Channel]]:
    """Errors before and after on held-out recordings, with the generated C; which share of them lies outside of the range of
    the training, where a right name does not determine the size; and all of it sample by sample. Sensors `lost` have dropouts, which do not
    count. `set_name`: parameter set of the extended model, if it is another one."""
    model = study.model
    shown: list[Channel] = []
    floors = noise_floor(study, 0)
    limits = [1.02 * x for k in range(len(study.places)) for x in size([m.motions[k] for m in study.seen])]
    outside, notes = [], []
    for e in holdout:
        both = (study, replace(study, set_name=set_name or study.set_name))
        rest = begins_at_rest(extended, e, study, both[1].set_name)
        starts = [start_of(m, e, study, s.set_name, rest) for m, s in zip((model, extended), both, strict=True)]
        before, after = (deployed(m, e, x, s.set_name) for m, x, s in zip((model, extended), starts, both, strict=True))
        dropped = bursts([e], [after])[0] & [s.name in lost for s in model.sensors]
        e = replace(e, good=e.good & ~dropped)
        paths = followed(extended, e, starts[1], both[1])
        beyond = np.any(np.abs(paths) > np.array(limits), axis=1)
        outside.append(beyond)
        if beyond.any():
            many = f"{np.mean(beyond):.1%} of the samples move farther or faster than in training"
            notes.append(f"{e.name}: {many}; there the gain is extrapolated")
        shown += channels(e, model, before, after, floors, beyond)
    noise = noise_rms(study)
    gains = {}
    for j, s in enumerate(model.sensors):
        own = [c for c in shown if c.sensor == s.name]
        if not own:
            continue
        floor = float(noise[j])
        nominal, improved = (
            np.concatenate([r.values[c.good] for c, r in zip(own, each, strict=True)])
            for each in ([c.before for c in own], [c.after for c in own if c.after])
        )
        share, ci95 = achieved(nominal, improved, floor)
        beyond = float(np.mean(np.concatenate(outside)))
        gains[s.name] = Gain(rms(nominal), rms(improved), floor, share, units.si(s.unit), beyond, ci95)
    return gains, notes, shown


BLOCKS = 40  # of the held-out samples for the bootstrap: errors close in time are correlated


def achieved(before: Array, after: Array, floor: float) -> tuple[float | None, tuple[float, float] | None]:
    """Share of the achievable gain in RMS [errors before and after, n each], and its 95 % interval by a block bootstrap; None
    where there is hardly anything to gain; all of it where the error after is below the floor."""
    power = np.array([[np.mean(b**2) for b in np.array_split(x, min(BLOCKS, len(x)))] for x in (before, after)])
    draws = np.random.default_rng(0).integers(power.shape[1], size=(DRAWS, power.shape[1]))
    b, a = np.sqrt(power[:, draws].mean(axis=2))
    room = rms(before) - floor
    if not room > 0.05 * floor:
        return None, None
    shares = (b - a) / np.maximum(b - floor, 0.01 * floor)
    low, high = np.minimum(np.quantile(shares, (0.025, 0.975)), 1.0)
    return min((rms(before) - rms(after)) / room, 1.0), (float(low), float(high))


def followed(model: Model, e: Experiment, start: Array, study: Study) -> Array:
    """Deflection and rate [n, 2 places] of all places in a simulation."""
    wide = widened(e, 2 * len(study.places))
    problem = Problem(watched(model, study.places), [wide], study.metrics[:1], study.set_name, study.linear.fastest)
    free = tuple(Free(("start", 0, i), x, 1.0) for i, x in enumerate(start))
    return np.array(problem.simulate(0, free, np.zeros((1, len(free))))[0][0][:, len(model.sensors) :])
