# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Offsets of sensors: those that recordings show, and the constant force on a body that makes them, if one explains as much."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import constants

from penode_gen import units
from penode_gen.model import GROUND, Model

from ..catalogue import drives, loads, others
from ..evidence.bench import Bench
from ..evidence.fit import Fit
from ..evidence.observer import bias
from ..evidence.screening import Probe
from ..plant.plant import Place
from ..result import Cause, Named, Value
from .propose import SMALL
from .terms import Term
from .worth import MIN_GAIN, WORTH, Z_95, confounded, least, mostly, own_of_sensors, systematic

Array = NDArray[np.float64]
STARTS = 0.5  # values that other start states count for, where an explanation needs them


@dataclass(frozen=True)
class Offset:
    """An offset of a sensor with its standard deviation."""

    sensor: str
    value: float
    deviation: float


def named(model: Model, bench: Bench, level: float, shifts: Array) -> tuple[list[Cause], list[str]]:
    """Sensor offsets that the recordings show by MIN_GAIN, as any cause, or the load that explains them. One is a cause if it is surely
    not zero, above the share of the signal's rms that has a name (`worth.least`, beside the unmodelled `level` that remains), below 100 %,
    and above half of the shift [n_z] of the signal's mean by what else was found: a damper rounded at zero, not sharp, shifts it by 0.4 of
    that. Others, and those near 1 g, become notes. Nothing where start states have the same effect: a plant without a spring to ground
    has no zero, and its sensors are off against each other at most."""
    found, notes = [], []
    biases = [bias(s.name) for s in model.sensors]
    shares, mixed = own_of_sensors(bench.model, bench.fit, biases), confounded(bench.model, bench.fit, biases)
    rms = [max(float(np.nanstd(np.concatenate([r.y[:, j] for r in bench.records]))), 1e-300) for j in range(len(biases))]
    if any(abs(mixed.get(b, 0.0)) > WORTH * shown for b, shown in zip(biases, rms, strict=True)):
        off = ", ".join(s.name for s in model.sensors if bias(s.name) in mixed)
        notes.append(f"the offsets of {off} differ; the recordings do not tell which is wrong")
    for s, alone, shown, shift in zip(model.sensors, shares[:-1], rms, shifts, strict=True):
        value, sd = bench.fit.value(bias(s.name)), bench.fit.deviation(bias(s.name))
        if (alone * value / sd) ** 2 <= 2.0 * MIN_GAIN or bias(s.name) in mixed:
            continue
        # collinearity with other free values amplifies the effect of model error
        sd, size = float(np.hypot(sd, systematic(level) * shown / alone)), abs(value)
        large = max(least(level, 0.0) * shown, Z_95 * sd) < size < shown and abs(size / constants.g - 1.0) > WORTH
        if bench.places and mostly(size / max(shift, 1e-300)) and large:  # without places it may stand for any law
            found.append(Offset(s.name, value, sd))
        else:
            notes.append(f"{s.name} has an offset of {value:.4g} {units.si(s.unit)}: gravity, ride height, a zero that is off?")
    return _Offsets(model, bench, tuple(found)).causes() if found else [], notes


