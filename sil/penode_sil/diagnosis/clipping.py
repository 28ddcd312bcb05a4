# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A sensor that saturates before its noise is added: no two samples show the same limit, so only the motion reveals it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model, Parameter

from .catalogue.form import Form
from .evidence.bench import FAR, Bench
from .evidence.fit import likelihood
from .evidence.screening import Score, as_they_are
from .fit import Free

Array = NDArray[np.float64]
KIND = "sensor_clipping"
SHARES = (0.98, 0.94, 0.88, 0.8, 0.7)  # quantiles of abs(y) that are tried as limits


def propose(bench: Bench, index: int, seen: Sequence[Array]) -> tuple[Score, Form] | None:
    """The limit that gains most for a sensor; None for one that was not measured, or hardly moves. A free run, `seen` [n, n_z] for each
    recording, replaces the signal that is not cut off; the part beyond a limit is the change of the innovations. Before any
    form is accepted, and if the largest 2 % of the samples agree within three standard deviations of noise, limits are also tried with the
    nominal parameters."""
    y = np.abs(np.concatenate([r.y[:, index] for r in bench.records]))
    y = y[np.isfinite(y)]
    limits = [float(x) for x in np.quantile(y, SHARES) if x > 0.0] if y.size else []
    if not limits:
        return None
    changes = []
    for limit in limits:
        change = np.zeros_like(bench.fit.nu)
        change[:, index] = _means(bench.update, [z[:, index] - np.clip(z[:, index], -limit, limit) for z in seen])
        changes.append(change)
    gains = [s.gain for s in as_they_are(bench.fit, changes)]
    if len(bench.nominal) == len(bench.fit.free) and np.quantile(y, 0.998) - np.quantile(y, SHARES[0]) < 3.0 * bench.noise[index]:
        gains = [max(pair) for pair in zip(gains, _gains_of_nominal(bench, index, limits), strict=True)]
    best = int(np.argmax(gains))
    return Score(gains[best], np.ones(1)), Form(KIND, bench.model.sensors[index].name, "clip", index, limit=limits[best])


def _gains_of_nominal(bench: Bench, index: int, limits: Sequence[float]) -> list[float]:
    """Log likelihood gained by each limit of a sensor with nominal parameters: those fitted to clipped data give too little motion."""
    form = Form(KIND, bench.model.sensors[index].name, "clip", index, limit=limits[0])
    model, limit = limited(bench.model, form, "x0_0_limit")
    problem, free = bench.problem(model), (*bench.nominal, limit)
    shifts = np.zeros((len(limits), len(free)))
    shifts[:, -1] = np.log(np.array(limits) / limits[0])
    nu = problem.nu(free, shifts, bench.fit.by)
    return [likelihood(n, np.isfinite(n), problem.floor)[1] - bench.fit.likelihood for n in nu]


def limited(model: Model, form: Form, name: str) -> tuple[Model, Free]:
    """The model with a limit of a sensor, as a parameter `name` so large that it has no effect, and the free value for it."""
    s = model.sensors[form.index]
    cut = replace(s, expression=f"min(max({s.expression}, -{name}), {name})")
    sensors = (*model.sensors[: form.index], cut, *model.sensors[form.index + 1 :])
    parameters = {**model.parameters, name: Parameter(name, FAR**2 * form.limit, s.unit)}
    free = Free(name, form.limit, form.limit, log=True, sigma=1.0, origin=form.limit)
    return replace(model, parameters=parameters, sensors=sensors), free


def share(bench: Bench, form: Form, limit: Free) -> float:
    """What a limit cuts off, as a share of the signal."""
    whole = tuple(replace(f, value=FAR**2 * f.value) if f.target == limit.target else f for f in bench.fit.free)
    z = np.concatenate([x[:, form.index] for x in bench.problem().predictor.sensors(whole)])
    return float(np.sqrt(np.mean((z - np.clip(z, -limit.value, limit.value)) ** 2)) / max(np.std(z), 1e-300))


def _means(update: int, signals: Sequence[Array]) -> Array:
    """Means of signals [n] over the samples of each update, [updates], all recordings in turn."""
    return np.concatenate([x[: len(x) // update * update].reshape(-1, update).mean(axis=1) for x in signals])
