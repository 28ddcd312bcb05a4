# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The steady gain of an observer: Kalman's, for the model linearised where it stands still, with forces that wander."""

from __future__ import annotations

from collections.abc import Sequence
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
    """Linear plant of a dressed model, x' = a x, y = c x; `forces` [wandering] are the sizes of force to which levels are relative,
    `noise` [n_z] the standard deviations of a sample of each sensor, `period` [s] the time between updates, `samples` how many."""

    names: tuple[str, ...]
    a: Array
    c: Array
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
        if level.size == 0.0 or not n_x:
            return Filter.none(n_x, n_z)
        a = self.a.copy()
        for i in self._wanders:
            a[i, i] = -1.0 / level.tau
        n = n_x + n_z  # the states, and the means of the sensors since the last update
        wide, drive = np.zeros((n, n)), np.zeros((n, n))
        wide[:n_x, :n_x], wide[n_x:, :n_x] = a, self.c / self.period
        for i, force in zip(self._wanders, self.forces):
            drive[i, i] = 2.0 * (level.size * force) ** 2 / level.tau
        # Van Loan, IEEE Trans. Autom. Control 23, 1978: the covariance of what comes in between two updates
        block = linalg.expm(np.block([[-wide, drive], [np.zeros_like(wide), wide.T]]) * self.period)
        f = block[n:, n:].T
        q = f @ block[:n, n:]
        q = 0.5 * (q + q.T)
        noise = q[n_x:, n_x:] + np.diag(self.noise**2 / self.samples)
        gain = riccati(f[:n_x, :n_x], f[n_x:, :n_x], q[:n_x, :n_x], q[:n_x, n_x:], noise)
        return Filter(gain, np.array([level.tau]))


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


def linear(model: Model, n_z: int, values: dict[str, float], set_name: str, own: Sequence[str]) -> tuple[tuple[str, ...], Array, Array]:
    """State names, a [n_x, n_x] and c [n_z, n_x] of a dressed model where it stands still. Only states in `own` and those of wandering
    forces are followed: the others, of laws with memory, run by themselves."""
    known = {n: replace(p, value=values.get(n, p.value)) for n, p in model.parameters.items()}
    system = penode_gen.numeric(replace(model, parameters=known, interpolation="linear"), set_name)
    n_x, n_u = len(model.states), len(model.inputs)
    x, u = np.zeros(n_x), np.zeros(n_u)
    a, c = np.zeros((n_x, n_x)), np.zeros((n_z, n_x))
    for j, name in enumerate(model.states):
        step = 1e-4 * np.eye(n_x)[j]
        a[:, j] = (system.rates(x + step, u, u) - system.rates(x - step, u, u)) / 2e-4
        c[:, j] = (system.sensors(x + step, u, u) - system.sensors(x - step, u, u))[:n_z] / 2e-4
        if name not in own and not name.startswith(WANDER):
            c[:, j] = 0.0
    followed = np.array([n in own or n.startswith(WANDER) for n in model.states])
    a[~followed] = 0.0
    a[:, ~followed] = 0.0
    return model.states, a, c
