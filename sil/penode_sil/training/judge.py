# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How well a trained model predicts: in the simulation that trained it, and in the generated C with the trained set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model
from penode_gen.networks import Network
from penode_gen.sets import packing

from ..batch import Batch
from ..recordings.measured import Measured
from .data import Noise
from .port import Port, inputs_of
from .problem import Point, Problem
from .result import Error
from .settings import SETTINGS

Array = NDArray[np.float64]


def errors(
    problem: Problem,
    point: Point,
    measured: Sequence[Measured],
    before: Model,
    after: Model,
    ports: Sequence[Port],
    ranges: Sequence[tuple[Array, Array]],
    noise: Noise,
) -> tuple[tuple[Error, ...], float, float]:
    """RMS errors of all recorded signals, the share of samples outside of the trained range, and the share left out for them."""
    found = problem.residuals(point)
    if found is None:
        return (), 0.0, 0.0
    residuals, seen = found
    wait = int(SETTINGS.judge_after / problem.model.sample_time)
    away = [_outside(inputs, ports, ranges) for inputs in seen]
    late = [np.convolve(a.astype(float), np.ones(wait + 1))[: len(a)] > 0.0 for a in away]
    kept = {"before": _replayed(before, measured, point), "deployed": _replayed(after, measured, point)}
    rows = []
    signals = (*problem.model.sensors, *problem.model.outputs)
    for j, signal in enumerate(signals):
        goods = [r.good[:, j] for r in problem.records]
        if not any(g.any() for g in goods):
            continue
        by = {k: _rms([r.y[:, j] - z[:, j] for r, z in zip(problem.records, zs, strict=True)], goods) for k, zs in kept.items()}
        own = [r[:, j] for r in residuals]
        inside = _rms(own, [g & ~late_ for g, late_ in zip(goods, late, strict=True)])
        floor = signal.noise if signal.noise > 0.0 else float(noise.level[j])
        rows.append(Error(signal.name, signal.unit, by["before"], _rms(own, goods), by["deployed"], floor, inside, signal.noise > 0.0))
    return tuple(rows), float(np.mean(np.concatenate(away))), float(np.mean(np.concatenate(late)))


def deployed(problem: Problem, model: Model, measured: Sequence[Measured], point: Point) -> dict[str, float]:
    """RMS errors of the generated C, by signal."""
    zs, found = _replayed(model, measured, point), {}
    for j, signal in enumerate((*problem.model.sensors, *problem.model.outputs)):
        found[signal.name] = _rms(
            [r.y[:, j] - z[:, j] for r, z in zip(problem.records, zs, strict=True)], [r.good[:, j] for r in problem.records]
        )
    return found


def _outside(seen: Array, ports: Sequence[Port], ranges: Sequence[tuple[Array, Array]]) -> NDArray[np.bool_]:
    found = np.zeros(len(seen), dtype=bool)
    for port, (low, high) in zip(ports, ranges, strict=True):
        for columns in port.seen:
            x = seen[:, list(columns)]
            found |= np.any((x < low) | (x > high), axis=1)
    return found


def _rms(values: Sequence[Array], goods: Sequence[NDArray[np.bool_]]) -> float:
    chosen = np.concatenate([v[g] for v, g in zip(values, goods, strict=True)])
    return float(np.sqrt(np.mean(chosen**2))) if chosen.size else float("nan")


def _replayed(model: Model, measured: Sequence[Measured], point: Point) -> list[Array]:
    """Sensors, then outputs, of the generated C in float, [n, n_z] a recording; NaN from where it holds."""
    batch, found = Batch(model, np.float32), []
    for m, start in zip(measured, point.starts, strict=True):
        run = batch.run(m.u, x0=start, sensors=[s.name for s in model.sensors], outputs=[s.name for s in model.outputs])
        z = np.concatenate([run.z[0], run.y[0]], axis=1).astype(float)
        if run.first_bad[0] >= 0:
            z[run.first_bad[0] :] = np.nan
        found.append(z)
    return found


def visited(ports: Sequence[Port], seen: Sequence[Array]) -> list[Array]:
    """What went into each network."""
    return [inputs_of(p, seen) for p in ports]


def with_networks(model: Model, networks: Mapping[str, Network], parameters: dict[str, float]) -> Model:
    """The model with trained networks in its set 'default', and with other parameters."""
    default = replace(
        model.sets["default"],
        networks=model.sets["default"].networks | dict(networks),
        parameters=model.sets["default"].parameters | {k: v for k, v in parameters.items() if k in model.sets["default"].parameters},
    )
    changed = {n: replace(p, value=parameters[n]) for n, p in model.parameters.items() if n in parameters}
    digest = packing.digest(replace(model, sets={"default": default}))
    return replace(model, sets=model.sets | {"default": default}, parameters=model.parameters | changed, digest=digest)
