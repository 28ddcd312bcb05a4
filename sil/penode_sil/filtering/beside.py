# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A filter beside a simulation: `penode simulate --filter`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from ..console import progress
from ..errors import WrongUse, hint
from ..output import Column
from ..recordings import units
from ..results import Result
from ..scenario import Instance
from . import compiled, exact, exact_monitor, results, watched
from .estimates import Estimates, named, of
from .watched import Watched

RUN = {"mil": exact.run, "sil": compiled.run}
_WATCH = {"mil": exact_monitor.run, "sil": watched.run}
SEED = "filter"  # of the noise of a simulation: its bytes


def run(
    place: str, model: Model, set_name: str, u: Any, z: Any, mask: Any, exchanges: dict[int, str], tell: Callable[[int], None]
) -> tuple[Estimates, Watched | None]:
    """The filter, with its monitor if the model has one, over samples; `exchanges`: from which sample on another set is in force."""
    given = (model, set_name, u, z, mask, exchanges, tell)
    return _WATCH[place](*given) if model.monitor else (RUN[place](*given), None)


def check_signal(model: Model, signal: str | None) -> None:
    """WrongUse for a signal that the filter does not estimate."""
    names = [name for _, name, _ in named(model)]
    if signal is not None and signal not in names:
        raise WrongUse(f'--signal: the filter estimates no "{signal}"; {hint(signal, names)}')


class Beside:
    """The filter over the sensors of a simulated instance, with noise of the filter's own levels; sets are exchanged as there."""

    def __init__(self, model: Model, place: str, u: NDArray[np.float64], result: Result):
        self.model, self.result = model, result
        given, sensors, name = of(model), [s.name for s in model.sensors], result.instance.name
        rng = np.random.default_rng(list(f"{SEED} {name}".encode()))
        exact_z = result.z[:, [sensors.index(s.name) for s in given.sensors]].astype(float)
        z = exact_z + np.array([s.noise for s in given.sensors]) * rng.standard_normal(exact_z.shape)
        noise = {i.name: i.noise for i in given.inputs if i.measured}
        driven = u + np.array([noise.get(i.name, 0.0) for i in model.inputs]) * rng.standard_normal(u.shape)
        exchanges = _exchanges(result.instance, result.adopted)
        with progress(f"{name}: filter on {place}", len(z)) as tell:
            self.found, self.watched = run(place, model, result.instance.set, driven, z, None, exchanges, tell)
        self.truth: dict[str, NDArray[Any]] = dict(zip((i.name for i in model.inputs), u.T, strict=True))
        self.truth |= dict(zip(model.states, result.x.T, strict=True))
        self.truth |= {s.name: v for s, v in zip((*model.outputs, *model.sensors), (*result.y.T, *result.z.T), strict=True)}
        for p in given.parameters:
            self.truth[p.name] = np.full(len(z), model.sets[result.instance.set].parameters[p.name])
            for sample, chosen in sorted(exchanges.items()):
                self.truth[p.name][sample:] = model.sets[chosen].parameters[p.name]

    def columns(self, prefix: str) -> list[Column]:
        """Estimates, to stand behind the table of the simulation."""
        found = results.columns(self.model, self.found, ".estimate") + watched.columns(self.model, self.watched)
        return [replace(c, name=f"{prefix}{c.name}") for c in found]

    def summary(self) -> dict[str, Any]:
        """Counts, and each estimate against the truth."""
        times = np.arange(len(self.found.status)) * self.model.sample_time
        entry = results.summary(self.model, self.found) | watched.summary(self.model, self.watched, times) | {"errors": {}}
        for at, name, unit in named(self.model):
            error = self.found.values[:, at].astype(float) - self.truth[name]
            bound = 3.0 * self.found.deviations[:, at]
            within = np.abs(error) <= bound
            rmse = float(np.sqrt(np.mean(error**2)) / units.factor(unit))
            entry["errors"][name] = {"rmse": rmse, "unit": unit, "within_3_sd": float(np.mean(within))}
        return entry

    def sentences(self) -> list[str]:
        """The summary in lines."""
        entry = self.summary()
        errors = [
            f"  {n}: RMSE {e['rmse']:.6g} {e['unit']}, {e['within_3_sd']:.1%} within 3 standard deviations"
            for n, e in entry["errors"].items()
        ]
        return [f"  filter of {self.result.instance.name}:", *results.sentences(entry), *watched.sentences(entry), *errors]

    def plot(self, times: NDArray[np.float64], signal: str | None, title: str, path: Path) -> None:
        """Truth, estimate and 3 standard deviations of a signal, the first one that is estimated if None."""
        name = signal or named(self.model)[0][1]
        results.plot(self.model, self.found, times, name, (times, self.truth[name].astype(float)), title, path)


def _exchanges(instance: Instance, adopted: tuple[int, ...]) -> dict[int, str]:
    """The set that is in force from a sample on."""
    found, before = {}, [instance.set]
    for exchange, sample in zip(instance.exchanges, adopted, strict=False):
        before.append(before[-2] if exchange.how == "rollback" else exchange.set)
        found[sample] = before[-1]
    return found
