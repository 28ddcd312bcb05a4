# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Output-error fits: free parameters of a model, start states and sensors, so that the simulated sensors meet the measured.

An iteration tries several steps at once, one in each lane (see batch), and so simulates all finite differences where it needs new ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.interpolate import CubicSpline

from penode_gen.model import Model

from ..plant.between import CLOSE, joined, parts
from ..plant.compiling import compiled, folded, longest, moving, ordered
from ..plant.plant import KEPT, anonymous
from .noise import Experiment, Metric, Thinning, thinning

Array = NDArray[np.float64]
SPARSE = 16  # samples of which one is looked at for what is far beyond all bounds
FAR = 1e20  # residual of a run that cannot be simulated, and the most that it shows
MOVE = 1e-6  # of a unit: finite differences. Larger ones make a common scale of all forces, or a common offset, look nonlinear
PROMISE = 0.7  # of the gain that a full step predicts: if that is reached, the derivatives have hardly changed
DAMPING = np.array([0.0, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0])  # of steps, relative to the curvature


@dataclass(frozen=True, eq=False)
class Series:
    """What is added to an input: a signal [n] for each recording; of a hold also its period [s]."""

    signals: Sequence[Array]
    period: float = 0.0


# a parameter's name, (what is wrong with it, input or sensor), (.., recording, state), (.., recording, parameter), or (.., input, series)
Target = (
    str | tuple[str, int] | tuple[Literal["start"], int, int] | tuple[Literal["own"], int, str] | tuple[Literal["input_added"], int, Series]
)


@dataclass(frozen=True)
class Free:
    """Something to be fitted. `unit` steps of it are natural; a `log` one stays positive. `sigma`: its prior."""

    target: Target
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

    @property
    def slope(self) -> float:
        """Of the value with a shift."""
        return self.value if self.log else self.unit

    def of(self, what: str, recording: int) -> bool:
        """Is it a start state, or an own value, of a recording?"""
        return self.target[0] == what and self.target[1] == recording

    def alone(self, recording: int) -> Free:
        """As the only recording of a problem has it: start states of this one are those of 0, those of others are nobody's."""
        match self.target:
            case "start", own, state:
                return replace(self, target=("start", 0 if own == recording else -1, state))
        return self

    def at(self, shift: Array | float) -> Array:
        """Values after shifts by so many units."""
        moved = self.value * np.exp(shift) if self.log else self.value + shift * self.unit
        found: Array = np.minimum(np.maximum(moved, self.low), self.high)  # np.clip takes several times as long for a number
        return found


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

    def value(self, target: Target) -> float:
        return next(f.value for f in self.free if f.target == target)

    def covariance(self) -> Array:
        """Covariance of all free values, in their units (log: relative). None is off by more than a factor of FAR: else the least slope
        along the time constant of a cooling that nothing shows would make a well-known loss uncertain."""
        priors = np.array([max(abs(f.slope) / f.sigma, f.log / np.log(FAR)) ** 2 for f in self.free])
        curvature = self.jacobian.T @ self.jacobian + np.diag(priors)
        scale = 1.0 / np.sqrt(np.maximum(np.diag(curvature), 1e-300))
        return np.linalg.pinv(curvature * np.outer(scale, scale), rcond=1e-10) * np.outer(scale, scale)

    def steps(self) -> tuple[Array, float]:
        """Steps [DAMPING, free] towards the least chi2 with priors, and how much of it the full one promises to take."""
        precision = np.array([f.slope / f.sigma for f in self.free])
        curvature = self.jacobian.T @ self.jacobian + np.diag(precision**2)
        slope = self.jacobian.T @ self.residual - precision * np.array([f.offset for f in self.free])
        stuck = [(f.value <= f.low and s <= 0.0) or (f.value >= f.high and s >= 0.0) for f, s in zip(self.free, slope, strict=True)]
        slope[stuck] = curvature[stuck] = curvature[:, stuck] = 0.0  # it would go beyond its bound
        scale = np.sqrt(np.maximum(np.diag(curvature), 1e-30))
        normed = curvature / np.outer(scale, scale)
        found = np.array([np.linalg.solve(normed + (1e-10 + d) * np.eye(len(scale)), slope / scale) / scale for d in DAMPING])
        return np.where([f.log for f in self.free], np.clip(found, -1.0, 1.0), found), float(found[0] @ slope)

    def secant(self, free: tuple[Free, ...], residual: Array) -> Fit:
        """The fit at values near its own, where `residual` has been simulated; derivatives differ from its own by what that shows of
        them on the way there (Broyden 1965), in units in which all are as large. The sensors are those of before."""
        way = np.array(
            [np.log(new.value / f.value) if f.log else (new.value - f.value) / f.unit for f, new in zip(self.free, free, strict=True)]
        )
        weight = way * np.sum(self.jacobian**2, axis=0)
        missed = self.residual - residual - self.jacobian @ way
        chi2 = float(residual @ residual)
        size = float(weight @ way)
        jacobian = self.jacobian + np.outer(missed, weight / size) if size > 0.0 else self.jacobian  # what nothing shows stays
        return replace(self, free=free, chi2=chi2, cost=chi2 + float(sum(f.offset**2 for f in free)), residual=residual, jacobian=jacobian)


