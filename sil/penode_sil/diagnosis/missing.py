# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The force that is missing at each place, sample by sample and without a law, and how much of the residual it explains alone.

What a simulation misses moves by the plant linearised about it, driven by an unknown force at one place. That force wanders: itself,
or its rate, is a random walk, of the strength under which the recordings are most likely. A Kalman filter gives the likelihood and
a smoother the force (Bryson and Frazier 1963), both stationary, mode by mode. The free values of the fit (parameters within
their tolerance, start states) are estimated beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import linalg
from scipy.signal import lfilter

from .fit import Free, Problem
from .noise import Experiment
from .plant import Place
from .study import Study

Array = NDArray[np.float64]
STRENGTHS = np.logspace(-2.0, 8.0, 11)  # of the walk: its variance after a second, in squares of `_unit`; then finer around the best
FINER = np.logspace(-0.75, 0.75, 7)
PACE = 1e3  # [1/s^2] variance of a force's rate over that of the force: strengths of both orders are then alike
ORDERS = (1, 2)  # random walk of the force, or of its rate
FORGETS = 10.0  # recordings after which a walk has forgotten where it was: accelerations do not show a constant force
SHIFT = 0.02  # units by which free values are moved for derivatives


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
            "place": self.place.name, "ends": list(self.place.ends), "unit": self.place.unit("N"), "missing_rms": float(f"{size:.5g}"),
            "share": float(f"{self.share:.5g}"),
        }  # fmt: skip


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
            p = linalg.solve_discrete_are(f.T, h.T, noise, np.eye(len(h)))
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
        """States [n, x] foretold before each sample of y [n, sensors]."""
        return recursion(self.step, np.vstack([np.zeros((1, len(self.step))), y[:-1] @ self.gain.T]))

    def innovations(self, y: Array) -> Array:
        """White [n, sensors] if y is what the walk makes."""
        return (y - self.predictions(y) @ self.out.T) @ self.root.T

    def smoothed(self, y: Array) -> Array:
        """States [n, x] as they most likely were, by the innovations still to come: no covariance is inverted."""
        before = self.predictions(y)
        pulls = (y - before @ self.out.T) @ self.precision @ self.out
        return before + recursion(self.step.T, pulls[::-1])[::-1] @ self.spread


def recursion(a: Array, drive: Array) -> Array:
    """x[k] = a x[k-1] + drive[k] from rest, [n, x]: mode by mode."""
    values, modes = np.linalg.eig(a)
    if np.linalg.cond(modes) < 1e10:
        parts = np.linalg.solve(modes, drive.T.astype(complex))
        found = np.stack([lfilter([1.0], [1.0, -value], part) for value, part in zip(values, parts)])
        return np.real(modes @ found).T
    x, found = np.zeros(len(a)), np.empty_like(drive)
    for k, d in enumerate(drive):
        x = found[k] = a @ x + d
    return found


def missing_forces(study: Study) -> tuple[Missing, ...]:
    """For all places, those that explain most first."""
    parts = [_Recording.of(study, k) for k in range(len(study.experiments))]
    nothing = sum(float(np.sum(p.residual**2)) for p in parts)
    count = sum(p.residual.size for p in parts)
    found = [m for k in range(len(study.places)) if (m := _at(study, k, parts, nothing, count)) is not None]
    return tuple(sorted(found, key=lambda m: m.left))


@dataclass(frozen=True, eq=False)
class _Recording:
    """What a fit leaves of a recording, in deviations of its sensors' noise [n, measured], and what free values [free] do to that."""

    experiment: Experiment
    sensors: tuple[int, ...]
    sigma: Array
    residual: Array
    slopes: Array  # [free, n, measured]

    @staticmethod
    def of(study: Study, k: int) -> _Recording:
        e, fit = study.experiments[k], study.null
        own = tuple(j for j in range(e.y.shape[1]) if e.good[:, j].any())
        declared = np.array([s.noise for s in study.model.sensors])
        quiet = np.sqrt(np.min(study.levels[k], axis=0))  # a force that is missing is no noise
        sigma = np.where(declared > 0.0, declared, quiet)[list(own)]
        problem = Problem(study.model, [e], (), study.set_name, study.linear.fastest, fit.faults)
        free = [_of(f, k) for f in fit.free]
        moves = np.vstack([np.zeros(len(free)), SHIFT * np.eye(len(free))])
        z = problem.simulate(0, free, moves)[0][:, :, list(own)] / sigma
        rest = e.y[:, list(own)] / sigma - z[0]
        at = np.arange(len(rest))
        for c, j in enumerate(own):
            rest[:, c] = np.interp(at, at[e.good[:, j]], rest[e.good[:, j], c])
        return _Recording(e, own, sigma, rest, (z[1:] - z[0]) / SHIFT)


