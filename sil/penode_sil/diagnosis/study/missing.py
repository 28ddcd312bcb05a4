# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The force that is missing at each place, sample by sample and without a law, and how much of the residual it explains alone.

What a simulation misses moves by the plant linearised about it, driven by an unknown force at one place. Its rate is a
random walk, of the strength under which the recordings are most likely. A Kalman filter gives the likelihood and
a smoother the force (Bryson and Frazier 1963), both stationary, mode by mode. The free values of the fit (parameters within
their tolerance, start states) are estimated beside it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.optimize import lsq_linear
from scipy.signal import lfilter

from penode_gen.model import Element, Input, Model

from ..plant.plant import Linear, Place, extend, linearise
from .fit import Free, Problem
from .noise import Experiment
from .study import Study

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Effort:
    """Settings of the estimate. `strengths`: variance of a force's rate after a second, in squares of `_unit` times `pace` [1/s^2];
    `finer`: factors around the best. `forgets`: memory of the filter, in lengths of the recording, because accelerations do not show a
    constant force. `shift`: units by which free values are moved for derivatives. The `refined` places that explain most are looked at
    `again`, about the free values found there, so many times each."""

    strengths: tuple[float, ...] = (1.0, 30.0, 1e3, 3e4, 1e6, 3e7)
    finer: tuple[float, ...] = (0.18, 1.0, 5.6)
    pace: float = 1e3
    forgets: float = 10.0
    shift: float = 0.02
    refined: int = 2
    again: int = 3


EFFORT = Effort()


@dataclass(frozen=True, eq=False)
class Missing:
    """Force at a place [N] or [N*m], per recording [n]; `left`: -2 log likelihood with it, up to a constant; `share`: what it explains
    alone of the power that the fit leaves beyond noise."""

    place: Place
    forces: tuple[Array, ...]
    left: float
    share: float

    def numbers(self) -> dict[str, Any]:
        """As in diagnosis.json."""
        size = float(np.sqrt(np.mean(np.concatenate(self.forces) ** 2)))
        return {
            "place": self.place.name,
            "ends": list(self.place.ends),
            "unit": self.place.unit("N"),
            "missing_rms": float(f"{size:.5g}"),
            "share": float(f"{self.share:.5g}"),
        }


@dataclass(frozen=True, eq=False)
class Walk:
    """A stationary filter and smoother: x' = f x + noise, y = h x + noise of deviation 1."""

    step: Array  # of the prediction from one sample to the next, f (1 - k h)
    gain: Array  # f k
    out: Array  # h
    spread: Array  # covariance of the prediction
    precision: Array  # of innovations
    root: Array  # turns innovations white
    volume: float  # log determinant of their covariance

    @staticmethod
    def of(f: Array, noise: Array, h: Array) -> Walk | None:
        """None where there is none: a walk that no sensor sees."""
        try:
            p = _riccati(f, noise, h)
            s = h @ p @ h.T + np.eye(len(h))
            low = np.linalg.cholesky(s)
        except (np.linalg.LinAlgError, ValueError):
            return None
        root = linalg.solve_triangular(low, np.eye(len(s)), lower=True)
        precision = root.T @ root
        gain = f @ p @ h.T @ precision
        step = f - gain @ h
        if not np.max(np.abs(np.linalg.eigvals(step))) < 1.0:
            return None
        return Walk(step, gain, h, p, precision, root, 2.0 * float(np.sum(np.log(np.diag(low)))))

    def predictions(self, y: Array) -> Array:
        """States [n, x, any] predicted before each sample of y [n, sensors, any]."""
        drive = np.einsum("xs,ns...->nx...", self.gain, y[:-1])
        return recursion(self.step, np.concatenate([np.zeros_like(drive[:1]), drive]))

    def innovations(self, y: Array) -> Array:
        """White [n, sensors, any] if y is what the walk makes."""
        white: Array = np.einsum("rs,ns...->nr...", self.root, y - np.einsum("sx,nx...->ns...", self.out, self.predictions(y)))
        return white

    def smoothed(self, y: Array) -> Array:
        """States [n, x] as they most likely were, by the innovations still to come: no covariance is inverted."""
        before = self.predictions(y)
        pulls = (y - before @ self.out.T) @ self.precision @ self.out
        return before + recursion(self.step.T, pulls[::-1])[::-1] @ self.spread


