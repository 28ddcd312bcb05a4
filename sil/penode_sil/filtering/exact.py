# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The filter of a model file in float64, apart from its C: the equations as NumPy functions, Runge-Kutta of order 4 on straight lines
between inputs, derivatives by central differences, whole covariance matrices in Joseph's form. Limits by the same projection. Parameters
that it estimates are given to the equations as values.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import FilterLimit, Model
from penode_gen.twins.numeric import Numeric

from .estimates import FLAGS, VERDICTS, Estimates, joined, of

Array = NDArray[np.float64]
Function = Callable[[Array], Array]


def derivatives(function: Function, at: Array, sizes: Array) -> Array:
    """Central differences [results, arguments], each over a share of the argument's size."""
    steps = np.cbrt(np.finfo(float).eps) * sizes
    columns = [(function(at + step) - function(at - step)) / (2.0 * step.sum()) for step in np.diag(steps)]
    return np.array(columns).T


class Exact:
    """One filter; run() steps through samples."""

    def __init__(self, model: Model, set_name: str = "default"):
        self.model, self.given = model, of(model)
        self.numeric = penode_gen.numeric(model, set_name)
        given, names = self.given, [i.name for i in model.inputs]
        self.n_x, self.n = len(model.states), len(given.names)
        self.first = self.n_x + len(given.inputs)  # of the parameters among the states of the filter
        self.at = [names.index(i.name) for i in given.inputs]
        self.measured = np.array([i.measured for i in given.inputs], bool)
        self.decay = np.array([*(i.decay for i in given.inputs), *(1.0 for _ in given.parameters)])
        self.start = np.array([*(s.start for s in given.states), *(i.noise for i in given.inputs), *(p.start for p in given.parameters)])
        self.noise = np.array([*(s.noise for s in given.states), *(i.step for i in given.inputs), *(p.step for p in given.parameters)])
        self.rows = [[s.name for s in model.sensors].index(s.name) for s in given.sensors]
        self.variance = np.array([s.noise**2 for s in given.sensors])
        self.gate = np.array([np.inf if s.gate is None else s.gate**2 for s in given.sensors])
        values = [model.sets[set_name].parameters[p.name] for p in given.parameters]
        self.x, self.p = np.array([*model.start, *(0.0 for _ in given.inputs), *values]), np.diag(self.start**2)
        self.before: Array | None = None  # inputs of the last sample, as measured

    def select(self, set_name: str) -> None:
        """Another set of the model file from the next sample on."""
        self.numeric = penode_gen.numeric(self.model, set_name)

    def drive(self, u: Array, x: Array) -> Array:
        """The inputs of the model, from those measured and the state of the filter."""
        driven = np.array(u, float)
        driven[self.at] = np.where(self.measured, driven[self.at], 0.0) + x[self.n_x : self.first]
        return driven

    def at_values(self, parameters: Array) -> Numeric:
        """The equations with values of the parameters that are estimated."""
        return self.numeric.with_parameters(dict(zip((p.name for p in self.given.parameters), parameters, strict=True)))

    def step(self, x: Array, u_before: Array, later: Array, u_now: Array) -> Array:
        """State of the model after one sample, from states of the filter and measured inputs before it; `later`: what inputs and
        parameters are in it, behind any states."""
        before, now = self.drive(u_before, x), self.drive(u_now, later)
        h, rate = self.model.sample_time, (now - before) / self.model.sample_time
        held = self.model.interpolation == "held"
        k, total = np.zeros(self.n_x), np.zeros(self.n_x)
        for share, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
            along = 0.0 if held else share
            u, values = before + along * (now - before), x[self.first :] + along * (later[self.first :] - x[self.first :])
            k = self.at_values(values).rates(x[: self.n_x] + h * share * k, u, np.zeros_like(rate) if held else rate)
            total += weight * k
        moved: Array = x[: self.n_x] + h / 6.0 * total
        return moved

    def predict(self, u: Array) -> None:
        """To this sample, from the one before if there was one."""
        if self.before is None:
            return
        before, n_x = self.before, self.n_x

        def moved(joined: Array) -> Array:  # states before, then what each input and parameter adds in this sample
            x = joined[: self.n]
            return self.step(x, before, np.concatenate([x[:n_x], self.decay * x[n_x:] + joined[self.n :]]), u)

        joined = np.concatenate([self.x, np.zeros(self.n - n_x)])
        slopes = derivatives(moved, joined, np.concatenate([self.start, self.noise[n_x:]]))
        phi, gamma = np.eye(self.n), np.eye(self.n)
        phi[:n_x], gamma[:n_x, n_x:] = slopes[:, : self.n], slopes[:, self.n :]
        phi[n_x:, n_x:] = np.diag(self.decay)
        self.x = np.concatenate([moved(joined), self.decay * self.x[n_x:]])
        self.p = phi @ self.p @ phi.T + (gamma * self.noise**2) @ gamma.T

    def look(self, u: Array, x: Array) -> Array:
        """Outputs, then sensors."""
        driven = self.drive(u, x)
        rate = np.zeros_like(driven) if self.before is None else (driven - self.drive(self.before, x)) / self.model.sample_time
        own = self.at_values(x[self.first :])
        return np.concatenate([own.outputs(x[: self.n_x], driven, rate), own.sensors(x[: self.n_x], driven, rate)])

    def correct(self, u: Array, z: Array, mask: int) -> tuple[Array, list[int]]:
        """Use the measurements; innovation, variance and ratio [3, n_z], and verdicts."""
        at = self.x.copy()
        n_y, h = len(self.model.outputs), derivatives(lambda x: self.look(u, x), self.x, self.start)
        seen, dx, tests, verdicts = self.look(u, at)[n_y:], np.zeros(self.n), np.zeros((3, z.size)), []
        for i, row in enumerate(self.rows):
            own = h[n_y + row]
            variance = float(own @ self.p @ own + self.variance[i])
            offered, sound = bool(mask >> i & 1), bool(np.isfinite(z[i]))
            innovation = float(z[i] - seen[row] - own @ dx) if offered and sound else 0.0
            ratio = innovation**2 / variance
            name = "not_offered" if not offered else "missing" if not sound else "refused" if ratio > self.gate[i] else "used"
            if name == "used":
                gain = self.p @ own / variance
                keep = np.eye(self.n) - np.outer(gain, own)
                self.p = keep @ self.p @ keep.T + self.variance[i] * np.outer(gain, gain)
                dx += gain * innovation
            tests[:, i] = innovation, variance, ratio
            verdicts.append(VERDICTS.index(name))
        self.x = at + dx
        return tests, verdicts

    def limit(self) -> bool:
        """Project onto the limits, one after the other, twice; was any active?"""
        active = False
        for limit in (*self.given.limits, *self.given.limits):
            row = np.array([limit.coefficients.get(name, 0.0) for name in self.given.names])
            way = _way(limit, float(row @ self.x))
            if way:
                self.x, active = self.x + self.p @ row * (way / float(row @ self.p @ row)), True
        return active

    def estimate(self, u: Array) -> tuple[Array, Array]:
        """Values and standard deviations, in the order of estimates.signals()."""

        def values(x: Array) -> Array:
            return np.concatenate([x[: self.n_x], self.drive(u, x), self.look(u, x), x[self.first :]])

        slopes = derivatives(values, self.x, self.start)
        return values(self.x), np.sqrt(np.einsum("ij,jk,ik->i", slopes, self.p, slopes))

    def run(self, u: Array, z: Array, mask: Array | None = None, progress: Callable[[int], None] = lambda n: None) -> Estimates:
        """Step through inputs u [n, n_u] and measurements z [n, n_z], NaN where missing; mask [n] as compiled.py has it."""
        n, n_z = z.shape
        offered = np.full(n, 2**n_z - 1) if mask is None else mask
        rows: list[tuple[Array, Array]] = []
        tests, verdicts, status = np.zeros((n, 3, n_z)), np.zeros((n, n_z), np.uint32), np.zeros(n, np.uint32)
        for k in range(n):
            self.predict(u[k])
            tests[k], verdicts[k] = self.correct(u[k], z[k], int(offered[k]))
            status[k] |= FLAGS["limited"] if self.limit() else 0
            for name in ("missing", "refused"):
                status[k] |= FLAGS[name] if (verdicts[k] == VERDICTS.index(name)).any() else 0
            rows.append(self.estimate(u[k]))
            self.before = np.array(u[k], float)
            progress(k + 1)
        counts = np.array([np.bincount(own, minlength=len(VERDICTS)) for own in verdicts.T], np.uint32)
        values, deviations = (np.array([row[part] for row in rows]) for part in (0, 1))
        return Estimates(values, deviations, tests[:, 0], tests[:, 1], tests[:, 2], verdicts, status, counts)


def _later(progress: Callable[[int], None], begin: int, done: int) -> None:
    progress(begin + done)


def _way(limit: FilterLimit, value: float) -> float:
    """How far a sum has to move to keep a limit."""
    if limit.least is not None and value < limit.least:
        return limit.least - value
    return limit.most - value if limit.most is not None and value > limit.most else 0.0


def run(model: Model, set_name: str, u: Any, z: Any, mask: Any, exchanges: dict[int, str], progress: Callable[[int], None]) -> Estimates:
    """A whole run; `exchanges`: the sample from which on another set is in force."""
    found, own, edges = [], Exact(model, set_name), [0, *sorted(exchanges), len(z)]
    for begin, end in itertools.pairwise(edges):
        if begin in exchanges:
            own.select(exchanges[begin])
        part = slice(begin, end)
        found.append(own.run(u[part], z[part], None if mask is None else mask[part], partial(_later, progress, begin)))
    return joined(found)
