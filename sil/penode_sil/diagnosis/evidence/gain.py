# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The steady gain of an observer: Kalman's, for the model linearised where it stands still, with forces that wander."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import penode_gen
from numpy.typing import NDArray
from penode_gen.model import Model
from scipy import linalg

from .observer import WANDER, Filter

Array = NDArray[np.float64]
FORGETS = 1e-6  # by which states decay at an update: one that no sensor shows then has a bounded variance
DOUBLINGS = 30  # of the time for which the filter has run: 1e9 updates


@dataclass(frozen=True, eq=False)
class Level:
    """How much force wanders: `size` is its standard deviation at each place, in units of the force there; `tau` [s] how long it stays."""

    size: float
    tau: float


@dataclass(frozen=True, eq=False)
class Gains:
    """Linear plant of a dressed model, x' = a x + b u, y = c x + d u; `shaken` [n_u]: noise of a sample of each input; `forces` [wandering] are the sizes of force to which levels are relative,
    `noise` [n_z] the standard deviations of a sample of each sensor, `period` [s] the time between updates, `samples` how many; `names` of its states, `into`: those of the
    model that follows, of which others are not corrected."""

    names: tuple[str, ...]
    into: tuple[str, ...]
    a: Array
    b: Array
    c: Array
    d: Array
    shaken: Array
    forces: Array
    noise: Array
    period: float
    samples: int

    @cached_property
    def _wanders(self) -> list[int]:
        return [i for i, n in enumerate(self.names) if n.startswith(WANDER)]

    def at(self, level: Level) -> Filter:
        """The steady filter: what an update does with the mean innovation since the one before."""
        n_x, n_z = len(self.a), len(self.noise)
        if not n_x or level.size == 0.0 and not self.shaken.any():
            return Filter.none(len(self.into), n_z)
        a = self.a.copy()
        for i in self._wanders:
            a[i, i] = -1.0 / level.tau
        drive = np.zeros((n_x, n_x))
        for i, force in zip(self._wanders, self.forces):
            drive[i, i] = 2.0 * (level.size * force) ** 2 / level.tau
        step, q = sampled(a, drive, self.period / self.samples)
        # states, and means of the sensors at the samples since the last update, from one sample to the next
        n = n_x + n_z
        seen = self.c / self.samples
        once = np.block([[step, np.zeros((n_x, n_z))], [seen @ step, np.eye(n_z)]])
        into = np.vstack([np.eye(n_x), seen])
        drive_noise = np.vstack([self.b * (self.period / self.samples), self.d / self.samples]) * self.shaken
        noise = into @ q @ into.T + drive_noise @ drive_noise.T
        f, total = np.eye(n), np.zeros((n, n))
        for _ in range(self.samples):
            f, total = once @ f, once @ total @ once.T + noise
        measured = total[n_x:, n_x:] + np.diag(self.noise**2 / self.samples)
        gain = riccati(f[:n_x, :n_x], f[n_x:, :n_x], total[:n_x, :n_x], total[:n_x, n_x:], measured)
        whole = np.zeros((len(self.into), n_z))
        whole[[self.into.index(n) for n in self.names]] = gain
        return Filter(whole, np.array([level.tau]))


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
    f = f * (1.0 - FORGETS)
    size = np.sqrt(np.maximum(np.diag(q), 1e-12 * np.max(np.diag(q)) + 1e-300))
    deviation = np.sqrt(np.diag(r))
    f, h, q = f * size / size[:, None], h * size / deviation[:, None], q / np.outer(size, size)
    s, r = s / np.outer(size, deviation), r / np.outer(deviation, deviation)
    free = f - s @ np.linalg.solve(r, h)
    alpha, beta, gamma = free.T.copy(), h.T @ np.linalg.solve(r, h), q - s @ np.linalg.solve(r, s.T)
    for _ in range(DOUBLINGS):
        inner = np.linalg.inv(np.eye(len(f)) + beta @ gamma)
        after = alpha @ inner @ alpha
        beta, change = beta + alpha @ inner @ beta @ alpha.T, alpha.T @ gamma @ inner @ alpha
        alpha, gamma = after, gamma + change
        gamma = 0.5 * (gamma + gamma.T)
        if not np.isfinite(gamma).all() or np.max(np.abs(change)) < 1e-12 * np.max(np.abs(gamma)):
            break
    gain = np.linalg.solve(h @ gamma @ h.T + r, (f @ gamma @ h.T + s).T).T
    return np.where(np.isfinite(gain), size[:, None] * gain / deviation, 0.0)


def linear(model: Model, n_z: int, values: dict[str, float], set_name: str) -> tuple[Array, Array, Array, Array]:
    """a [n_x, n_x], b [n_x, n_u], c [n_z, n_x] and d [n_z, n_u] of a dressed model where it stands still."""
    known = {n: replace(p, value=values.get(n, p.value)) for n, p in model.parameters.items()}
    system = penode_gen.numeric(replace(model, parameters=known, interpolation="linear"), set_name)
    n_x, n_u = len(model.states), len(model.inputs)
    x, u = np.zeros(n_x), np.zeros(n_u)
    a, c = np.zeros((n_x, n_x)), np.zeros((n_z, n_x))
    for j in range(n_x):
        step = 1e-4 * np.eye(n_x)[j]
        a[:, j] = (system.rates(x + step, u, u) - system.rates(x - step, u, u)) / 2e-4
        c[:, j] = (system.sensors(x + step, u, u) - system.sensors(x - step, u, u))[:n_z] / 2e-4
    b, d = np.zeros((n_x, n_u)), np.zeros((n_z, n_u))
    for j in range(n_u):
        step = 1e-4 * np.eye(n_u)[j]
        b[:, j] = (system.rates(x, u + step, u) - system.rates(x, u - step, u)) / 2e-4
        d[:, j] = (system.sensors(x, u + step, u) - system.sensors(x, u - step, u))[:n_z] / 2e-4
    return a, b, c, d
