# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Fits of free values to innovations by damped Gauss-Newton, and their Laplace approximation."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..study.fit import MOVE, Free, Target
from .colour import Colour
from .observer import Filter, Predictor
from .prior import cost, precisions, slopes as prior_slopes

Array = NDArray[np.float64]
DAMPING = np.array([0.0, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 100.0])  # of steps, relative to the curvature


@dataclass(frozen=True, eq=False)
class Fit:
    """Where a fit ended. Innovations `nu` [updates, n_z] of all recordings in turn, `slopes` [updates, n_z, free] of them along the units
    of the free values, `used` [updates, n_z] what was fitted, `variance` [n_z] of the innovations, `likelihood` with these."""

    free: tuple[Free, ...]
    by: Filter
    nu: Array
    slopes: Array
    used: NDArray[np.bool_]
    variance: Array
    likelihood: float
    cost: float

    def value(self, target: Target) -> float:
        return next(f.value for f in self.free if f.target == target)

    @property
    def values(self) -> dict[str, float]:
        return {f.target: f.value for f in self.free if isinstance(f.target, str)}

    @cached_property
    def curvature(self) -> Array:
        """Of the negative log posterior, in units of the free values."""
        rows = (self.slopes / np.sqrt(self.variance)[None, :, None])[self.used]
        return rows.T @ rows + np.diag(precisions(self.free) ** 2)

    def covariance(self, known: Collection[Target] = ()) -> Array:
        """Of the free values, in their units (log: relative), where some targets are `known`."""
        c = np.array(self.curvature)
        at = [f.target in known for f in self.free]
        c[at, :] = c[:, at] = 0.0
        size = 1.0 / np.sqrt(np.maximum(np.diag(c), 1e-300))
        return np.linalg.pinv(np.nan_to_num(c * np.outer(size, size)), rcond=1e-12, hermitian=True) * np.outer(size, size)

    def deviation(self, target: Target, known: Collection[Target] = ()) -> float:
        """Standard deviation of a value, in its own unit, where some targets are `known`."""
        i = [f.target for f in self.free].index(target)
        f = self.free[i]
        return float(np.sqrt(self.covariance(known)[i, i])) * (abs(f.value) if f.log else f.unit)

    def taken(self, after: Fit, floor: Array) -> Array:
        """Share [n_z] of the power of each sensor's innovations beyond that of its noise, `floor` [n_z], that another fit takes away; what
        is within three deviations of an estimate of power from so many updates is noise."""
        count = np.maximum(np.sum(self.used, axis=0), 1)
        beyond: Array = np.maximum(self.variance - floor, 3.0 * np.sqrt(2.0 / count) * self.variance)
        return np.clip((self.variance - after.variance) / beyond, 0.0, 1.0)

    def taken_whole(self, after: Fit, floor: Array) -> float:
        """The same of all that is fitted, in the geometric mean."""
        count = max(int(np.sum(self.used)), 1)
        noise = float(np.sum(np.sum(self.used, axis=0) * np.minimum(floor / self.variance, 1.0))) / count
        all_of_it = 1.0 - float(np.exp(-2.0 * max(after.likelihood - self.likelihood, 0.0) / count))
        return min(all_of_it / max(1.0 - noise, 3.0 * float(np.sqrt(2.0 / count))), 1.0)

    def criterion(self) -> float:
        """Log marginal likelihood by Laplace (Kass and Raftery 1995, eq. 6), but for constants that all fits of the same data share:
        likelihood, priors, and the width of the posterior against theirs."""
        prior = np.array([(1.0 if f.log else f.unit) / f.sigma for f in self.free])
        own = prior > 0.0  # what has no prior is free in all fits
        return self.likelihood - sum(map(cost, self.free)) + float(np.sum(np.log(prior[own]))) - 0.5 * _log_determinant(self.curvature)


def _log_determinant(c: Array) -> float:
    """Of a curvature, each of its values in units of its own deviation first: where a neighbour of a fit diverges, slopes of 1e20 stand
    beside others, and the plain determinant rounds to 0, an infinite gain."""
    size = np.sqrt(np.maximum(np.diag(c), 1e-300))
    lengths = np.maximum(np.linalg.eigvalsh(c / np.outer(size, size)), 1e-12)
    return float(2.0 * np.sum(np.log(size)) + np.sum(np.log(lengths)))


def likelihood(nu: Array, used: NDArray[np.bool_], floor: Array) -> tuple[Array, float]:
    """Variance [n_z] of innovations, at least floor, and the log likelihood with it."""
    count = np.maximum(np.sum(used, axis=0), 1)
    squares = np.sum(np.where(used, nu, 0.0) ** 2, axis=0)
    variance = np.maximum(squares / count, floor)
    return variance, float(-0.5 * np.sum(np.sum(used, axis=0) * np.log(variance) + squares / variance))


