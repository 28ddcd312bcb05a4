# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Curves of hat functions: what a piecewise linear network of one input can be, in as many numbers as it has kinks."""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """Straight between `knots` [n], which ascend, with `values` there; beyond the outermost it goes on straight. `zero`: index of
    the knot at 0 whose value stays 0, or -1."""

    knots: Array
    values: Array
    zero: int

    @property
    def columns(self) -> int:
        """Number of free values."""
        return len(self.knots) - (self.zero >= 0)

    @property
    def theta(self) -> Array:
        """The free values."""
        return np.delete(self.values, self.zero) if self.zero >= 0 else self.values.copy()

    def with_theta(self, theta: Array) -> Curve:
        """The same knots with other free values."""
        values = np.insert(theta, self.zero, 0.0) if self.zero >= 0 else np.array(theta)
        return replace(self, values=values)

    def __call__(self, x: Array) -> Array:
        """Values at x."""
        i = np.clip(np.searchsorted(self.knots, x, side="right") - 1, 0, len(self.knots) - 2)
        slope = np.diff(self.values) / np.diff(self.knots)
        return self.values[i] + slope[i] * (x - self.knots[i])

    def hats(self, x: Array) -> Array:
        """Derivatives [n, columns] of the values at x by the free values."""
        x = np.atleast_1d(x)
        i = np.clip(np.searchsorted(self.knots, x, side="right") - 1, 0, len(self.knots) - 2)
        t = (x - self.knots[i]) / np.diff(self.knots)[i]
        found = np.zeros((len(x), len(self.knots)))
        found[np.arange(len(x)), i], found[np.arange(len(x)), i + 1] = 1.0 - t, t
        return np.delete(found, self.zero, axis=1) if self.zero >= 0 else found

    def on(self, knots: Array) -> Curve:
        """The same curve on other knots, as near as they allow."""
        zero = int(np.flatnonzero(knots == 0.0)[0]) if self.zero >= 0 else -1
        return Curve(knots, self(knots) if zero < 0 else np.where(knots == 0.0, 0.0, self(knots)), zero)

    def middled(self) -> Curve:
        """The same curve with a knot more in the middle of each piece."""
        return self.on(np.sort(np.concatenate([self.knots, 0.5 * (self.knots[1:] + self.knots[:-1])])))

    def bends(self) -> Array:
        """Rows [n - 2, columns]: how far a knot is from the line between its neighbours."""
        k, n = self.knots, len(self.knots)
        rows = np.zeros((max(n - 2, 0), n))
        for j in range(1, n - 1):
            t = (k[j] - k[j - 1]) / (k[j + 1] - k[j - 1])
            rows[j - 1, j - 1 : j + 2] = t - 1.0, 1.0, -t
        return np.delete(rows, self.zero, axis=1) if self.zero >= 0 else rows

    def fill(self, net: ctypes.Structure) -> list[NDArray[Any]]:
        """Fill in a net_t; what it points to."""
        knots, values = np.ascontiguousarray(self.knots), np.ascontiguousarray(self.values)
        net.kind, net.count, net.zero, net.layers, net.columns, net.widest, net.inputs = 0, len(knots), self.zero, 0, self.columns, 1, 1
        net.knots, net.values = knots.ctypes.data, values.ctypes.data
        return [knots, values]


def three(reach: float, zero: bool) -> Curve:
    """A curve of two slopes, all 0."""
    return Curve(np.array([-reach, 0.0, reach]), np.zeros(3), 1 if zero else -1)


def spaced(low: float, high: float, count: int, power: float) -> Array:
    """`count` knots from low to high, dense about 0 by a power; one of them is 0 exactly, and those on both sides of it mirror each
    other."""
    low, high = min(low, 0.0), max(high, 0.0)
    wide = high ** (1.0 / power) + (-low) ** (1.0 / power)
    left = round((count - 1) * (-low) ** (1.0 / power) / wide)
    left = min(max(left, 1 if low < 0.0 else 0), count - 1 - (1 if high > 0.0 else 0))
    unit = wide / (count - 1)

    def side(n: int, end: float) -> Array:
        """n knots on the way from 0 to an end: by the common unit, the last one at the end."""
        own = min(unit, end ** (1.0 / power) / max(n - 0.5, 0.5))  # where rounding left too little room
        return np.append((own * np.arange(1, n)) ** power, end) if n else np.zeros(0)

    return np.concatenate([-side(left, -low)[::-1], [0.0], side(count - 1 - left, high)])


def bent(knots: Array, values: Array, spread: Array, regular: NDArray[np.bool_]) -> bool:
    """Do data say at all that a curve is more than one of its regular knots? Wald's test of all others together, at three deviations: each
    may look wanted by itself, and for each a regular knot goes, whose loss moves the constant that two curves share."""
    at = np.flatnonzero(~regular)
    t = (knots[at] - knots[at - 1]) / (knots[at + 1] - knots[at - 1])
    rows = np.zeros((len(at), len(knots)))
    rows[np.arange(len(at)), at - 1], rows[np.arange(len(at)), at], rows[np.arange(len(at)), at + 1] = t - 1.0, 1.0, -t
    away, variance = rows @ values, rows @ spread @ rows.T
    scale = 1.0 / np.sqrt(np.maximum(np.diag(variance), 1e-300))
    chi2 = float((away * scale) @ np.linalg.solve(variance * np.outer(scale, scale) + 1e-9 * np.eye(len(at)), away * scale))
    return chi2 > len(at) + 3.0 * math.sqrt(2.0 * len(at))


def fewer(knots: Array, values: Array, spread: Array, count: int, regular: NDArray[np.bool_], zero: int) -> NDArray[np.bool_]:
    """Which `count` knots to keep: those are dropped, one by one, that cost least; `spread` is the covariance of the values at all knots.

    Of so many candidates noise makes some look wanted, and a curve whose knots noise has chosen is wrong by more than its covariance shows.
    So another knot than those of the `regular` grid must gain more than that by 2 ln(candidates) (risk inflation criterion; Foster and
    George, Annals of Statistics 22, 1994). The outermost knots and that at 0 stay. The first knots on both sides of 0 stay or go together:
    what straight pieces miss of a force that turns there cancels, or else it moves the force on both sides by a constant."""
    kept = _fewer(knots, values, spread, count, regular, np.arange(len(knots)) == zero)
    if not 1 < zero < len(knots) - 2 or kept[zero - 1] == kept[zero + 1]:
        return kept
    fixed = np.abs(np.arange(len(knots)) - zero) <= 1
    return _fewer(knots, values, spread, count, regular, fixed) if fixed.sum() + 2 <= count else kept


def without(knots: Array, values: Array, spread: Array, keep: NDArray[np.bool_]) -> Array:
    """Values at the knots that are kept, where all others lie on the lines between them: the most likely ones by the covariance `spread`.
    Poorly known values move most, such as that of an outermost knot whose neighbour is dropped."""
    at, kept = np.flatnonzero(~keep), np.flatnonzero(keep)
    if not len(at):
        return values
    right = np.searchsorted(kept, at)
    a, b = kept[right - 1], kept[right]
    t = (knots[at] - knots[a]) / (knots[b] - knots[a])
    rows = np.zeros((len(at), len(knots)))
    rows[np.arange(len(at)), a], rows[np.arange(len(at)), at], rows[np.arange(len(at)), b] = t - 1.0, 1.0, -t
    variance = rows @ spread @ rows.T
    scale = 1.0 / np.sqrt(np.maximum(np.diag(variance), 1e-300))
    pull = scale * np.linalg.solve(variance * np.outer(scale, scale) + 1e-9 * np.eye(len(at)), (rows @ values) * scale)
    moved: Array = values - spread @ rows.T @ pull
    return moved[keep]


def _fewer(
    knots: Array, values: Array, spread: Array, count: int, regular: NDArray[np.bool_], fixed: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """The same with knots that stay."""
    keep = np.ones(len(knots), dtype=bool)
    favour = 2.0 * np.log(len(knots))
    while keep.sum() > count:
        at = np.flatnonzero(keep)
        inner = [k for k in range(1, len(at) - 1) if not fixed[at[k]]]
        if not inner:
            break
        k = np.array(inner)
        t = (knots[at[k]] - knots[at[k - 1]]) / (knots[at[k + 1]] - knots[at[k - 1]])
        rows = np.zeros((len(k), len(knots)))
        rows[np.arange(len(k)), at[k - 1]], rows[np.arange(len(k)), at[k]], rows[np.arange(len(k)), at[k + 1]] = t - 1.0, 1.0, -t
        away, moved = rows @ values, rows @ spread
        variance = np.maximum(np.einsum("ij,ij->i", moved, rows), 1e-12 * np.einsum("ij,j->i", rows**2, np.diag(spread)) + 1e-300)
        best = int(np.argmin(away**2 / variance + favour * regular[at[k]]))
        values = values - moved[best] * (away[best] / variance[best])
        spread = spread - np.outer(moved[best], moved[best]) / variance[best]
        keep[at[k[best]]] = False
    return keep
