# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A sensor that is cut off beyond a limit, in front of what adds its noise: no sample repeats the limit, so only the motion shows it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from penode_gen.model import Model, Parameter

from .catalogue.form import Form
from .evidence.bench import FAR, Bench
from .evidence.screening import Score, as_they_are
from .fit import Free

Array = NDArray[np.float64]
KIND = "sensor_clipping"
SHARES = (0.98, 0.94, 0.88, 0.8, 0.7)  # of the samples, that lie within a limit: those that are tried


def propose(bench: Bench, index: int) -> tuple[Score, Form]:
    """The limit of a sensor that promises most. Beside a free run, which no sample that is cut off corrects, it changes an innovation by what it
    cuts off."""
    sensor, y = bench.model.sensors[index], np.concatenate([r.y[:, index] for r in bench.records])
    sizes = np.abs(y[np.isfinite(y)])
    limits = [float(np.quantile(sizes, share)) for share in SHARES]
    seen = bench.problem().predictor.sensors(bench.fit.free)
    changes = []
    for limit in limits:
        change = np.zeros_like(bench.fit.nu)
        change[:, index] = _means(bench, [z[:, index] - np.clip(z[:, index], -limit, limit) for z in seen], index)
        changes.append(change)
    tried = as_they_are(bench.fit, changes)
    best = int(np.argmax([s.gain for s in tried]))
    return tried[best], Form(KIND, sensor.name, "clip", index, limit=limits[best])


def limited(model: Model, form: Form, name: str) -> tuple[Model, Free]:
    """The model with a limit of a sensor, as a parameter of that name, that nothing reaches yet; and the value of it."""
    s = model.sensors[form.index]
    cut = replace(s, expression=f"min(max({s.expression}, -{name}), {name})")
    sensors = (*model.sensors[: form.index], cut, *model.sensors[form.index + 1 :])
    parameters = {**model.parameters, name: Parameter(name, FAR * form.limit, s.unit)}
    free = Free(name, form.limit, form.limit, log=True, sigma=1.0, origin=form.limit)
    return replace(model, parameters=parameters, sensors=sensors), free


def share(bench: Bench, form: Form, limit: Free) -> float:
    """What a limit cuts off, as a share of what the sensor shows."""
    whole = tuple(replace(f, value=FAR * f.value) if f.target == limit.target else f for f in bench.fit.free)
    z = np.concatenate([x[:, form.index] for x in bench.problem().predictor.sensors(whole)])
    return float(np.sqrt(np.mean((z - np.clip(z, -limit.value, limit.value)) ** 2)) / max(np.std(z), 1e-300))


def _means(bench: Bench, signals: list[Array], index: int) -> Array:
    """Of signals [n] between updates, over all recordings in turn."""
    k = bench.update
    return np.concatenate([x[: len(x) // k * k].reshape(-1, k).mean(axis=1) for x in signals])
