# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The steady gain of an observer: Kalman's, for the model linearised where it stands still, with unmodelled forces."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from penode_gen.model import Model

from ..plant.plant import Linear, linearise
from .observer import UNMODELLED, Filter

Array = NDArray[np.float64]
FORGETTING = 1e-6  # by which states decay at an update: one that no sensor shows then has a bounded variance


@dataclass(frozen=True, eq=False)
class Level:
    """The unmodelled force, an Ornstein-Uhlenbeck process: `size` is its standard deviation at each place, in units of the force there;
    `tau` [s] its correlation time. In a model of states and equations alone it is added to the rates of the states instead, as white noise
    of the same spectral density at 0 Hz."""

    size: float
    tau: float


@dataclass(frozen=True, eq=False)
class Gains:
    """The linear `plant` of an augmented model with states `names`; `into`: states of the model that follows, of which others are not
    corrected. `input_noise` [n_u] and `noise` [n_z]: standard deviations of a sample of each input and sensor; `forces` [unmodelled]:
    the unit of levels; `period` [s] between updates, and how many `samples` that are."""

    names: tuple[str, ...]
    into: tuple[str, ...]
    plant: Linear
    input_noise: Array
    forces: Array
    noise: Array
    period: float
    samples: int

    @cached_property
    def _noisy(self) -> list[int]:
        return driven_by_noise(self.names)

    def at(self, level: Level) -> Filter:
        """The steady filter: what an update does with the mean innovation since the one before."""
        n_x, n_z = len(self.plant.a), len(self.noise)
        if not n_x or (level.size == 0.0 and not self.input_noise.any()):
            return Filter.none(len(self.into), n_z)
        a = self.plant.a.copy()
        drive = np.zeros((n_x, n_x))
        for i, force in zip(self._noisy, self.forces, strict=True):
            if is_force(self.names[i]):
                a[i, i] = -1.0 / level.tau
                drive[i, i] = 2.0 * (level.size * force) ** 2 / level.tau
            else:
                drive[i, i] = 2.0 * (level.size * force) ** 2 * level.tau
        f, total = self._of_an_update(a, drive)
        measured = total[n_x:, n_x:] + np.diag(self.noise**2 / self.samples)
        gain = riccati(f[:n_x, :n_x], f[n_x:, :n_x], total[:n_x, :n_x], total[:n_x, n_x:], measured)
        whole = np.zeros((len(self.into), n_z))
        whole[[self.into.index(n) for n in self.names]] = gain
        return Filter(whole, np.array([level.tau]))

    def _of_an_update(self, a: Array, drive: Array) -> tuple[Array, Array]:
        """Transition of the states and of the means of the sensors at the samples since the last update, from one update to the next, and
        the covariance of what unmodelled forces of intensity `drive` and noise of the inputs add."""
        n_x, n_z = len(a), len(self.noise)
        step, q = sampled(a, drive, self.period / self.samples)
        n = n_x + n_z
        seen = self.plant.c / self.samples
        once = np.block([[step, np.zeros((n_x, n_z))], [seen @ step, np.eye(n_z)]])
        into = np.vstack([np.eye(n_x), seen])
        shaken = np.vstack([self.plant.b * (self.period / self.samples), self.plant.d / self.samples]) * self.input_noise
        noise = into @ q @ into.T + shaken @ shaken.T
        f, total = np.eye(n), np.zeros((n, n))
        for _ in range(self.samples):
            f, total = once @ f, once @ total @ once.T + noise
        return f, total

    def driven(self, samples: int) -> Array:
        """Variance [n_z] that white noise of the inputs has in the sensors, so many samples into a free run."""
        n_x, sample = len(self.plant.a), replace(self, period=self.period / self.samples, samples=1)
        f, total = sample._of_an_update(self.plant.a, np.zeros((n_x, n_x)))
        over, covariance = f[:n_x, :n_x], total[:n_x, :n_x]
        for _ in range(int(np.log2(max(samples, 1)))):  # each doubles the time
            covariance, over = covariance + over @ covariance @ over.T, over @ over
        return np.diag(f[n_x:, :n_x] @ covariance @ f[n_x:, :n_x].T + total[n_x:, n_x:])


def is_force(state: str) -> bool:
    """Is a state of an augmented model a random force?"""
    return re.fullmatch(rf"{UNMODELLED}\d+_f", state) is not None


def driven_by_noise(states: Sequence[str]) -> list[int]:
    """Numbers of the states that are driven by noise: unmodelled forces of an augmented model, or all where it has none."""
    return [i for i, n in enumerate(states) if is_force(n)] or list(range(len(states)))


def sampled(a: Array, drive: Array, step: float) -> tuple[Array, Array]:
    """Transition of x' = a x + w over a step [s], and the covariance of what w of intensity `drive` adds (Van Loan, IEEE Trans. Autom.
    Control 23, 1978)."""
    n = len(a)
    block = linalg.expm(np.block([[-a, drive], [np.zeros_like(a), a.T]]) * step)
    f = block[n:, n:].T
    q = f @ block[:n, n:]
    return f, 0.5 * (q + q.T)


def riccati(f: Array, h: Array, q: Array, s: Array, r: Array) -> Array:
    """Steady gain k of x+ = f x + w, y = h x + v with covariances q of w, r of v and s of both: x+ = f x + k (y - h x). By doubling
    (Anderson and Moore, Optimal Filtering, 1979, sections 5.5 and 6.7)."""
    f = f * (1.0 - FORGETTING)
    size = np.sqrt(np.maximum(np.diag(q), 1e-12 * np.max(np.diag(q)) + 1e-300))
    deviation = np.sqrt(np.diag(r))
    f, h, q = f * size / size[:, None], h * size / deviation[:, None], q / np.outer(size, size)
    s, r = s / np.outer(size, deviation), r / np.outer(deviation, deviation)
    free = f - s @ np.linalg.solve(r, h)
    alpha, beta, gamma = free.T.copy(), h.T @ np.linalg.solve(r, h), q - s @ np.linalg.solve(r, s.T)
    for _ in range(64):  # each doubles the time; FORGETTING makes it converge long before
        inner = np.linalg.inv(np.eye(len(f)) + beta @ gamma)
        after = alpha @ inner @ alpha
        beta, change = beta + alpha @ inner @ beta @ alpha.T, alpha.T @ gamma @ inner @ alpha
        alpha, gamma = after, gamma + change
        gamma = 0.5 * (gamma + gamma.T)
        if not np.isfinite(gamma).all() or np.max(np.abs(change)) <= 1e-12 * np.max(np.abs(gamma)):
            break
    gain = np.linalg.solve(h @ gamma @ h.T + r, (f @ gamma @ h.T + s).T).T
    return np.where(np.isfinite(gain), size[:, None] * gain / deviation, 0.0)


def linear(model: Model, values: dict[str, float]) -> Linear:
    """An augmented model with these parameters where it stands still; of states and equations alone, where it starts."""
    known = {n: replace(p, value=values.get(n, p.value)) for n, p in model.parameters.items()}
    x = np.zeros(len(model.states)) if model.bodies else np.array(model.start, dtype=float)
    return linearise(replace(model, parameters=known), (), x[None, :], np.zeros((1, len(model.inputs))))