def _of(f: Free, k: int) -> Free:
    """A free value as the only recording of a problem has it: start states of recording k are those of 0, those of others are nobody's."""
    if isinstance(f.target, str) or f.target[0] != "start":
        return f
    return replace(f, target=("start", 0 if f.target[1] == k else -1, f.target[2]))


def _at(study: Study, place: int, parts: Sequence[_Recording], nothing: float, count: int) -> Missing | None:
    """The force at one place, under the walk that is likeliest for what the fit leaves."""
    tried = [(_volume(study, place, parts, order, q), q, order) for order in ORDERS for q in STRENGTHS]
    _, centre, order = min(tried)
    tried += [(_volume(study, place, parts, order, q), q, order) for q in centre * FINER]
    least, strength, order = min(tried)
    if not np.isfinite(least):
        return None
    walks = [_walk(study, place, p, order, strength) for p in parts]
    left, shift = _regressed(study, parts, walks)
    forces, rest = [], 0.0
    for p, walk in zip(parts, walks):
        y = p.residual - np.tensordot(shift, p.slopes, 1)
        x = walk.smoothed(y)
        forces.append(x[:, len(study.linear.a)] * _unit(study, place, p))
        rest += float(np.sum((y - x @ walk.out.T) ** 2))
    share = (nothing - rest) / max(nothing - count, 1.0)
    return Missing(study.places[place], tuple(forces), left, float(np.clip(share, 0.0, 1.0)))


def _volume(study: Study, place: int, parts: Sequence[_Recording], order: int, strength: float) -> float:
    """-2 log likelihood of a walk, free values as they are; infinite where there is none."""
    total = 0.0
    for p in parts:
        walk = _walk(study, place, p, order, strength)
        if walk is None:
            return np.inf
        total += float(np.sum(walk.innovations(p.residual) ** 2)) + len(p.residual) * walk.volume
    return total if np.isfinite(total) else np.inf


def _unit(study: Study, place: int, p: _Recording) -> float:
    """The force that would make so much of a residual where sensors see it best: walks are counted in it."""
    f = p.experiment.frequencies[1 : p.experiment.band]
    seen = study.linear.transfer(p.experiment.frequencies)[1 : p.experiment.band, list(p.sensors), study.linear.n_inputs + place]
    most = float(np.max(np.abs(seen) / p.sigma)) if len(f) else 0.0
    return max(float(np.sqrt(np.mean(p.residual**2))), 1.0) / most if most > 0.0 else 1.0


def _walk(study: Study, place: int, p: _Recording, order: int, strength: float) -> Walk | None:
    """The plant under a wandering force at a place: states, then the force and, of order 2, its change in a sample."""
    linear, step = study.linear, p.experiment.step
    unit, n = _unit(study, place, p), len(linear.a)
    b, d = linear.b[:, linear.n_inputs + place] * unit, linear.d[list(p.sensors), linear.n_inputs + place] * unit
    block = np.zeros((n + 2, n + 2))  # a force that goes straight from sample to sample
    block[:n, :n], block[:n, n], block[n, n + 1] = linear.a * step, b * step, 1.0
    whole = linalg.expm(block)
    now, next_ = whole[:n, n] - whole[:n, n + 1], whole[:n, n + 1]
    keep = np.exp(-step / (FORGETS * step * len(p.residual)))
    f, into = np.zeros((n + order, n + order)), np.zeros(n + order)
    f[:n, :n] = whole[:n, :n] * keep
    f[n, n] = keep
    into[n] = 1.0
    if order == 2:
        f[n, n + 1] = f[n + 1, n + 1] = keep
        into[n] = into[n + 1] = 1.0
    f[:n, n:] = np.outer(next_, f[n, n:])
    f[:n, n] += now
    into[:n] = next_ * into[n]
    h = np.zeros((len(p.sensors), n + order))
    h[:, :n], h[:, n] = linear.c[list(p.sensors)] / p.sigma[:, None], d / p.sigma
    return Walk.of(f, strength * step * (PACE * step**2) ** (order - 1) * np.outer(into, into), h)


def _regressed(study: Study, parts: Sequence[_Recording], walks: Sequence[Walk]) -> tuple[float, Array]:
    """-2 log likelihood, and the shifts of the free values under which it is least, within their priors."""
    free = study.null.free
    rows = [np.stack([w.innovations(s).ravel() for s in p.slopes], axis=1) for p, w in zip(parts, walks)] if free else []
    r = np.concatenate([w.innovations(p.residual).ravel() for p, w in zip(parts, walks)])
    volume = sum(len(p.residual) * w.volume for p, w in zip(parts, walks))
    if not free:
        return float(r @ r) + volume, np.zeros(0)
    whole = np.vstack([*rows, np.diag([f.unit / f.sigma for f in free])])
    r = np.concatenate([r, [-f.offset for f in free]])
    shift = np.linalg.lstsq(whole, r, rcond=1e-12)[0]
    left = r - whole @ shift
    return float(left @ left) + volume, shift
