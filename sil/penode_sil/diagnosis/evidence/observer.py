# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model as its own observer: recordings, the model in the form in which it follows them, and its innovations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import GROUND, Element, Equation, Input, Model, Parameter, Signal, State

from ...batch import Batch, Observer
from ..catalogue.actuators import ACTUATORS
from ..plant.between import far, finer, joined, straight
from ..plant.compiling import compiled, longest, ordered
from ..plant.plant import Place, anonymous, extend, external, rotational_unit
from ..study.fit import Free
from ..study.noise import Experiment
from . import latency, samples

Array = NDArray[np.float64]
UNMODELLED = "unmodelled"  # stem of the unmodelled forces and of their states
MAX_TURN = 0.15  # of a period of the fastest mode, in one step of the integration: Runge-Kutta of order 4 then errs by 1e-4 of it a step
MOST_STEPS = 50_000  # integration steps, over all recordings, up to which edges are steepened; a fit of a form then takes half a second
MIN_STEPS = 5  # steps between updates: the edge of a friction, 0.02 of the rms rate wide, then damps less than Runge-Kutta bears
MAX_INNOVATION = 1e15  # innovation of a run that left all bounds


@dataclass(frozen=True, eq=False)
class Record:
    """A recording: inputs u [n, n_u], sensors y [n, n_z] (NaN: nothing measured), `step` [s] apart; `held`: all inputs move in
    steps, `smooth`: none does; `left`: seconds behind its end that are not looked at."""

    name: str
    step: float
    u: Array
    y: Array
    held: bool = False
    smooth: bool = True
    left: float = 0.0

    @staticmethod
    def of(e: Experiment) -> Record:
        held = e.held is not None and bool(e.held.all())
        return Record(e.name, e.step, e.drive if e.held is None else e.u, np.where(e.good, e.y, np.nan), held, e.held is None, e.left)

    @cached_property
    def between(self) -> dict[int, Array]:
        """Inputs with the samples between rows filled in, by how many times finer they are; hundreds of fits need them."""
        return {}

    def __len__(self) -> int:
        return len(self.y)


def sample_noise(records: Sequence[Record], stated: Array) -> Array:
    """Noise [n_z] of a sample of each sensor, see `samples.noise`."""
    return samples.noise([[r.y[:, j] for r in records] for j in range(len(stated))], stated)


def bias(sensor: str) -> str:
    return f"{sensor}_bias"


def scale(sensor: str) -> str:
    return f"{sensor}_scale"


def augmented(model: Model) -> Model:
    """The model with a bias and a scale of each sensor as parameters, and with an unmodelled acceleration w of each body, a
    first-order Gauss-Markov process w' = -w/tau + noise. The parameter unmodelled_tau is tau [s]. It is an acceleration because the
    observer then does not change if all masses and forces are scaled by one factor, which sensors of motion cannot show."""
    free = {bias(s.name): Parameter(bias(s.name), 0.0, s.unit) for s in model.sensors}
    free |= {scale(s.name): Parameter(scale(s.name), 1.0, "1") for s in model.sensors}
    free[f"{UNMODELLED}_tau"] = Parameter(f"{UNMODELLED}_tau", 1.0, "s")
    ends = [(b.name, GROUND) for b in model.bodies]
    units = [rotational_unit(model, e, "m/s^2") for e in ends]
    names = [f"{UNMODELLED}{k}" for k in range(len(ends))]
    forces = [Element(name, e, "expression", expression=f"{b.mass}*{name}_f") for name, e, b in zip(names, ends, model.bodies, strict=True)]
    states = [State(f"{name}_f", u) for name, u in zip(names, units, strict=True)]
    laws = [Equation(name, f"der({name}_f)*{UNMODELLED}_tau = -{name}_f") for name in names]
    wide = replace(
        model, parameters={**model.parameters, **free}, extra_states=(*model.extra_states, *states), equations=(*model.equations, *laws)
    )
    wide = extend(wide, forces, {})
    sensors = tuple(replace(s, expression=f"({s.expression})*{scale(s.name)} + {bias(s.name)}") for s in wide.sensors)
    return replace(wide, sensors=sensors)