class Problem:
    """A model against recordings in their metrics."""

    def __init__(
        self, model: Model, experiments: Sequence[Experiment], metrics: Sequence[Metric], set_name: str = "default", fastest: float = 0.0
    ):
        self.model, self.experiments, self.metrics, self.set_name = model, experiments, metrics, set_name
        self.fastest = fastest
        self.moving = moving(model)
        close = model.sample_time <= CLOSE and all(e.held is None for e in experiments)
        self.fine = 1 if close else 3 if self.moving else 2  # see _drive
        step = model.sample_time / self.fine
        least = int(np.ceil(step / longest(model) - 1e-6))
        substeps = max(1, int(np.ceil(step * fastest / 0.1)), least, -(-model.substeps // self.fine))
        way = ("cubic" if self.moving else "parabola") if close else "linear"
        exact = replace(folded(model), method="rk4", interpolation=way, substeps=substeps, sample_time=step)
        self.batch = compiled(anonymous(exact), ordered(model)[0])
        self.inputs = [
            e.drive if close else _drive(e, self.fine) if model.inputs else np.zeros((self.fine * (len(e.time) - 1) + 1, 0))
            for e in experiments
        ]

    @cached_property
    def halved(self) -> Problem | None:
        """The same with every second sample, where that is close enough for whatever moves and all samples are good: the same residuals
        in half of the time."""
        return self._half() if 2.0 * self.model.sample_time <= longest(self.model) else None

    def _half(self) -> Problem | None:
        twice = 2.0 * self.model.sample_time
        even = self.model.fits(twice) and all(e.good.all() and len(e.time) % 2 == 0 and e.held is None for e in self.experiments)
        if not even or twice > CLOSE * (1.0 + 1e-9):
            return None
        halves = [_halved(e) for e in self.experiments]
        metrics = [replace(m, n=m.n // 2, root=2.0 * m.root) for m in self.metrics]
        return Problem(replace(self.model, sample_time=twice), halves, metrics, self.set_name, self.fastest)

    def _doubled(self, fit: Fit) -> Fit:
        """A fit of every second sample as one of all."""
        signals = zip(self.experiments, fit.simulated, strict=True)
        whole = tuple(CubicSpline(e.time[::2], z)(e.time) for e, z in signals)
        return replace(fit, model=self.model, simulated=whole)

    def simulate(self, e: int, free: Sequence[Free], shifts: Array, states: Sequence[str] = ()) -> tuple[Array, Array]:
        """Sensors [runs, n, n_z] and named states of recording e for shifts [runs, free]."""
        z, skews, x = self.sensors(e, free, shifts, states)
        if skews.any():
            z -= self.rates(e, z) * skews
        return z.transpose(2, 0, 1), x

    def rates(self, e: int, z: Array, run: int = 0) -> Array:
        """Rates [n, n_z, 1] of the sensors of one run; those of all runs are about the same."""
        return np.gradient(z[:, :, run, None], self.experiments[e].step, axis=0)

    def sensors(self, e: int, free: Sequence[Free], shifts: Array, states: Sequence[str] = ()) -> tuple[Array, Array, Array]:
        """The same as they lie in memory, [n, n_z, runs], but for skews [n_z, runs] whose rates are still to be taken away."""
        start = np.tile(np.array(self.model.start, dtype=float), (len(shifts), 1))
        parameters, of_sensors = {}, []
        for f, shift in zip(free, shifts.T, strict=True):
            values = f.at(shift)
            match f.target:
                case str(name):
                    parameters[name] = values
                case "own", recording, name if recording == e:
                    parameters[name] = values
                case "start", recording, state if recording == e:
                    start[:, state] = values
                case what, j:
                    of_sensors.append((what, j, values))
        run = self.batch.run(self.inputs[e], x0=start, parameters=parameters, set_name=self.set_name, states=states, every=self.fine)
        z = run.z.transpose(1, 2, 0)  # [n, n_z, runs], as they lie in memory
        if self.moving and self.fine == 1 and len(z) > 4:
            for k in (1, 0):  # the step knows no rate of an input at its first sample, and at the next one only how much it changed
                z[k] = 3.0 * (z[k + 1] - z[k + 2]) + z[k + 3]
        elif self.moving and len(z) > 2:
            z[0] = 2.0 * z[1] - z[2]
        z[:, :, run.first_bad >= 0] = 1e30
        skews = np.zeros(z.shape[1:])
        for what, j, values in of_sensors:
            if what == "bias":
                z[:, j] += values
            else:
                skews[j] = values
        return z, skews, run.x

    def residuals(self, e: int, z: Array, skews: Array) -> Array:
        """Whitened residuals [runs, rows] of the result of `sensors`."""
        thin, good, measured = _thinned(self.experiments[e])
        with np.errstate(over="ignore", invalid="ignore"):  # some runs leave all bounds
            spectra = thin(z, good)  # [n_z, runs, f]
            if skews.any():
                step = self.experiments[e].step
                sane = int(np.argmin(np.max(np.abs(z[::SPARSE]), axis=(0, 1))))  # a run that has not left all bounds
                rates = thin.rates(z[:, :, sane], spectra[:, sane], step) if good is None else thin(self.rates(e, z, sane), good)
                spectra -= rates.reshape(len(spectra), 1, -1) * skews[:, :, None]
            spectra = measured - spectra
            white = self.metrics[e].white(spectra.transpose(1, 2, 0))
            white[~(np.sum(np.abs(white), axis=1) < FAR)] = FAR
        return white

    def solve(self, free: Sequence[Free], iterations: int = 12, close: float = 0.05) -> Fit:
        """The best free values from those given on, by damped Gauss-Newton; stops where a step gains less than `close`, or promises to.

        The full step and three of the dampings around that of the step before are tried at once, then the others if none of these gains.
        After a full step that kept its promise, derivatives are not simulated but go on from those of before (see `secant`); a fit does
        not end with such.
        """
        if self.halved is not None:
            return self._doubled(self.halved.solve(free, iterations, close))
        fresh, damping = True, len(DAMPING) // 2
        fit = self.at(tuple(free))
        for _ in range(iterations):
            trials, promised = fit.steps()
            ended = not np.isfinite(fit.cost) or promised < close
            near = min(max(damping - 1, 1), len(DAMPING) - 3)
            some = [0, near, near + 1, near + 2]
            for tried in (some, [d for d in range(len(DAMPING)) if d not in some]) if not ended else ():
                residuals, moved, costs = self._tried(fit.free, trials[tried])
                best = int(np.argmin(costs))
                damping, gained = tried[best], fit.cost - costs[best]
                ended = not gained >= close
                if gained > 0.0:
                    break
            if ended and fresh:
                break
            if ended:
                fit, fresh = self.at(fit.free), True
                continue
            there = _put(fit.free, moved[:, best])
            fresh = damping > 0 or gained < PROMISE * promised
            fit = self.at(there) if fresh else fit.secant(there, residuals[best])
        return fit if fresh else self.at(fit.free)

    def _tried(self, free: Sequence[Free], steps: Array) -> tuple[Array, Array, Array]:
        """Residuals [steps, rows], values [free, steps] and costs after steps [steps, free]."""
        residuals = np.concatenate([self.residuals(e, *self.sensors(e, free, steps)[:2]) for e in range(len(self.experiments))], axis=1)
        moved = np.stack([f.at(t) for f, t in zip(free, steps.T, strict=True)])
        away = (moved - np.array([[f.origin] for f in free])) / np.array([[f.sigma] for f in free])
        costs = np.einsum("ij,ij->i", residuals, residuals) + np.sum(away**2, axis=0)
        return residuals, moved, np.where(np.isfinite(costs), costs, np.inf)

    def at(self, free: tuple[Free, ...]) -> Fit:
        """The fit that ends at these free values."""
        residual, jacobian, simulated = self.linear(free)
        chi2 = float(residual @ residual)
        cost = chi2 + float(sum(f.offset**2 for f in free))
        return Fit(self.model, free, chi2, cost, residual, jacobian, simulated)

    def linear(self, free: Sequence[Free]) -> tuple[Array, Array, tuple[Array, ...]]:
        """Whitened residual [rows], minus its derivatives [rows, free], and the sensors simulated, at the free values."""
        blocks, rows, simulated = [], [], []
        for e in range(len(self.experiments)):
            own = [i for i, f in enumerate(free) if not (f.target[0] in ("start", "own") and f.target[1] != e)]
            lanes = self.batch.lanes
            shifts = np.zeros((-(-(len(own) + 1) // lanes) * lanes, len(free)))  # whole vectors lie closely in memory
            for k, i in enumerate(own):
                shifts[k + 1, i] = MOVE if free[i].at(MOVE) != free[i].value else -MOVE
            z, skews, _ = self.sensors(e, free, shifts)
            r = self.residuals(e, z, skews)
            block = np.zeros((len(free), r.shape[1]))
            for k, i in enumerate(own):
                block[i] = (r[0] - r[k + 1]) / shifts[k + 1, i]
            blocks.append(block)
            rows.append(r[0])
            bounded = np.clip(z[:, :, :1], -FAR, FAR)
            simulated.append(bounded[:, :, 0] - self.rates(e, bounded)[:, :, 0] * skews[:, 0])
        return np.concatenate(rows), np.concatenate(blocks, axis=1).T, tuple(simulated)


@lru_cache(maxsize=KEPT)
def _halved(e: Experiment) -> Experiment:
    """Every second sample of an experiment, of its sensors after what they show above half of the frequencies is taken away; but not
    from the line between their ends, for transforms see a jump there, in every second sample as in those that are simulated."""
    n = len(e.time) // 2
    line = e.y[:1] + np.linspace(0.0, 1.0, len(e.time))[:, None] * (e.y[-1:] - e.y[:1])
    low = fft.irfft(fft.rfft(e.y - line, axis=0)[: n // 2 + 1], n, axis=0) / 2.0 + line[::2]
    return replace(
        e,
        time=e.time[::2],
        u=e.u[::2],
        y=low,
        good=e.good[::2],
        drive=e.drive[::2],
        rate=e.rate[::2],
        unsure=e.unsure[: n // 2 + 1],
        quiet=e.quiet[: n // 2 + 1],
    )


def _put(free: Sequence[Free], values: Array) -> tuple[Free, ...]:
    return tuple(replace(f, value=float(v)) for f, v in zip(free, values, strict=True))


@lru_cache(maxsize=KEPT)
def _thinned(e: Experiment) -> tuple[Thinning, NDArray[np.bool_] | None, NDArray[np.complex128]]:
    """How signals of an experiment are thinned, where they are good (None: everywhere), and spectra [n_z, 1, f] of its own."""
    thin, good = thinning(len(e.time), e.band), None if e.good.all() else e.good
    return thin, good, thin(e.y[:, :, None], good)


@lru_cache(maxsize=KEPT)
def _drive(e: Experiment, fine: int) -> Array:
    """Inputs with `fine` - 1 samples between each two, see `between`."""
    return joined(e.stepped(parts(e.time, e.drive, e.rate, fine)), e.drive)