def _riccati(f: Array, noise: Array, h: Array) -> Array:
    """Covariance of stationary predictions. States are counted in their deviations, which differ by many powers of ten. Raises
    LinAlgError."""
    with np.errstate(invalid="ignore"):  # balancing of states that differ by more than doubles can
        p = linalg.solve_discrete_are(f.T, h.T, noise, np.eye(len(h)))
    size = np.sqrt(np.maximum(np.diag(p), 1e-300))
    f, h, noise = f * size / size[:, None], h * size, noise / np.outer(size, size)
    p = linalg.solve_discrete_are(f.T, h.T, noise, np.eye(len(h)))
    for _ in range(50):  # what rounding has left
        k = np.linalg.solve(h @ p @ h.T + np.eye(len(h)), h @ p).T
        rest = np.eye(len(f)) - k @ h
        p = f @ (rest @ p @ rest.T + k @ k.T) @ f.T + noise
    whole: Array = 0.5 * (p + p.T) * np.outer(size, size)
    return whole


def recursion(a: Array, drive: Array) -> Array:
    """x[k] = a x[k-1] + drive[k] from rest, [n, x, any]: mode by mode. Without states, as without motion, nothing."""
    if not len(a):
        return drive
    values, modes = np.linalg.eig(a)
    if np.linalg.cond(modes) < 1e10:
        parts = np.tensordot(np.linalg.inv(modes), drive.astype(complex), (1, 1))  # [x, n, any]
        found = np.stack([lfilter([1.0], [1.0, -value], part, axis=0) for value, part in zip(values, parts, strict=True)])
        return np.moveaxis(np.real(np.tensordot(modes, found, 1)), 0, 1)
    x, found = np.zeros_like(drive[0]), np.empty_like(drive)
    for k, d in enumerate(drive):
        x = found[k] = a @ x + d
    return found


def missing_forces(study: Study) -> tuple[Missing, ...]:
    """For all places, those that explain most first."""
    parts = [_Recording.of(study, k, study.null.free) for k in range(len(study.experiments))]
    nothing = sum(float(np.sum(p.residual**2)) for p in parts), sum(p.residual.size for p in parts)
    known = [(study.linear, study.linear.n_inputs + k) for k in range(len(study.places))]
    found = [_at(place, *way, study.null.free, parts, EFFORT.strengths) for place, way in zip(study.places, known, strict=True)]
    ranked = sorted((f for f in found if f is not None), key=lambda f: f.left)
    ranked[: EFFORT.refined] = [_again(study, f) for f in ranked[: EFFORT.refined]]
    return tuple(f.result(nothing) for f in sorted(ranked, key=lambda f: f.left))


@dataclass(frozen=True, eq=False)
class _Found:
    """A force at a place under the likeliest walk, and the free values beside it."""

    place: Place
    left: float
    strength: float
    free: tuple[Free, ...]
    forces: tuple[Array, ...]
    rest: float

    def result(self, nothing: tuple[float, int]) -> Missing:
        share = (nothing[0] - self.rest) / max(nothing[0] - nothing[1], 1.0)
        return Missing(self.place, self.forces, self.left, float(np.clip(share, 0.0, 1.0)))


def _again(study: Study, found: _Found) -> _Found:
    """The same about the free values and along the motion that were found: what a parameter does depends on both."""
    probe = Element("missing", found.place.ends, "expression", expression="missing_force")
    acting = extend(study.model, [probe], {}, [found.place])
    acting = replace(acting, inputs=(*acting.inputs, Input("missing_force", found.place.unit("N"))))
    for again in range(EFFORT.again):
        values = {f.target: f.value for f in found.free if isinstance(f.target, str)}
        known = {n: replace(p, value=values.get(n, p.value)) for n, p in study.model.parameters.items()}
        if study.model.networks:
            linear, column = study.linear, study.linear.n_inputs + study.places.index(found.place)
        else:
            start = np.array([study.model.start])
            linear = linearise(replace(study.model, parameters=known), [found.place], start, study.experiments[0].u[:1])
            column = linear.n_inputs
        parts = [_Recording.of(study, k, found.free, acting, force) for k, force in enumerate(found.forces)]
        parts = [replace(p, residual=p.residual + _answer(linear, column, p, force)) for p, force in zip(parts, found.forces, strict=True)]
        strengths = EFFORT.strengths if again < EFFORT.again - 1 else tuple(found.strength * x for x in EFFORT.finer)
        better = _at(found.place, linear, column, found.free, parts, strengths)
        if better is None:
            return found
        found = better
    return found


def _answer(linear: Linear, column: int, p: _Recording, force: Array) -> Array:
    """What the linear plant makes of a force [n], in deviations of the sensors [n, measured]."""
    f, h = _discrete(linear, column, p, 1.0)
    n = len(linear.a)
    after = np.append(force[1:], force[-1])
    drive = np.outer(force, f[:n, n] - f[:n, n + 1]) + np.outer(after, f[:n, n + 1])
    x = recursion(f[:n, :n], np.vstack([np.zeros((1, n)), drive[:-1]]))
    return x @ h[:, :n].T + np.outer(force, h[:, n])