def with_probes(model: Model, places: Sequence[Place]) -> Model:
    """An augmented model with a force at_k as a further input at each place, and its deflection, its rate and the force there already as
    further sensors; behind them the forces of its drives, and all of each place, those of forms too."""
    forces = [Element(f"probe{k}", p.ends, "expression", expression=f"at{k}") for k, p in enumerate(places)]
    wide = replace(model, inputs=(*model.inputs, *(Input(f"at{k}", p.unit("N")) for k, p in enumerate(places))))
    wide = extend(wide, forces, {}, places)
    seen = []
    for k, p in enumerate(places):
        signals = (("s", f"s_probe{k}", "m"), ("v", f"v_probe{k}", "m/s"), ("F", force_at(p), "N"))
        seen += [Signal(f"{q}_of_probe{k}", text, p.unit(unit)) for q, text, unit in signals]
    seen += [Signal(f"F_of_{e.name}", f"F_{e.name}", rotational_unit(model, e.ends, "N")) for e in drives(model)]
    seen += [Signal(f"all_of_probe{k}", _all_at(model, p), p.unit("N")) for k, p in enumerate(places)]
    return replace(wide, sensors=(*wide.sensors, *seen))


def drives(model: Model) -> list[Element]:
    """Forces that inputs put on bodies."""
    return [e for e in model.elements if external(model, e)]


def force_at(p: Place) -> str:
    """The force of the elements at a place, as an expression."""
    return " ".join(f"{'+' if sense > 0 else '-'} F_{name}" for name, sense in p.elements) or "0"


def _all_at(model: Model, p: Place) -> str:
    """The force of the elements at a place and of the forms put there."""
    own = {name for name, _ in p.elements}
    forms = [e.name for e in model.elements if e.ends == p.ends and e.name not in own and not external(model, e)]
    return " + ".join([force_at(p), *(f"F_{n}" for n in forms if not n.startswith(UNMODELLED))])


@dataclass(frozen=True, eq=False)
class Filter:
    """How an observer corrects its states: gain [n_x, n_z] or [runs, n_x, n_z], and the correlation time tau [s], one or [runs],
    of the unmodelled forces."""

    gain: Array
    tau: Array

    @staticmethod
    def none(n_x: int, n_z: int) -> Filter:
        """A free run."""
        return Filter(np.zeros((n_x, n_z)), np.ones(1))

    @staticmethod
    def many(filters: Sequence[Filter]) -> Filter:
        """One run by each."""
        return Filter(np.array([f.gain for f in filters]), np.concatenate([f.tau for f in filters]))

    def cut(self, n_x: int) -> Filter:
        """Of the first states alone."""
        return Filter(self.gain[:n_x], self.tau)

    def padded(self, n_x: int) -> Filter:
        """With more states, which are not corrected."""
        wide = np.zeros((n_x, self.gain.shape[1]))
        wide[: len(self.gain)] = self.gain
        return Filter(wide, self.tau)


@dataclass(frozen=True, eq=False)
class Lanes:
    """Innovations of some runs, per recording [runs, updates, sensors], NaN where nothing was measured; and whether a run stayed within
    bounds [runs]."""

    nu: list[Array]
    sane: NDArray[np.bool_]


