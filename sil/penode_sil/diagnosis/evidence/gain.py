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

from .observer import WANDER

Array = NDArray[np.float64]
FORGETS = 1e-4  # share of what it knows that a filter forgets at an update: a state that no sensor shows then has a bounded variance
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

    def at(self, level: Level) -> Array:
        """Gain [n_x, n_z] of an update with the mean innovation since the one before."""
        n_x, n_z = len(self.a), len(self.noise)
        if level.size == 0.0 or not n_x:
            return np.zeros((n_x, n_z))
        a = self.a.copy()
        for i in self._wanders:
            a[i, i] = -1.0 / level.tau
        drive = np.zeros((n_x, n_x))
        for i, force in zip(self._wanders, self.forces):
            drive[i, i] = 2.0 * (level.size * force) ** 2 / level.tau
        # Van Loan 1978: the covariance of what comes in between two updates
        block = linalg.expm(np.block([[-a, drive], [np.zeros_like(a), a.T]]) * self.period)
        f = block[n_x:, n_x:].T
        q = f @ block[:n_x, n_x:]
        # a mean over the samples of the interval sees the state at its end as it was, on average, over the interval
        back = linalg.expm(-a * self.period / self.samples)
        mean, power = np.zeros_like(a), np.eye(n_x)
        for _ in range(self.samples):
            mean, power = mean + power / self.samples, power @ back
        h = self.c @ mean
        return riccati(f * (1.0 + FORGETS), 0.5 * (q + q.T), h, np.diag(self.noise**2 / self.samples))


def riccati(f: Array, q: Array, h: Array, r: Array) -> Array:
    """Gain of the steady filter of x+ = f x + w, y = h x + v, by doubling (Anderson and Moore, Optimal Filtering, 1979, section 6.7)."""
    scale = np.sqrt(np.maximum(np.diag(q), 1e-12 * np.max(np.diag(q)) + 1e-300))
    f, q, h = f * scale / scale[:, None], q / np.outer(scale, scale), h * scale
    noise = np.sqrt(np.diag(r))
    h = h / noise[:, None]
    alpha, beta, gamma = f.T.copy(), h.T @ h, q.copy()
    for _ in range(DOUBLINGS):
        inner = np.linalg.solve(np.eye(len(f)) + beta @ gamma, np.eye(len(f)))
        after = alpha @ inner @ alpha
        beta, change = beta + alpha @ inner @ beta @ alpha.T, alpha.T @ gamma @ inner @ alpha
        alpha, gamma = after, gamma + change
        gamma = 0.5 * (gamma + gamma.T)
        if not np.isfinite(gamma).all() or np.max(np.abs(change)) < 1e-12 * np.max(np.abs(gamma)):
            break
    innovation = h @ gamma @ h.T + np.eye(len(h))
    gain = np.linalg.solve(innovation, h @ gamma).T
    return scale[:, None] * gain / noise


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
