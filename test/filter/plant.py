# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The quarter vehicle and its filter a second time, in float64: the plant with its noises, for many runs at once, and the extended
Kalman filter with dense matrices in Joseph's form. Of penode it takes the weights of the networks and what the model file says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

Array = NDArray[np.float64]
H = 1e-3  # s
M_B, M_W, C, D, C_T = 350.0, 90.0, 10000.0, 800.0, 300000.0


class Net:
    """A ReLU network of one input: value and slope, any shape."""

    def __init__(self, layers):
        first, *dense, last = layers
        self.first, self.dense, self.last = first, dense, last

    def __call__(self, v: Array) -> tuple[Array, Array]:
        h = (v[..., None] - self.first.shift) * self.first.factor
        t = np.broadcast_to(self.first.factor, h.shape).astype(float)
        for layer in self.dense:
            w = np.asarray(layer.weights, float)
            h, t = h @ w.T + layer.bias, t @ w.T
            if layer.activation == "relu":
                h, t = np.maximum(h, 0.0), np.where(h > 0.0, t, 0.0)
        # rescale: h * p + q in the order of the file
        return (h * self.last.factor + self.last.shift)[..., 0], (t * self.last.factor)[..., 0]


class Plant:
    """Rates and sensors with derivatives; x [..., 4] = z_b, z_w, v_b, v_w, u [...] = road."""

    def __init__(self, model: Model, set_name: str = "default"):
        nets = model.sets[set_name].networks
        self.spring, self.damper = (Net(nets[name].layers) for name in ("spring_net", "damper_net"))

    def rates(self, x: Array, u: Array) -> tuple[Array, Array, Array]:
        """dx [..., 4], its derivatives along x [..., 4, 4] and along u [..., 4]."""
        s, v = x[..., 0] - x[..., 1], x[..., 2] - x[..., 3]
        (f_s, k), (f_d, d) = self.spring(s), self.damper(v)
        force, k, d = C * s + D * v + f_s + f_d, k + C, d + D
        tyre = C_T * (x[..., 1] - u)
        dx = np.stack([x[..., 2], x[..., 3], -force / M_B, (force - tyre) / M_W], axis=-1)
        fx = np.zeros((*x.shape, 4))
        fx[..., 0, 2] = fx[..., 1, 3] = 1.0
        for row, mass, sign in ((2, M_B, -1.0), (3, M_W, 1.0)):
            fx[..., row, 0], fx[..., row, 1] = sign * k / mass, -sign * k / mass
            fx[..., row, 2], fx[..., row, 3] = sign * d / mass, -sign * d / mass
        fx[..., 3, 1] -= C_T / M_W
        fu = np.zeros(x.shape)
        fu[..., 3] = C_T / M_W
        return dx, fx, fu

    def step(self, x: Array, before: Array, now: Array) -> tuple[Array, Array, Array, Array]:
        """RK4 from t to t + H with a straight line from `before` to `now`: x, d x / d x, d x / d before, d x / d now."""
        eye = np.broadcast_to(np.eye(4), (*x.shape, 4))
        k, kx, kb, kn = np.zeros(x.shape), np.zeros(eye.shape), np.zeros(x.shape), np.zeros(x.shape)
        sums = [0.0, 0.0, 0.0, 0.0]
        for share, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            at, at_x, at_b, at_n = x + H * share * k, eye + H * share * kx, H * share * kb, H * share * kn
            k, fx, fu = self.rates(at, before + share * (now - before))
            kx = fx @ at_x
            kb = np.einsum("...ij,...j->...i", fx, at_b) + fu * (1.0 - share)
            kn = np.einsum("...ij,...j->...i", fx, at_n) + fu * share
            sums = [total + weight * part for total, part in zip(sums, (k, kx, kb, kn), strict=True)]
        return x + H / 6 * sums[0], eye + H / 6 * sums[1], H / 6 * sums[2], H / 6 * sums[3]

    def sense(self, x: Array, u: Array) -> tuple[Array, Array, Array]:
        """Both accelerations [..., 2] and their derivatives along x [..., 2, 4] and u [..., 2]."""
        dx, fx, fu = self.rates(x, u)
        return dx[..., 2:], fx[..., 2:, :], fu[..., 2:]