@dataclass(frozen=True, eq=False)
class _Recording:
    """What a fit leaves of a recording, in deviations of its sensors' noise [n, measured], and what free values do to that."""

    experiment: Experiment
    sensors: tuple[int, ...]
    sigma: Array
    residual: Array
    slopes: Array  # [n, measured, free]

    @staticmethod
    def of(study: Study, k: int, free: Sequence[Free], acting: Model | None = None, force: Array | None = None) -> _Recording:
        """About free values; `acting`: a model with one more input, `force` [n]."""
        e = study.experiments[k]
        own = tuple(j for j in range(e.y.shape[1]) if e.good[:, j].any())
        declared = np.array([s.noise for s in study.model.sensors])
        quiet = np.sqrt(np.min(study.levels[k], axis=0))  # a force that is missing is no noise
        sigma = np.where(declared > 0.0, declared, quiet)[list(own)]
        driven = (
            e
            if force is None
            else replace(
                e,
                u=_beside(e.u, force),
                drive=_beside(e.drive, force),
                rate=_beside(e.rate, np.gradient(force, e.step)),
                unsure=_beside(e.unsure, np.zeros(len(e.unsure))),
                held=None if e.held is None else np.append(e.held, False),
            )
        )
        problem = Problem(acting or study.model, [driven], (), study.set_name, study.linear.fastest)
        moves = np.vstack([np.zeros(len(free)), EFFORT.shift * np.eye(len(free))])
        z = problem.simulate(0, [replace(f.alone(k), low=-np.inf, high=np.inf) for f in free], moves)[0][:, :, list(own)] / sigma
        rest = e.y[:, list(own)] / sigma - z[0]
        at = np.arange(len(rest))
        for c, j in enumerate(own):
            rest[:, c] = np.interp(at, at[e.good[:, j]], rest[e.good[:, j], c])
        return _Recording(e, own, sigma, rest, np.moveaxis((z[1:] - z[0]) / EFFORT.shift, 0, -1))


def _beside(columns: Array, more: Array) -> Array:
    return np.hstack([columns, more[:, None]])


def _at(
    place: Place, linear: Linear, column: int, free: tuple[Free, ...], parts: Sequence[_Recording], strengths: Sequence[float]
) -> _Found | None:
    """The force of one place, column of the inputs of a plant, under the likeliest walk; None where no sensor sees it."""
    units = [_unit(linear, column, p) for p in parts]

    def walking(strength: float) -> list[Walk] | None:
        walks = [w for p, unit in zip(parts, units, strict=True) if (w := _walk(linear, column, p, unit, strength))]
        return walks if len(walks) == len(parts) else None

    if (shift := next((_shifts(free, parts, walks) for s in reversed(EFFORT.strengths) if (walks := walking(s))), None)) is None:
        return None
    found = [(_left(free, parts, walks, shift), float(s), walks) for s in strengths if (walks := walking(s))]
    if not (found := [f for f in found if np.isfinite(f[0])]):
        return None
    left, strength, walks = min(found, key=lambda f: f[0])
    forces, rest = [], 0.0
    for p, walk, unit in zip(parts, walks, units, strict=True):
        y = p.residual - p.slopes @ shift
        fade = _fade(len(y))
        x = walk.smoothed(y * fade) / fade
        forces.append(x[:, len(linear.a)] * unit)
        rest += float(np.sum((y - x @ walk.out.T) ** 2))
    moved = tuple(replace(f, value=float(f.at(s))) for f, s in zip(free, shift, strict=True))
    return _Found(place, left, strength, moved, tuple(forces), rest)


def _unit(linear: Linear, column: int, p: _Recording) -> float:
    """The force whose effect on the sensors is as large as the residual, at the frequency where it shows best: the unit of the walks."""
    f = p.experiment.frequencies[1 : p.experiment.band]
    seen = linear.transfer(p.experiment.frequencies)[1 : p.experiment.band, list(p.sensors), column]
    most = float(np.max(np.abs(seen) / p.sigma)) if len(f) else 0.0
    return max(float(np.sqrt(np.mean(p.residual**2))), 1.0) / most if most > 0.0 else 1.0


