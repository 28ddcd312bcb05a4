# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The least-squares problem of a training: unknowns, priors, residuals, and their normal equations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from penode_gen.model import Model

from .apart import Apart
from .curve import Curve
from .data import Noise, Record
from .dense import Dense
from .engine import Engine, Shape
from .resume import Journal
from .settings import SETTINGS

Array = NDArray[np.float64]
STARTS = {"m": 0.1, "rad": 0.3, "m/s": 1.0, "rad/s": 3.0}  # standard deviation of start states by unit; others 1 + 10 times their value


@dataclass(frozen=True, eq=False)
class Point:
    """Values of all unknowns: `ratios` [free] are parameters over their nominal values (not their logarithms: a common
    factor of masses and forces is a straight line so), `starts` [records, n_x]."""

    ratios: Array
    starts: Array
    shapes: tuple[Shape, ...]

    @property
    def vector(self) -> Array:
        """All in one, in the order of the normal equations."""
        return np.concatenate([self.ratios, self.starts.ravel(), *(s.theta for s in self.shapes)])

    def moved(self, step: Array) -> Point:
        """The point a step away."""
        return self.placed(self.vector + step)

    def placed(self, vector: Array) -> Point:
        """The point with other values of all unknowns."""
        n, m = len(self.ratios), self.starts.size
        at, shapes = n + m, []
        for s in self.shapes:
            shapes.append(s.with_theta(vector[at : at + len(s.theta)]))
            at += len(s.theta)
        return Point(vector[:n], vector[n : n + m].reshape(self.starts.shape), tuple(shapes))


@dataclass(frozen=True, eq=False)
class Normal:
    """Normal equations at a point: curvature [n, n] and slope [n] of half the cost's data part, without priors."""

    curvature: Array
    slope: Array