@dataclass(frozen=True, eq=False)
class _Offsets:
    """Offsets found in a bench, and what else may explain them and the start states fitted with them: as whitened changes of the
    innovations."""

    model: Model
    bench: Bench
    found: tuple[Offset, ...]

    @cached_property
    def _white(self) -> Array:
        return 1.0 / np.sqrt(self.bench.fit.variance)

    @cached_property
    def _of_offsets(self) -> Array:
        """Changes [rows, found] for each offset as it is."""
        at = [f.target for f in self.bench.fit.free]
        return np.column_stack([self._of_free(at.index(bias(o.sensor))) * o.value for o in self.found])

    @cached_property
    def _of_starts(self) -> Array:
        """Changes [rows, start states] for each as far as it is off the model's."""
        free = self.bench.fit.free
        moved = [i for i, f in enumerate(free) if not isinstance(f.target, str) and f.target[0] == "start" and f.value != f.origin]
        columns = [self._of_free(i) * (free[i].value - free[i].origin) for i in moved]
        return np.array(columns).T.reshape(len(self._of_offsets), -1)

    @cached_property
    def _whole(self) -> Array:
        """Change [rows] of all offsets and start states as they were fitted: a load moves sensors that do not show it by themselves."""
        free, biases = self.bench.fit.free, {bias(s.name) for s in self.model.sensors}
        offsets = [self._of_free(i) * f.value for i, f in enumerate(free) if f.target in biases]
        whole: Array = np.sum(offsets, axis=0) + self._of_starts.sum(axis=1)
        return whole

    @cached_property
    def _of_loads(self) -> list[tuple[Place, Array]]:
        """Places at which a constant force may act on a body, and its changes [rows]."""
        bench, probe = self.bench, Probe.of(self.bench)
        at = [(k, p) for k, p in enumerate(bench.places) if GROUND in p.ends and p.role != "tyre"]
        ones = [np.ones(len(r)) for r in bench.records]
        small = SMALL * float(np.min(bench.forces)) if len(bench.forces) else SMALL  # of prescribed motion, any size will do
        columns = probe.columns([(k, ones) for k, _ in at], small)
        return [(p, (c * self._white)[bench.fit.used]) for (_, p), c in zip(at, columns, strict=True)]

    def _of_free(self, i: int) -> Array:
        fit = self.bench.fit
        return (fit.slopes[:, :, i] * self._white)[fit.used] / fit.free[i].unit

    def causes(self) -> list[Cause]:
        """The explanation with the fewest values that leaves no more than MIN_GAIN, or WORTH of all in rms: offsets as they are, or a
        load that stands for some of them; other start states count for STARTS of a value. Of equal ones a load is simpler; offsets list the
        loads that each stand for all of them."""
        every = list(self._explanations())
        _, load, force, kept = min(every, key=lambda e: (e[0], e[1] is None))
        offsets = [o for k, o in enumerate(self.found) if load is None or k in kept]
        alone = {p.name: Named(loads.KINDS[0], p.name) for _, p, _, rest in every if p is not None and not rest and load is None}
        causes = [
            others.offset(o.sensor, Value(o.value, units.si(self._unit(o)), _interval(o.value, o.deviation)), 1.0, tuple(alone.values()))
            for o in offsets
        ]
        if load is None:
            return causes
        gone = [o for k, o in enumerate(self.found) if k not in kept]
        deviation = abs(force) * max(o.deviation / abs(o.value) for o in gone)
        size = Value(-force, load.unit("N"), _interval(-force, deviation))
        alike = (*(Named(others.OFFSET, o.sensor) for o in gone), *inputs_alike(self.model, load))
        return [loads.cause(load.name, size, 1.0, alike), *causes]

    def _explanations(self) -> Iterator[tuple[float, Place | None, float, tuple[int, ...]]]:
        """Cost, load and its force, and the offsets kept, of every explanation that leaves little."""
        offsets, starts = self._of_offsets, self._of_starts
        whole = self._whole
        enough = max(2.0 * MIN_GAIN, float(WORTH**2 * (whole @ whole)))
        every = range(len(self.found))
        yield len(self.found) + STARTS, None, 0.0, tuple(every)
        for moved in (0.0, STARTS):
            free = starts if moved else starts[:, :0]
            if _left(whole, np.hstack([offsets, free]))[0] <= enough:
                yield len(self.found) + moved, None, 0.0, tuple(every)
            for (place, column), count in itertools.product(self._of_loads, range(len(self.found))):
                for kept in itertools.combinations(every, count):
                    left, force = _left(whole, np.hstack([column[:, None], offsets[:, kept], free]))
                    if left <= enough:
                        yield 1 + count + moved, place, force, kept

    def _unit(self, o: Offset) -> str:
        return next(s.unit for s in self.model.sensors if s.name == o.sensor)


def _left(whole: Array, columns: Array) -> tuple[float, float]:
    """Sum of squares that columns leave, and the value of the first."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    values = np.linalg.lstsq(columns / size, whole, rcond=1e-9)[0] / size
    left = whole - columns @ values
    return float(left @ left), float(values[0])


def _interval(value: float, deviation: float) -> tuple[float, float]:
    return value - Z_95 * deviation, value + Z_95 * deviation


def shifts(bench: Bench, run: Fit, terms: Sequence[Term]) -> Array:
    """By how much terms shift the mean of each sensor [n_z] in a free run, by its slopes, each in its own direction."""
    own = {f.target for t in terms for f in t.free if not f.log}
    sizes = np.array([abs(f.value - f.origin) / f.unit * (f.target in own) for f in run.free])
    whitened = 1.0 if bench.colour is None else np.abs(1.0 - bench.colour.taps.sum(axis=0))  # of a mean, is left
    found: Array = np.abs(np.nanmean(np.where(run.used[:, :, None], run.slopes, np.nan), axis=0)) @ sizes / whitened
    return found


def inputs_alike(model: Model, p: Place) -> tuple[Named, ...]:
    """Inputs whose offset may be a constant force at a place."""
    return tuple(Named(drives.OFFSET, x.name) for x in model.inputs if p.unit("N") == x.unit)