class Predictor:
    """An augmented model that follows recordings, corrected every `update` samples."""

    def __init__(self, model: Model, records: Sequence[Record], update: int, set_name: str = "default", fastest: float = 0.0):
        self.model, self.records, self.update, self.set_name = model, tuple(records), update, set_name
        causal, moves = ordered(model)
        smooth = bool(model.inputs) and all(r.smooth for r in records) and far(model.sample_time, [r.u for r in records])
        self.fine = (3 if moves else 2) if smooth else 1  # samples of an input in one of a recording, see `between`
        step = model.sample_time / self.fine
        least = -(-MIN_STEPS // (update * self.fine)), -(-model.substeps // self.fine)
        substeps = max(1, int(np.ceil(step * fastest / MAX_TURN)), int(np.ceil(0.999 * step / longest(model))), *least)
        way = "linear" if smooth else "cubic" if moves else "held" if any(r.held for r in records) else "linear"
        self._causal = causal
        self.batch = compiled(anonymous(replace(model, method="rk4", interpolation=way, substeps=substeps, sample_time=step)), causal)
        self.stepped = way == "held" and len(model.inputs) == 1  # one input moves in steps
        self.steps = sum(map(len, records)) * self.fine * substeps  # of the integration in all recordings
        self.n_z = len(records[0].y[0])  # sensors that were measured; the model may have more

    def predict(
        self, free: Sequence[Free], shifts: Array, by: Filter, extra: Mapping[int, Array] = {}, watched: int = 0, states: Sequence[str] = ()
    ) -> tuple[Lanes, list[Array], list[Array]]:
        """Runs with free values after shifts [runs, free], corrected `by` a filter. `extra`: further inputs of a probed model per
        recording, [runs, n, .]; `watched`: how many sensors more to give, per recording [runs, n, watched]. Returns innovations,
        watched sensors, and states per recording [runs, n, n_x]."""
        nus, seen, moved, sane = [], [], [], np.ones(len(shifts), bool)
        batch, more_sensors = self._batch(free), [s.name for s in self.model.sensors[self.n_z :][:watched]]
        for e in range(len(self.records)):
            start, parameters, u, y = self._given(e, free, shifts)
            parameters[f"{UNMODELLED}_tau"] = by.tau
            if e in extra:
                more = joined(straight(extra[e], self.fine), extra[e])
                u = np.concatenate([np.broadcast_to(u, (len(more), *u.shape[-2:])), more], axis=-1)
            gain = by.gain / self._scales(parameters)
            wide = np.zeros((*gain.shape[:-1], len(self.model.sensors)))
            wide[..., : self.n_z] = gain
            run = batch.run(
                u,
                x0=start,
                parameters=parameters,
                set_name=self.set_name,
                sensors=more_sensors,
                states=states,
                every=self.fine,
                observer=Observer(self.update, self._measured[e] if y is self.records[e].y else self._padded(y), wide),
            )
            nu = run.nu[:, :, : self.n_z]
            nus.append(self._as_measured(e, np.clip(nu, -MAX_INNOVATION, MAX_INNOVATION, out=nu), free, shifts))
            sane &= run.first_bad < 0
            seen.append(run.z)
            moved.append(run.x)
        return Lanes(nus, sane), seen, moved

    def sensors(self, free: Sequence[Free]) -> list[Array]:
        """The measured sensors in a free run, [n, n_z] per recording."""
        found, batch = [], self._batch(free)
        for e in range(len(self.records)):
            start, parameters, u, _ = self._given(e, free, np.zeros((1, len(free))))
            run = batch.run(u, x0=start, parameters=parameters, set_name=self.set_name, every=self.fine)
            found.append(run.z[0, :, : self.n_z])
        return found

    def _batch(self, free: Sequence[Free]) -> Batch:
        """The compiled model; with straight lines between the rows of an input that moves in steps but is smoothed by an actuator."""
        smooth = self.stepped and any(f.target[0] in ACTUATORS and ACTUATORS[f.target[0]].smoothed for f in free)
        return self._lines if smooth else self.batch

    @cached_property
    def _lines(self) -> Batch:
        return compiled(replace(self.batch.model, interpolation="linear"), self._causal)

    def _scales(self, parameters: Mapping[str, Array]) -> Array:
        """Scales of sensors, [1, n_z] or [runs, 1, n_z]. Filters are for sensors of scale 1: without this a fitted scale would tune
        them."""
        known = [parameters.get(scale(s.name), np.ones(1)) for s in self.model.sensors[: self.n_z]]
        return np.stack(np.broadcast_arrays(*known), axis=-1)[:, None, :] if any(len(k) > 1 for k in known) else np.array(known).T

    def _finer(self, e: int, u: Array) -> Array:
        """Inputs [n, n_u] or [runs, n, n_u] of recording `e`, with the samples between its rows filled in."""
        record = self.records[e]
        if self.fine == 1:
            return u
        if u is not record.u:
            return alike(u, lambda some: finer(some, record.step, self.fine))
        if self.fine not in record.between:
            record.between[self.fine] = finer(u, record.step, self.fine)
        return record.between[self.fine]

    def _padded(self, y: Array) -> Array:
        """What was measured, [..., n_z], with all sensors of the model, NaN for those that only it has."""
        more = len(self.model.sensors) - self.n_z
        return np.concatenate([y, np.full((*y.shape[:-1], more), np.nan)], axis=-1) if more else y

    @cached_property
    def _measured(self) -> list[Array]:
        """The sensors of each recording, as most runs have them."""
        return [self._padded(r.y) for r in self.records]

    def _as_measured(self, e: int, nu: Array, free: Sequence[Free], shifts: Array) -> Array:
        """Innovations [runs, updates, n_z] in units in which densities are those of what was measured: without a lag, a sensor of
        recording `e` has more power, noise too."""
        for f, shift in zip(free, shifts.T, strict=True):
            match f.target:
                case "lag", j:
                    nu[:, :, j] /= latency.amplified(self.records[e].y[:, j], f.at(shift) / self.records[e].step, self.update)[:, None]
        return nu

    def _given(self, e: int, free: Sequence[Free], shifts: Array) -> tuple[Array, dict[str, Array], Array, Array]:
        record, runs = self.records[e], len(shifts)
        start = np.tile(np.array(self.model.start, dtype=float), (runs, 1))
        parameters: dict[str, Array] = {}
        u, y = record.u, record.y
        for f, shift in sorted(zip(free, shifts.T, strict=True), key=lambda pair: _order(pair[0])):
            values = f.at(shift)
            match f.target:
                case str(name):
                    parameters[name] = values
                case "start", recording, state:
                    if recording == e:
                        start[:, state] = values
                case "input_added", j, added:
                    u = np.array(np.broadcast_to(u, (runs, *u.shape[-2:])))
                    u[:, :, j] += values[:, None] * added.signals[e]
                case what, j if what in latency.BEFORE:
                    y = np.array(np.broadcast_to(y, (runs, *y.shape[-2:])))
                    y[:, :, j] = latency.BEFORE[what](record.y[:, j], values / record.step)
                case what, j:
                    u = np.array(np.broadcast_to(u, (runs, *u.shape[-2:])))
                    actuator = ACTUATORS[what]
                    output = (self.stepped and actuator.smoothed) or actuator.output
                    u[:, :, j] = output(u[:, :, j], values, record.step)
        return np.clip(np.nan_to_num(start), -MAX_INNOVATION, MAX_INNOVATION), parameters, self._finer(e, u), y


def _order(f: Free) -> int:
    """Place of a free value in the row in which those of one input act."""
    return ACTUATORS[f.target[0]].order if f.target[0] in ACTUATORS else 0


def alike(u: Array, filled: Callable[[Array], Array]) -> Array:
    """Inputs [runs, n, n_u], `filled` in: once for all runs that have those of the first one, as most derivatives do."""
    other = np.any(u != u[:1], axis=(1, 2)) if u.shape[:-2] else np.ones(0, bool)
    if other.all():
        return filled(u)
    own = filled(u[:1])
    found = np.repeat(own, len(u), axis=0)
    if other.any():
        found[other] = filled(u[other])
    return found
