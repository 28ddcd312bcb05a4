# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A sensor that saturates before its noise is added: no two samples show the same limit, so only the motion reveals it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model, Parameter

from ..catalogue import others
from ..catalogue.form import Form
from ..evidence.bench import FAR, Bench
from ..evidence.fit import likelihood
from ..evidence.screening import Score, as_they_are
from ..study.fit import Free

Array = NDArray[np.float64]
SHARES = (0.98, 0.94, 0.88, 0.8, 0.7)  # quantiles of abs(y) that are tried as limits
SOFT = "soft"  # note on a form that comes near its limit smoothly
TINY = 1e-9  # of the limit, which has a logarithm
SHARP = 4.0  # its exponent at first, and twice the least: 2.6 is about a tanh; a limit that cuts off where it is large


def propose(bench: Bench, index: int, seen: Sequence[Array]) -> list[tuple[Score, Form]]:
    """The limit that gains most for a sensor, and a soft one above its largest sample, for such a limit shows none at it; none for one that
    was not measured, or hardly moves. A free run, `seen` [n, n_z] for each recording, replaces the signal that is not cut off; what is
    beyond a limit is the change of the innovations. Before any form is accepted, and if the largest samples agree within noise, limits are
    tried with the nominal parameters too."""
    y = np.abs(np.concatenate([r.y[:, index] for r in bench.records]))
    y = y[np.isfinite(y)]
    if not np.any(y > 0.0):
        return []
    low = least(bench, index)
    piled = np.quantile(y, SHARES[0]) >= low
    limits = [max(float(x), low) for x in (*np.quantile(y, SHARES), 1.1 * np.max(y)) if x > 0.0]

    def gained(sizes: Sequence[float], sharp: float) -> list[float]:
        changes = []
        for limit in sizes:
            change = np.zeros_like(bench.fit.nu)
            change[:, index] = _means(bench.update, [z[:, index] - _cut(z[:, index], limit, sharp) for z in seen])
            changes.append(change)
        return [s.gain for s in as_they_are(bench.fit, changes)]

    gains, soft = gained(limits, np.inf), limits[-1:]
    if len(bench.nominal) == len(bench.fit.free) and piled:
        gains = [max(pair) for pair in zip(gains, _gains_of_nominal(bench, index, limits), strict=True)]
    found = []
    for each, sizes, note in ((gains, limits, ""), (gained(soft, SHARP), soft, SOFT)):
        best = int(np.argmax(each))
        form = others.limited(bench.model.sensors[index].name, index, sizes[best], note)
        found.append((Score(each[best], np.ones(1 + bool(note))), form))
    return found


def _cut(x: Array, limit: float, sharp: float) -> Array:
    """A signal behind a limit; `sharp`: infinite for one that cuts off."""
    return np.clip(x, -limit, limit) if np.isinf(sharp) else x / (1.0 + np.abs(x / limit) ** sharp) ** (1.0 / sharp)


def _gains_of_nominal(bench: Bench, index: int, limits: Sequence[float]) -> list[float]:
    """Log likelihood gained by each limit of a sensor with nominal parameters: those fitted to clipped data give too little motion."""
    form = others.limited(bench.model.sensors[index].name, index, limits[0])
    model, (limit,) = limited(bench.model, form, "x0_0", least(bench, index))
    problem, free = bench.problem(model), (*bench.nominal, limit)
    shifts = np.zeros((len(limits), len(free)))
    shifts[:, -1] = np.log(np.array(limits) / limits[0])
    nu = problem.nu(free, shifts, bench.fit.by)
    return [likelihood(n, np.isfinite(n), problem.floor)[1] - bench.fit.likelihood for n in nu]


def limited(model: Model, form: Form, stem: str, low: float = 0.0) -> tuple[Model, tuple[Free, ...]]:
    """The model with a limit of a sensor, as a parameter of this `stem` so large that it has no effect, and its free values: the limit, at
    least `low`, and how sharp a soft one is."""
    s, name, sharp = model.sensors[form.index], f"{stem}_limit", f"{stem}_sharp"
    cut = replace(s, expression=expression(s.expression, name, sharp if form.note else ""))
    sensors = (*model.sensors[: form.index], cut, *model.sensors[form.index + 1 :])
    parameters = {**model.parameters, name: Parameter(name, FAR**2 * form.limit, s.unit)}
    free = [Free(name, form.limit, form.limit, log=True, sigma=1.0, origin=form.limit, low=low)]
    if form.note:
        parameters[sharp] = Parameter(sharp, SHARP, "1")
        free.append(Free(sharp, SHARP, SHARP, log=True, sigma=1.0, origin=SHARP, low=0.5 * SHARP))
    return replace(model, parameters=parameters, sensors=sensors), tuple(free)


def expression(signal: str, limit: str, sharp: str = "") -> str:
    """A signal behind a limit: one that cuts off, or a soft one that is so `sharp`."""
    if sharp:
        return f"({signal})*exp(-softplus({sharp}*log(abs({signal})/{limit} + {TINY}))/{sharp})"
    return f"min(max({signal}, -{limit}), {limit})"


def least(bench: Bench, index: int) -> float:
    """The least limit that a sensor may have: but for noise and a few that are far out, all samples are within it. A friction looks like a
    lower one; curves of a model that are somewhat off would make it that."""
    y = np.abs(np.concatenate([r.y[:, index] for r in bench.records]))
    return max(float(np.nanquantile(y, 0.998)) - 3.0 * float(bench.noise[index]), 0.0)


def share(bench: Bench, form: Form, limit: Free, sharp: float = np.inf) -> float:
    """What a limit cuts off, as a share of the signal."""
    whole = tuple(replace(f, value=FAR**2 * f.value) if f.target == limit.target else f for f in bench.fit.free)
    z = np.concatenate([x[:, form.index] for x in bench.problem().predictor.sensors(whole)])
    return float(np.sqrt(np.mean((z - _cut(z, limit.value, sharp)) ** 2)) / max(np.std(z), 1e-300))


def _means(update: int, signals: Sequence[Array]) -> Array:
    """Means of signals [n] over the samples of each update, [updates], all recordings in turn."""
    return np.concatenate([x[: len(x) // update * update].reshape(-1, update).mean(axis=1) for x in signals])
