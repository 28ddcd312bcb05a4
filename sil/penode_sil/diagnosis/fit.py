# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Output-error fits: free parameters of a model, start states and sensors, so that the simulated sensors meet the measured.

Each iteration simulates all finite differences at once, one in each lane (see batch), and tries several steps at once.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.interpolate import CubicSpline

from penode_gen import fold
from penode_gen.causalise import causalise
from penode_gen.model import Model

from ..batch import Batch
from .hypotheses import Fault
from .noise import Experiment, Metric
from .plant import anonymous

Array = NDArray[np.float64]
STIFF = 2.5e-4  # [s] longest step of a law that follows a short way or a short time
BLOCK = 256  # samples that are turned about at a time: they stay in the cache
FAR = 1e20  # residual of a run that cannot be simulated
REFRESHED = 3  # iteration at which derivatives taken as known are computed after all
DAMPING = np.array([0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0])  # of trial steps, relative to the curvature


@dataclass(frozen=True)
class Free:
    """Something to be fitted. `target`: a parameter's name, or ("bias" | "scale" | "delay" | "skew", sensor index),
    ("fault", its number), or ("start", recording, state index). `unit` steps of it are natural; a `log` one stays positive. `sigma`: its prior."""

    target: str | tuple[str, int] | tuple[str, int, int]
    value: float
    unit: float
    log: bool = False
    sigma: float = np.inf
    origin: float = 0.0
    low: float = -np.inf
    high: float = np.inf

    @property
    def offset(self) -> float:
        """How far it is from its prior, in deviations of that."""
        return (self.value - self.origin) / self.sigma

    def at(self, shift: Array | float) -> Array:
        """Values after shifts by so many units."""
        moved = self.value * np.exp(shift) if self.log else self.value + shift * self.unit
        return np.clip(moved, self.low, self.high)


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a fit ended: chi2 with and without priors, whitened residual, and its derivatives [rows, free] in the units of
    `free`."""

    model: Model
    free: tuple[Free, ...]
    chi2: float
    cost: float
    residual: Array
    jacobian: Array
    simulated: tuple[Array, ...]
    faults: tuple[Fault, ...] = ()

    def value(self, target: object) -> float:
        return next(f.value for f in self.free if f.target == target)

    def covariance(self) -> Array:
        """Of all free values, in their units (log: relative)."""
        priors = np.array([(f.unit / f.sigma) ** 2 for f in self.free])
        curvature = self.jacobian.T @ self.jacobian + np.diag(priors)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(curvature), 1e-300))
        return np.linalg.pinv(curvature * np.outer(scale, scale), rcond=1e-10) * np.outer(scale, scale)


class Problem:
    """A model against recordings in their metrics."""

    def __init__(
        self, model: Model, experiments: Sequence[Experiment], metrics: Sequence[Metric], set_name: str = "default",
        fastest: float = 0.0, faults: Sequence[Fault] = (),
    ):  # fmt: skip
        self.model, self.experiments, self.metrics, self.set_name = model, experiments, metrics, set_name
        self.faults = faults
        self.fine = 4 if moving(model) else 2  # see _drive
        step = model.sample_time / self.fine
        stiff = any(e.law == "loose_damper" or "presliding" in e.arguments for e in model.elements)
        substeps = max(1, int(np.ceil(step * fastest / 0.1)), int(np.ceil(step / STIFF - 1e-6)) * stiff, -(-model.substeps // self.fine))
        exact = replace(_folded(model), method="rk4", interpolation="linear", input_rate="chord", substeps=substeps, sample_time=step)
        self.batch = _compiled(anonymous(exact))
        self.inputs = [_drive(e, self.fine) for e in experiments]

    def simulate(self, e: int, free: Sequence[Free], shifts: Array, states: Sequence[str] = ()) -> tuple[Array, Array]:
        """Sensors [runs, n, n_z] and named states of recording e for shifts [runs, free]."""
        start = np.tile(np.array(self.model.start, dtype=float), (len(shifts), 1))
        parameters, faults = {}, []
        for f, shift in zip(free, shifts.T):
            values = f.at(shift)
            if isinstance(f.target, str):
                parameters[f.target] = values
            elif f.target[0] == "start":
                if f.target[1] == e:
                    start[:, f.target[2]] = values
            else:
                faults.append((f.target[0], f.target[1], values))
        run = self.batch.run(self.inputs[e], x0=start, parameters=parameters, set_name=self.set_name, states=states, every=self.fine)
        turned = run.z.transpose(0, 2, 1)
        z = np.empty(turned.shape)  # [runs, n_z, n], in the order that what follows likes
        for i in range(0, z.shape[2], BLOCK):
            z[:, :, i : i + BLOCK] = turned[:, :, i : i + BLOCK]
        if self.fine == 4 and z.shape[2] > 2:
            z[:, :, 0] = 2.0 * z[:, :, 1] - z[:, :, 2]  # the step knows no rate of an input at its first sample
        z[run.first_bad >= 0] = 1e30
        for what, j, values in faults:
            if what == "fault":
                fault = self.faults[j]
                z[:, fault.sensor] += values[:, None] * fault.of(z[:, fault.sensor], e)
            elif what == "scale":
                z[:, j] *= 1.0 + values[:, None]
            elif what == "bias":
                z[:, j] += values[:, None]
            elif what == "skew":  # of all runs about the same
                z[:, j] -= values[:, None] * np.gradient(z[0, j], self.experiments[e].step)
            elif what == "clock":
                z = drifted(z, values)
            elif what == "delay":
                z[:, j] = delayed(z[:, j].T, values, self.experiments[e].step).T
        return np.moveaxis(z, 1, 2), run.x

    def residuals(self, e: int, z: Array) -> Array:
        """Whitened residuals [runs, rows]."""
        y, good = self.experiments[e].y.T, self.experiments[e].good.T
        rows = np.empty((len(z), *y.shape), np.float32)  # as the transforms like them, and fine enough for what is left
        with np.errstate(over="ignore", invalid="ignore"):  # some runs leave all bounds
            np.subtract(y, np.moveaxis(z, 1, 2), out=rows, casting="same_kind")
            if not good.all():
                rows *= good
            white = self.metrics[e](np.moveaxis(rows, 1, 2))
            white[~np.isfinite(np.sum(white, axis=1))] = FAR
        return white

    def solve(self, free: Sequence[Free], iterations: int = 12, close: float = 0.05, known: Mapping[int, Array] = {}) -> Fit:
        """The best free values from those given on, by damped Gauss-Newton; stops when a step gains less than `close`.
        `known` derivatives (by number) are near enough and are not simulated: see `complete`."""
        free, known = tuple(free), dict(known)
        precision = np.array([f.unit / f.sigma for f in free])
        cost = np.inf
        for _ in range(iterations + 1):
            fresh = bool(known) and _ == REFRESHED
            residual, jacobian, simulated = self.linear(free, {} if fresh else known)
            if fresh:
                known = {i: jacobian[:, i] for i in known}
            offset = np.array([f.offset for f in free])
            chi2 = float(residual @ residual)
            cost_here = chi2 + float(offset @ offset)
            fit = Fit(self.model, free, chi2, cost_here, residual, jacobian, simulated, tuple(self.faults))
            if not np.isfinite(cost_here) or cost - cost_here < close or not free:
                break
            cost = cost_here
            if _ == iterations:
                break
            curvature = jacobian.T @ jacobian + np.diag(precision**2)
            slope = jacobian.T @ residual - precision * offset
            scale = np.sqrt(np.maximum(np.diag(curvature), 1e-30))
            normed = curvature / np.outer(scale, scale)
            trials = np.array([np.linalg.solve(normed + (1e-10 + d) * np.eye(len(free)), slope / scale) / scale for d in DAMPING])
            trials = np.where([f.log for f in free], np.clip(trials, -1.0, 1.0), trials)
            costs = np.zeros(len(trials))
            for e in range(len(self.experiments)):
                r = self.residuals(e, self.simulate(e, free, trials)[0])
                costs += np.einsum("ij,ij->i", r, r)
            moved = np.stack([f.at(t) for f, t in zip(free, trials.T)])
            away = (moved - np.array([[f.origin] for f in free])) / np.array([[f.sigma] for f in free])
            costs = np.where(np.isfinite(costs), costs + np.sum(away**2, axis=0), np.inf)
            best = int(np.argmin(costs))
            if not costs[best] < cost - close:
                break
            free = tuple(replace(f, value=float(v)) for f, v in zip(free, moved[:, best]))
        return fit

    def eased(self, free: Sequence[Free]) -> tuple[Free, ...]:
        """The free values with all gains of laws scaled down as far as the simulation starts best: a regression that
        looked at small motions may ask for too much."""
        gains = np.array([isinstance(f.target, str) and not f.log and f.sigma == np.inf for f in free])
        if not gains.any():
            return tuple(free)
        shares = np.array([1.0, 0.7, 0.5, 0.3, 0.15, 0.07, 0.03, 0.0])
        shifts = np.outer(shares - 1.0, np.where(gains, [f.value / f.unit for f in free], 0.0))
        costs = np.zeros(len(shares))
        for e in range(len(self.experiments)):
            r = self.residuals(e, self.simulate(e, free, shifts)[0])
            costs += np.einsum("ij,ij->i", r, r)
        best = int(np.argmin(np.where(np.isfinite(costs[:-1]), costs[:-1], np.inf)))
        return tuple(replace(f, value=float(f.at(shifts[best, i]))) for i, f in enumerate(free))

    def complete(self, fit: Fit) -> Fit:
        """The fit with all of its derivatives as they are where it ended."""
        return replace(fit, jacobian=self.linear(fit.free)[1])

    def linear(self, free: Sequence[Free], known: Mapping[int, Array] = {}) -> tuple[Array, Array, tuple[Array, ...]]:
        """Whitened residual [rows], minus its derivatives [rows, free], and the sensors simulated, at the free values."""
        blocks, rows, simulated = [], [], []
        for e in range(len(self.experiments)):
            own = [
                i for i, f in enumerate(free)
                if i not in known and not (isinstance(f.target, tuple) and f.target[0] == "start" and f.target[1] != e)
            ]  # fmt: skip
            step = 1e-3
            shifts = np.zeros((len(own) + 1, len(free)))
            for k, i in enumerate(own):
                shifts[k + 1, i] = step if free[i].at(step) != free[i].value else -step
            z, _ = self.simulate(e, free, shifts)
            r = self.residuals(e, z)
            block = np.zeros((r.shape[1], len(free)))
            for k, i in enumerate(own):
                block[:, i] = (r[0] - r[k + 1]) / shifts[k + 1, i]
            blocks.append(block)
            rows.append(r[0])
            simulated.append(np.array(z[0]))
        jacobian = np.concatenate(blocks)
        for i, column in known.items():
            jacobian[:, i] = column
        return np.concatenate(rows), jacobian, tuple(simulated)


def _folded(model: Model) -> Model:
    """The model with its networks as straight pieces where all of them are: the same forces, far sooner.
    Layer by layer where the float weights have more of them: neurons may switch between two neighbouring numbers."""
    networks = [n for s in model.sets.values() for n in s.networks.values()]
    if not networks or model.pieces or model.outside == "fade" or not all(map(fold.foldable, networks)):
        return model
    return replace(model, pieces=fold.room(max(fold.pieces(n, model.outside == "clamp") for n in networks)), more_pieces="layers")


_BATCHES: dict[tuple[object, ...], Batch] = {}
_MOVING: dict[tuple[object, ...], bool] = {}


def _structure(model: Model) -> tuple[object, ...]:
    """What models share that differ in values of parameters only."""
    shapes = {name: n.architecture for s in list(model.sets.values())[:1] for name, n in s.networks.items()}
    return repr(replace(model, parameters={}, sets={})), tuple(model.parameters), repr(shapes)


def moving(model: Model) -> bool:
    """Does anything in it depend on the rate of an input?"""
    key = _structure(model)
    if key not in _MOVING:
        causal = causalise(replace(model, interpolation="linear"))
        _MOVING[key] = causal.uses([*causal.rates, *causal.outputs, *causal.sensors], causal.input_rates)
    return _MOVING[key]


def _compiled(model: Model) -> Batch:
    """The batch library of a model."""
    key = _structure(model)
    if key not in _BATCHES:
        _BATCHES[key] = Batch(model)
    found = copy(_BATCHES[key])
    found.model = model
    return found


def _drive(e: Experiment, fine: int) -> Array:
    """Inputs with `fine` - 1 samples between each two, for a step that joins them by straight lines.

    At the samples they are what they are, for that is what sensors see. In between, the middle one is such that the
    integral over each interval, which moves the plant, is that of the smooth input; and of 4, the last is such that the
    line to the next sample has its rate, which sensors may see as well.
    """
    smooth = CubicSpline(e.time, e.drive)
    u, h = e.drive, e.step
    whole = np.diff(smooth.antiderivative()(e.time), axis=0) / h
    parts = np.empty((len(u) - 1, fine, u.shape[1]))
    parts[:, 0] = u[:-1]
    if fine == 2:
        parts[:, 1] = 2.0 * whole - 0.5 * (u[:-1] + u[1:])
    else:
        parts[:, 1] = smooth(e.time[:-1] + 0.25 * h)
        parts[:, 3] = u[1:] - 0.25 * h * e.rate[1:]
        parts[:, 2] = 4.0 * whole - 0.5 * (u[:-1] + u[1:]) - parts[:, 1] - parts[:, 3]
    return np.concatenate([parts.reshape(-1, u.shape[1]), u[-1:]])


def drifted(signals: Array, drift: Array) -> Array:
    """Signals [runs, n_z, n] by clocks that run fast by drifts [runs]: parabolas through the nearest three samples."""
    n = signals.shape[2]
    at = np.arange(n) * (1.0 + drift[:, None])
    near = np.clip(np.rint(at).astype(int), 1, n - 2)
    before, here, after = (np.take_along_axis(signals, (near + k)[:, None, :], axis=2) for k in (-1, 0, 1))
    part = (at - near)[:, None, :]
    return here + 0.5 * part * (after - before + part * (after - 2.0 * here + before))


def delayed(signals: Array, delay: Array, step: float) -> Array:
    """Signals [n, runs] later by delays [runs] [s]; before its start a signal is what it was there."""
    n = len(signals)
    lead = int(np.ceil(np.max(np.abs(delay)) / step)) + 16
    padded = np.concatenate([np.repeat(signals[:1], lead, 0), signals, np.repeat(signals[-1:], lead, 0)])
    size = fft.next_fast_len(len(padded), real=True)
    f = fft.rfftfreq(size, step)[:, None]
    return fft.irfft(fft.rfft(padded, size, axis=0) * np.exp(-2j * np.pi * f * delay), size, axis=0)[lead : lead + n]
