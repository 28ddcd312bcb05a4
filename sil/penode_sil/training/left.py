# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a fit leaves of each signal: beside the noise that the model file states, beside the signal, and whether it is noise at all.

What noise leaves has no memory. What a fit missed has one: it is alike from row to row, and a sum of squared correlations (Box and Pierce,
1970) shows it where it is a hundredth of the noise. So a start that ended beside its place shows itself, though it leaves hardly more."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .problem import Point, Problem
from .settings import SETTINGS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Left:
    """For each signal [n_z], NaN for one that was not recorded: residual over the stated noise (NaN: none is stated), over the signal's
    standard deviation, and the mean correlation of rows some apart where it is more than that of noise, else 0. `counts`: rows."""

    names: tuple[str, ...]
    ratio: Array
    share: Array
    alike: Array
    counts: Array

    @property
    def most(self) -> float:
        """The largest ratio; 1 where no signal that was recorded states its noise."""
        return float(np.nanmax(self.ratio)) if np.isfinite(self.ratio).any() else 1.0

    @property
    def chi2(self) -> float | None:
        """Mean square of residuals over the stated noise; None where none is stated."""
        some = np.isfinite(self.ratio)
        return float(np.average(self.ratio[some] ** 2, weights=self.counts[some])) if some.any() else None

    def above(self, limit: float) -> list[int]:
        """Signals that leave more than so many times their stated noise."""
        return [int(j) for j in np.flatnonzero(np.nan_to_num(self.ratio) > limit)]

    @property
    def doubtful(self) -> bool:
        """Is so much left that the recording may mean something else than the model file takes it for?"""
        return bool(self.above(SETTINGS.story_loud)) or bool(np.nanmax(np.log2(self.share)) > -1.0)  # half of a signal, or more

    @property
    def unfinished(self) -> bool:
        """Does it look as if another start led further? More is left than noise, and it is no noise; or much more; or half of a signal."""
        more = np.nan_to_num(self.ratio) > SETTINGS.left_more
        return self.doubtful or bool(np.any(more & (self.alike > 0.0)))


def of(problem: Problem, point: Point) -> Left | None:
    """What is left at a point; None where the simulation diverges."""
    found = problem.residuals(point)
    if found is None:
        return None
    signals = (*problem.model.sensors, *problem.model.outputs)
    ratio, share, alike, counts = (np.full(len(signals), np.nan) for _ in range(4))
    for j, signal in enumerate(signals):
        goods = [r.good[:, j] for r in problem.records]
        counts[j] = sum(int(g.sum()) for g in goods)
        if not counts[j]:
            continue
        residuals = [np.where(g, e[:, j], 0.0) for e, g in zip(found[0], goods, strict=True)]
        level = np.sqrt(sum(float(e @ e) for e in residuals) / counts[j])
        size = np.std(np.concatenate([r.y[g, j] for r, g in zip(problem.records, goods, strict=True)]))
        ratio[j] = level / signal.noise if signal.noise > 0.0 else np.nan
        share[j], alike[j] = level / max(size, 1e-300), _alike(residuals)
    return Left(tuple(s.name for s in signals), ratio, share, alike, counts)


def _alike(residuals: list[Array], lags: int = 20, sure: float = 5.0) -> float:
    """Mean correlation of rows that are up to `lags` apart; 0 where noise may show as much, by `sure` standard deviations."""
    total, n = sum(float(e @ e) for e in residuals), sum(len(e) for e in residuals)
    if min(len(e) for e in residuals) <= lags or total <= 0.0:
        return 0.0
    by = np.array([sum(float(e[k:] @ e[: len(e) - k]) for e in residuals) for k in range(1, lags + 1)]) / total
    chance = lags + sure * np.sqrt(2.0 * lags)  # of n times the sum of squares: chi2 of so many degrees
    return float(np.sqrt(np.mean(by**2))) if n * float(by @ by) > chance else 0.0