@dataclass(frozen=True, eq=False)
class Problem:
    """Fits of a predictor's innovations, whitened by the `colour` of the sensors' noise."""

    predictor: Predictor
    colour: Colour

    @property
    def floor(self) -> Array:
        """Variance [n_z] that sensor noise alone leaves."""
        return self.colour.variance

    def nu(self, free: Sequence[Free], shifts: Array, by: Filter) -> Array:
        """[runs, updates, n_z], of all recordings in turn."""
        lanes = self.predictor.predict(free, shifts, by)[0]
        nu = self.whole(lanes.nu)
        nu[~lanes.sane] = np.where(np.isfinite(nu[~lanes.sane]), 1e12, np.nan)
        return nu

    def whole(self, nu: Sequence[Array]) -> Array:
        """Innovations [..., updates, n_z] of recordings, whitened, in turn."""
        white = [self.colour.white(x) for x in nu]
        return np.concatenate(white, axis=-2) if len(white) > 1 else white[0]

    def at(self, free: Sequence[Free], by: Filter) -> Fit:
        """The fit that ends at these free values."""
        shifts = np.vstack([np.zeros(len(free)), MOVE * np.eye(len(free))])
        for i, f in enumerate(free):
            if f.at(np.array(MOVE)) == f.value:
                shifts[i + 1, i] = -MOVE
        nu = self.nu(free, shifts, by)
        here, slopes = np.array(nu[0], order="C"), nu[1:] - nu[0]
        slopes /= np.diag(shifts[1:])[:, None, None]
        good, used = np.isfinite(slopes), np.isfinite(here)
        if not good.all():
            slopes[~good] = 0.0
        variance, value = likelihood(here, used, self.floor)
        return Fit(tuple(free), by, here, np.moveaxis(slopes, 0, -1), used, variance, value, value - sum(map(cost, free)))

    def solve(self, free: Sequence[Free], by: Filter, iterations: int = 10, close: float = 0.01) -> Fit:
        """The likeliest free values from those given on; ends where a step gains less than `close` in the log posterior, or promises to."""
        fit = self.at(free, by)
        for _ in range(iterations):
            steps, promised = self._steps(fit)
            if promised < close:
                break
            nu = self.nu(fit.free, steps, by)
            costs = []
            for k, step in enumerate(steps):
                there = put(fit.free, step)
                costs.append(likelihood(nu[k], np.isfinite(nu[k]), self.floor)[1] - sum(map(cost, there)))
            costs = [c if np.isfinite(c) else -np.inf for c in costs]
            best = int(np.argmax(costs))
            if not costs[best] > fit.cost + 1e-9:
                break
            gained = costs[best] - fit.cost
            fit = self.at(put(fit.free, steps[best]), by)
            if gained < close:
                break
        return fit

    def without(self, fit: Fit, lefts: Sequence[NDArray[np.bool_]], iterations: int = 3, close: float = 0.05) -> list[Fit]:
        """A fit of all updates, fitted again without those left out [updates], for each of `lefts`. The slopes are those of the fit of all
        (the chord method; Ortega and Rheinboldt 1970, section 7.1): it ends near by, and all refits are runs of one simulation."""
        parts = [self._at(fit, fit.nu, left, fit.free) for left in lefts]
        shifts = np.zeros((len(lefts), len(fit.free)))
        for _ in range(iterations):
            steps = np.array([shift + self._steps(part)[0] for shift, part in zip(shifts, parts, strict=True)])  # [lefts, dampings, free]
            nu = self.nu(fit.free, steps.reshape(-1, len(fit.free)), fit.by).reshape(*steps.shape[:2], *fit.nu.shape)
            gained = 0.0
            for b, left in enumerate(lefts):
                tried = [self._at(fit, n, left, put(fit.free, s)) for n, s in zip(nu[b], steps[b], strict=True)]
                best = int(np.argmax([t.cost if np.isfinite(t.cost) else -np.inf for t in tried]))
                if tried[best].cost > parts[b].cost + 1e-9:
                    gained = max(gained, tried[best].cost - parts[b].cost)
                    parts[b], shifts[b] = tried[best], steps[b, best]
            if gained < close:
                break
        return parts

    def _at(self, fit: Fit, nu: Array, left: NDArray[np.bool_], free: tuple[Free, ...]) -> Fit:
        """Other free values, with their innovations, and the slopes of a fit; without what is left out."""
        used = np.isfinite(nu) & ~left[:, None]
        variance, value = likelihood(nu, used, self.floor)
        return replace(fit, free=free, nu=nu, used=used, variance=variance, likelihood=value, cost=value - sum(map(cost, free)))

    def _steps(self, fit: Fit) -> tuple[Array, float]:
        """Steps [DAMPING, free] towards the likeliest values, and how much of the log posterior the full one promises to gain."""
        rows = (fit.slopes / np.sqrt(fit.variance)[None, :, None])[fit.used]
        rest = (fit.nu / np.sqrt(fit.variance))[fit.used]
        curvature = rows.T @ rows + np.diag(precisions(fit.free) ** 2)
        slope = -rows.T @ rest - prior_slopes(fit.free)
        stuck = [(f.value <= f.low and s <= 0.0) or (f.value >= f.high and s >= 0.0) for f, s in zip(fit.free, slope, strict=True)]
        slope[stuck] = 0.0
        curvature[stuck], curvature[:, stuck] = 0.0, 0.0
        size = np.sqrt(np.maximum(np.diag(curvature), 1e-30))
        normed = curvature / np.outer(size, size)
        damped = normed + (1e-10 + DAMPING)[:, None, None] * np.eye(len(size))
        found = np.linalg.solve(damped, (slope / size)[:, None])[..., 0] / size
        return np.where([f.log for f in fit.free], np.clip(found, -1.0, 1.0), found), 0.5 * float(found[0] @ slope)


def put(free: Sequence[Free], shift: Array) -> tuple[Free, ...]:
    return tuple(replace(f, value=float(f.at(s))) for f, s in zip(free, shift, strict=True))