@dataclass
class Truth:
    """The truth of many runs: states with the road behind them [samples, runs, 5], and measurements [samples, runs, 2]."""

    x: Array
    z: Array


def drive(plant: Plant, model: Model, samples: int, runs: int, seed: int, road: bool = True) -> Truth:
    """Runs whose start, disturbances, road and sensors are drawn as the filter of the model file has them. road: an estimated input."""
    given, rng = model.filter, np.random.default_rng(seed)
    start = np.array([s.start for s in given.states])
    noise = np.array([s.noise for s in given.states])
    sensors = np.array([s.noise for s in given.sensors])
    x = np.array(model.start) + start * rng.standard_normal((runs, 4))
    u = given.inputs[0].noise * rng.standard_normal(runs) if road else np.zeros(runs)
    rows, measured = np.zeros((samples, runs, 5)), np.zeros((samples, runs, 2))
    for k in range(samples):
        if k:
            now = given.inputs[0].decay * u + given.inputs[0].step * rng.standard_normal(runs) if road else u
            x = plant.step(x, u, now)[0] + noise * rng.standard_normal((runs, 4))
            u = now
        rows[k, :, :4], rows[k, :, 4] = x, u
        measured[k] = plant.sense(x, u)[0] + sensors * rng.standard_normal((runs, 2))
    return Truth(rows, measured)


class Dense:
    """The filter with whole matrices; `real` float32 is the plain filter that hobby libraries have."""

    def __init__(self, plant: Plant, model: Model, real: type = np.float64, gate: float = np.inf):
        given = model.filter
        self.plant, self.real, self.gate = plant, real, gate
        self.decay = np.array([i.decay for i in given.inputs], real)
        self.q = np.array([s.noise**2 for s in given.states] + [i.step**2 for i in given.inputs], real)
        self.r = np.array([s.noise**2 for s in given.sensors], real)
        self.n = 4 + len(given.inputs)
        self.p = np.diag(np.array([s.start**2 for s in given.states] + [i.noise**2 for i in given.inputs], real))
        self.x = np.array([*model.start, *(0.0 for _ in given.inputs)], real)
        self.running, self.ratio = False, np.zeros(len(self.r), real)

    def step(self, z: Array, u: float = 0.0) -> None:
        """One sample; NaN: missing."""
        n, real = self.n, self.real
        before = self.x[4] if n > 4 else real(u)
        if self.running:
            now = self.decay[0] * self.x[4] if n > 4 else real(u)
            x, px, pb, pn = self.plant.step(self.x[:4].astype(float), np.float64(self.before if n == 4 else before), np.float64(now))
            phi, g = np.zeros((n, n), real), np.eye(n, dtype=real)
            phi[:4, :4] = px
            if n > 4:
                phi[:4, 4], phi[4, 4], g[:4, 4] = pb + self.decay[0] * pn, self.decay[0], pn
            self.x = np.concatenate([x, [now] if n > 4 else []]).astype(real)
            self.p = (phi @ self.p @ phi.T + (g * self.q) @ g.T).astype(real)
        self.before = u
        seen, hx, hu = self.plant.sense(self.x[:4].astype(float), np.float64(self.x[4] if n > 4 else u))
        h = np.column_stack([hx, hu] if n > 4 else [hx]).astype(real)
        dx = np.zeros(n, real)
        for i, row in enumerate(h):
            s = row @ self.p @ row + self.r[i]
            nu = real(z[i] - seen[i]) - row @ dx
            self.ratio[i] = nu * nu / s
            if np.isfinite(z[i]) and self.ratio[i] <= self.gate**2:
                gain = (self.p @ row) / s
                keep = np.eye(n, dtype=real) - np.outer(gain, row)
                self.p = keep @ self.p @ keep.T + self.r[i] * np.outer(gain, gain)
                dx = dx + gain * nu
        self.x = self.x + dx
        self.running = True


def covariance(f: Array) -> Array:
    """P [..., N, N] of the factors of pen_ekf.h."""
    f = f.astype(float)
    lower = np.tril(f, -1) + np.eye(f.shape[-1])
    return np.einsum("...ji,...j,...jk->...ik", lower, np.diagonal(f, axis1=-2, axis2=-1), lower)