@dataclass(frozen=True, eq=False)
class Problem:
    """A model against recordings. `held` names parameters that do not move; `scale` is the size of forces, per network."""

    engine: Engine
    records: tuple[Record, ...]
    noise: Noise
    scale: Array
    held: frozenset[str] = frozenset()
    frozen: bool = False  # only start states move
    tied: Array | None = None  # [directions, free]: of the parameters, that no sensor sees; they stay where the model file has them
    plain: bool = False  # curves have no spike at 0: for the way to a fit, not for its end
    apart: tuple[Apart, ...] = ()  # networks beside free parameters in the same place
    journal: Journal = field(default_factory=Journal)  # of the training's fits
    model: Model = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "model", self.engine.model)

    def with_(self, **changes: object) -> Problem:
        """The same problem but for some of it."""
        given = {
            k: getattr(self, k) for k in ("engine", "records", "noise", "scale", "held", "frozen", "tied", "plain", "apart", "journal")
        }
        return Problem(**(given | changes))

    @property
    def nominal(self) -> Array:
        return np.array([p.value for p in self.model.parameters.values()])

    def parameters(self, point: Point) -> Array:
        """All parameters in the model's order."""
        names, values = list(self.model.parameters), self.nominal.copy()
        for name, ratio in zip(self.engine.free, point.ratios, strict=True):
            values[names.index(name)] *= ratio
        return values

    def begin(self, shapes: Sequence[Shape]) -> Point:
        """Nominal parameters, the model's start, and shapes."""
        return Point(
            np.ones(len(self.engine.free)), np.tile(np.array(self.model.start, dtype=float), (len(self.records), 1)), tuple(shapes)
        )

    def residuals(self, point: Point) -> tuple[list[Array], list[Array]] | None:
        """Measured less simulated signals and inputs of the networks, a recording each; None where the simulation diverges."""
        if np.any(point.ratios < SETTINGS.problem_least):
            return None
        found, seen = [], []
        for record, start in zip(self.records, point.starts, strict=True):
            z, inputs, good = self.engine.simulate(record.drive, self.parameters(point), point.shapes, start)
            if not good:
                return None
            found.append(np.where(record.good, record.y - z, 0.0))
            seen.append(inputs)
        return found, seen

    def chi2(self, point: Point) -> float:
        """Sum of squares of the whitened residuals; infinite where the simulation diverges."""
        found = self.residuals(point)
        if found is None:
            return np.inf
        total = float(sum(np.sum(self.noise.white(r, record.good) ** 2) for r, record in zip(found[0], self.records, strict=True)))
        return total if np.isfinite(total) else np.inf

    def cost(self, point: Point) -> float:
        """chi2 and priors."""
        matrix, origin = self.prior(point)
        away = point.vector - origin
        return self.chi2(point) + float(away @ matrix @ away)

    @property
    def samples(self) -> int:
        """Sound samples of all signals."""
        return int(sum(self.noise.weight(r.good).sum() for r in self.records))

    def normal(self, point: Point) -> Normal:
        """Normal equations. Raises FloatingPointError where the simulation diverges."""
        n_f, n_x = len(self.engine.free), len(self.model.start)
        wide = len(point.vector)
        curvature, slope = np.zeros((wide, wide)), np.zeros(wide)
        residuals = self.residuals(point)
        if residuals is None:
            raise FloatingPointError("the simulation left all bounds")
        columns = wide - n_x * (len(self.records) - 1)
        scale = np.ones(columns)
        names = list(self.model.parameters)
        scale[:n_f] = [self.nominal[names.index(name)] for name in self.engine.free]
        for e, (record, start, residual) in enumerate(zip(self.records, point.starts, residuals[0], strict=True)):
            white, weight = self.noise.white(residual, record.good), self.noise.weight(record.good)
            own = np.concatenate([np.arange(n_f), n_f + e * n_x + np.arange(n_x), np.arange(n_f + len(self.records) * n_x, wide)])
            part, along = np.zeros((columns, columns)), np.zeros(columns)
            memory = [np.zeros((len(c), columns)) for c in self.noise.colour]
            for block in self.engine.blocks(record.drive, self.parameters(point), point.shapes, start, columns):
                rows = slice(block.first, block.first + len(block.jacobian))
                for j, c in enumerate(self.noise.colour):
                    if not weight[rows, j].any():
                        continue
                    one = block.jacobian[:, j]
                    if len(c):
                        one, memory[j] = lfilter(np.concatenate([[1.0], -c]), [1.0], one, axis=0, zi=memory[j])
                    one = one * (weight[rows, j] / self.noise.sigma[j])[:, None]
                    along += white[rows, j] @ one
                    if columns > SETTINGS.problem_wide:
                        few = one[:: SETTINGS.problem_sparse]
                        part += few.T @ few * (len(one) / len(few))
                    else:
                        part += one.T @ one
            curvature[np.ix_(own, own)] += part * np.outer(scale, scale)
            slope[own] += along * scale
        return Normal(curvature, slope)

    def prior(self, point: Point) -> tuple[Array, Array]:
        """Precision [n, n] and origin [n] of all unknowns."""
        deviations, origin = [], []
        for name in self.engine.free:
            tolerance = self.model.parameters[name].tolerance
            known = tolerance <= 1.0
            deviations.append(
                1e-9
                if name in self.held or self.frozen
                else SETTINGS.problem_limit * tolerance
                if known
                else SETTINGS.problem_unknown_deviation
                if not np.isfinite(tolerance)
                else tolerance
            )
            origin.append(1.0)
        units = [u for b in self.model.bodies for u in (b.unit,)] + [f"{b.unit}/s" for b in self.model.bodies]
        spread = [STARTS[u] for u in units] + [1.0 + 10.0 * abs(s.start) for s in self.model.extra_states]
        deviations += spread * len(self.records)
        origin += list(self.model.start) * len(self.records)
        first = np.diag(np.array(deviations) ** -2.0)
        if self.tied is not None and len(self.tied):
            n_f = len(self.engine.free)
            first[:n_f, :n_f] += self.tied.T @ self.tied * SETTINGS.problem_tied**-2.0
        blocks = [first]
        for k, (shape, size) in enumerate(zip(point.shapes, self.scale, strict=True)):
            blocks.append(self._of_shape(shape, size))
            rows = [a.row(shape) / (SETTINGS.problem_tied * size) for a in self.apart if a.shape == k and isinstance(shape, Curve)]
            blocks[-1] = blocks[-1] + sum((np.outer(r, r) for r in rows), np.zeros(blocks[-1].shape))
            origin += [0.0] * len(shape.theta)
        n = len(origin)
        matrix, at = np.zeros((n, n)), 0
        for block in blocks:
            matrix[at : at + len(block), at : at + len(block)] = block
            at += len(block)
        where = np.array(origin)
        if self.frozen:  # shapes stay where they are
            k = len(deviations)
            matrix[k:, k:] = np.diag(np.full(n - k, 1e18))
            where[k:], where[: len(self.engine.free)] = point.vector[k:], point.vector[: len(self.engine.free)]
        return matrix, where

    def _of_shape(self, shape: Shape, size: float) -> Array:
        """Precision of a shape's numbers."""
        if isinstance(shape, Dense) and shape.activation == ("identity",):  # lines, in the units of the model
            return np.diag(np.full(len(shape.theta), 1e-12))
        if not isinstance(shape, Curve):
            return np.diag(np.full(len(shape.theta), SETTINGS.problem_decay**-2.0))
        rows = shape.bends() / (SETTINGS.problem_bent * size)
        if self.plain and 0 < shape.zero < len(shape.knots) - 1:  # a constant of one network would move where 0 of another one is
            rows[shape.zero - 1] /= SETTINGS.problem_tied
        precision: Array = rows.T @ rows + np.eye(len(shape.theta)) * (SETTINGS.problem_large * size) ** -2.0
        return precision


def replaced(point: Point, index: int, shape: Shape) -> Point:
    """The point with another shape."""
    return replace(point, shapes=(*point.shapes[:index], shape, *point.shapes[index + 1 :]))
