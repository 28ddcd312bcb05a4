# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise of inputs, where the model file states none."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from penode_gen import units
from penode_gen.model import Model

from ...recordings.measured import Measured
from ..search.worth import FINEST, SYSTEMATIC, Z_95
from .driven import experiment
from .fit import Problem
from .study import begin

Array = NDArray[np.float64]


def with_noise_of_inputs(model: Model, train: Sequence[Measured], set_name: str) -> tuple[Model, list[str]]:
    """Returns the model with the white noise that recorded inputs show and the file does not state, and a note on it; the model as it is if
    the sensors show that this noise drove the plant. A shaker's noise is a signal, that of a road sensor is not, and unless it is known, a
    lag of the input is named, which smooths it. Where the sensors do not show which it is, noise of more than SYSTEMATIC of any input is a
    signal, and less is noise: if it is not taken into account, the error that it makes in several sensors stays unexplained. Below FINEST
    of an input it is ignored."""
    shown = {i.name: noise for k, i in enumerate(model.inputs) if not i.noise and (noise := _shown(train, i.name, k))}
    if not shown:
        return model, []
    share, deviation = _drove(model, train, set_name, shown)
    doubt = Z_95 * deviation
    small = all(shown[i.name] < SYSTEMATIC * _size(train, k) for k, i in enumerate(model.inputs) if i.name in shown)
    measured = 1.0 - share
    if share + (-doubt if small else doubt) > measured:
        return model, []
    noisy = replace(model, inputs=tuple(replace(i, noise=shown.get(i.name, i.noise)) for i in model.inputs))
    found = ", ".join(f"{i.name} {shown[i.name]:.3g} {units.si(i.unit)}" for i in model.inputs if i.name in shown)
    sure = f"the sensors show {share:.0%} of it (+- {doubt:.0%}), so it did not drive the plant"
    unsure = "the sensors do not show whether it drove the plant"
    return noisy, [
        f"white noise in recorded inputs, of which the model file states none: {found}; {sure if share + doubt < measured else unsure}. "
        "State it: noise = ..."
    ]


def _drove(model: Model, train: Sequence[Measured], set_name: str, shown: Mapping[str, float]) -> tuple[float, float]:
    """Which share of the noise in the records of inputs drove the plant, as sensors show it, and its standard deviation: the regression of
    what they show beyond a simulation on what that noise does in one, both above the frequencies of the signal. What a model misses is
    slower, so it does not matter what is wrong with the model."""
    study = begin(model, [experiment(r, model, smooth=True) for r in train], set_name)
    free = study.null.free
    product = power = 0.0
    for r, e, z in zip(train, study.experiments, study.null.simulated, strict=True):
        high = _above(model, r, shown)
        if high is None:
            continue
        noisy = [high(u) if i.name in shown else 0.0 * u for i, u in zip(model.inputs, r.u.T, strict=True)]
        slow = experiment(replace(r, u=r.u - np.column_stack(noisy)), model, smooth=True)
        problem = Problem(model, [slow], study.metrics, set_name, study.linear.fastest)
        noise = z - problem.simulate(0, free, np.zeros((1, len(free))))[0][0]
        for j in np.flatnonzero(e.good.all(axis=0)):
            rest, own = high((e.y - z)[:, j]), high(noise[:, j])
            if own.any():
                product += float((rest + own) @ own) / float(np.var(rest))
                power += float(own @ own) / float(np.var(rest))
    return (product / power, power**-0.5) if power else (0.0, np.inf)


def _above(model: Model, m: Measured, shown: Mapping[str, float]) -> Callable[[Array], Array] | None:
    """A high-pass, without delay, of the lowest corner that lets pass little but noise of the inputs; None if there is none."""
    most = {name: np.sqrt(2.0) * noise for name, noise in shown.items()}
    found = None
    for corner in (0.5**k for k in range(1, 8)):  # of half the rate of samples
        taken = partial(sosfiltfilt, butter(4, corner, "high", output="sos"))
        if any(np.std(taken(u)) > most[i.name] for i, u in zip(model.inputs, m.u.T, strict=True) if i.name in most):
            break
        found = taken
    return found


def _shown(train: Sequence[Measured], name: str, k: int) -> float:
    """Standard deviation of the white noise of an input [SI]; 0 if the noise is small or not white, or if the input is held."""
    channels = [m.quality.channels.get(name) for m in train]
    if any(c is None or c.how == "held" or c.noise is None or c.noise.pole for c in channels):
        return 0.0
    noise = float(np.sqrt(np.mean([c.noise.std**2 for c in channels if c and c.noise])))
    return noise if noise > FINEST * _size(train, k) else 0.0


def _size(train: Sequence[Measured], k: int) -> float:
    """Standard deviation of an input in all recordings [SI]."""
    return float(np.std(np.concatenate([m.u[:, k] for m in train])))