def _discrete(linear: Linear, column: int, p: _Recording, unit: float) -> tuple[Array, Array]:
    """The plant from sample to sample under a force that goes straight between them: states, the force and its change in a sample; and
    what the sensors see of these, in their deviations."""
    step, n = p.experiment.step, len(linear.a)
    block = np.zeros((n + 2, n + 2))
    block[:n, :n], block[:n, n], block[n, n + 1] = linear.a * step, linear.b[:, column] * unit * step, 1.0
    whole = linalg.expm(block)
    f = np.zeros((n + 2, n + 2))
    f[:n, :n], f[:n, n], f[:n, n + 1] = whole[:n, :n], whole[:n, n], whole[:n, n + 1]
    f[n, n] = f[n, n + 1] = f[n + 1, n + 1] = 1.0
    h = np.zeros((len(p.sensors), n + 2))
    h[:, :n], h[:, n] = linear.c[list(p.sensors)], linear.d[list(p.sensors), column] * unit
    return f, h / p.sigma[:, None]


def _walk(linear: Linear, column: int, p: _Recording, unit: float, strength: float) -> Walk | None:
    """The plant under a force that is a random walk, for residuals weighted by `_fade`: what no sensor shows is forgotten in the end."""
    f, h = _discrete(linear, column, p, unit)
    n, step = len(linear.a), p.experiment.step
    into = np.concatenate([f[:n, n + 1], [1.0, 1.0]])
    return Walk.of(f * np.exp(-1.0 / (EFFORT.forgets * len(p.residual))), strength * EFFORT.pace * step**3 * np.outer(into, into), h)


def _limits(free: Sequence[Free]) -> tuple[Array, Array]:
    """How far free values may be shifted down and up."""
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.array([[np.log(end / f.value) if f.log else (end - f.value) / f.unit for end in (f.low, f.high)] for f in free])
    down, up = np.where(np.isnan(ends), np.inf, ends).T
    return np.where(np.isposinf(down), -np.inf, np.minimum(down, 0.0)), np.maximum(up, 0.0)


def _least(whole: Array, r: Array, down: Array, up: Array) -> Array:
    """Shifts within limits that leave least of r [rows] after whole [rows, free] (Stark and Parker 1995)."""
    size: Array = np.maximum(np.linalg.norm(whole, axis=0), 1e-300)
    scaled = whole / size
    root = np.linalg.cholesky(scaled.T @ scaled + 1e-12 * np.eye(len(size))).T
    reach = 1e-12  # limits must differ
    found = lsq_linear(
        root, linalg.solve_triangular(root.T, scaled.T @ r, lower=True), (down * size - reach, up * size + reach), method="bvls"
    )
    return np.clip(found.x / size, down, up)


def _fade(n: int) -> Array:
    """Weights [n, 1] of samples by which a stationary filter forgets and the plant stays what it is: the states of x' = f x, so weighted,
    are those of x' = c f x with c < 1, and noise is weighted by some percent. With c f and samples as they are, an angle of 10^6
    deviations of its sensor, held by no spring, would be off by 17 of them in each sample, and a force and damping found in it."""
    return np.exp(-(np.arange(0.0, n)[:, None] - 0.5 * (n - 1)) / (EFFORT.forgets * n))


def _innovations(parts: Sequence[_Recording], walks: Sequence[Walk], of: Callable[[_Recording], Array]) -> list[Array]:
    """White if `of` a recording is what the walk makes."""
    return [w.innovations(x * _fade(len(x)).reshape(-1, *[1] * (x.ndim - 1))) for p, w in zip(parts, walks, strict=True) for x in (of(p),)]


def _shifts(free: Sequence[Free], parts: Sequence[_Recording], walks: Sequence[Walk]) -> Array:
    """The likeliest shifts of the free values, within their priors and limits, beside a walk of the greatest strength: an effect
    that a force at this place has as well, as a torque has that of an inertia, is no evidence for them. With a smoother walk a part of the
    force would be taken for a change of a parameter (Rice 1986, Speckman 1988)."""
    if not free:
        return np.zeros(0)
    r = np.concatenate([x.ravel() for x in _innovations(parts, walks, lambda p: p.residual)] + [[-f.offset for f in free]])
    rows = [x.reshape(-1, len(free)) for x in _innovations(parts, walks, lambda p: p.slopes)]
    return _least(np.vstack([*rows, np.diag([f.unit / f.sigma for f in free])]), r, *_limits(free))


def _left(free: Sequence[Free], parts: Sequence[_Recording], walks: Sequence[Walk], shift: Array) -> float:
    """-2 log likelihood."""
    r = [x.ravel() for x in _innovations(parts, walks, lambda p: p.residual - p.slopes @ shift)]
    volume = sum(len(p.residual) * w.volume for p, w in zip(parts, walks, strict=True))
    return float(sum(x @ x for x in r) + sum((f.offset + f.unit * x / f.sigma) ** 2 for f, x in zip(free, shift, strict=True)) + volume)
