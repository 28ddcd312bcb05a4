# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Held-out blocks of the training: what a fit of the others predicts of each, and how sure that makes of a hypothesis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..study.noise import UNSEEN
from .bench import CORRELATION, UPDATES, Bench, smooth
from .fit import Fit, Problem
from .gain import Level
from .observer import Record

Array = NDArray[np.float64]
BLOCKS = 4
PIECES = 5  # of each block, in turn: what happens once would be held out as a whole
BURN_IN = 0.15  # of as many updates as a block has, at the beginning of a recording, that stay in training: they carry its start
REFIT = 3  # iterations from the fit of all blocks
FREEDOM = 4.0  # degrees of freedom of what one update is off
DRAWS = 4000  # of the Bayesian bootstrap


@dataclass(frozen=True, eq=False)
class Blocks:
    """Which block each update belongs to, -1 for those of a burn-in, and for those at which nothing but noise moves."""

    number: NDArray[np.int64]

    @staticmethod
    def of(lengths: Sequence[int], still: NDArray[np.bool_] | None = None) -> Blocks:
        """Of recordings with so many updates: pieces of equal length, in turn of each block, without updates [updates] that are `still`."""
        moving = np.ones(sum(lengths), bool) if still is None else ~still
        total = int(np.sum(moving))
        number = np.where(moving, (np.cumsum(moving) - 1) * BLOCKS * PIECES // max(total, 1) % BLOCKS, -1)
        begin = 0
        for n in lengths:
            stay = max(1, int(BURN_IN * min(n, total / BLOCKS)))
            number[begin : begin + stay] = -1
            begin += n
        return Blocks(number)

    @staticmethod
    def moving(bench: Bench) -> Blocks:
        """Of the recordings of a bench."""
        lengths = [len(r) // bench.update for r in bench.records]
        noisy = any(i.noise for i in bench.base.inputs)
        return Blocks.of(lengths, np.concatenate([resting(bench, r) for r in bench.records]) if noisy else None)

    def scores(self, problem: Problem, fit: Fit) -> Array:
        """Log predictive density [blocks] of each block by the fit of the others."""
        lefts = [self.number == b for b in range(BLOCKS)]
        parts = problem.without(fit, lefts, REFIT)
        return np.array([predictive(part, left, problem.floor) for part, left in zip(parts, lefts, strict=True)])

    def fit_level(self, bench: Bench, problem: Problem, fit: Fit, level: Level, sizes: Sequence[float]) -> tuple[Level, Fit, Array]:
        """The level with which left-out blocks are predicted best, that of a fit or one of other `sizes`, the fit with it, and its scores.
        The likeliest level in training is too small where few updates meet many free values: they then fit the unmodelled force."""
        best = level, fit, self.scores(problem, fit)
        gains = bench.gains(fit, problem.predictor.model)
        for size in sizes:
            more = Level(size, CORRELATION * gains.period)
            wider = problem.solve(fit.free, gains.at(more), REFIT)
            scores = self.scores(problem, wider)
            if np.sum(scores) > np.sum(best[2]):
                best = more, wider, scores
        return best


def resting(bench: Bench, record: Record) -> NDArray[np.bool_]:
    """At which updates nothing moves but noise, by the rms of all signals over a period of the motion: only a
    simulation follows that, and a friction that holds it still predicts better."""
    moves, noise = np.zeros(len(record), bool), np.array([i.noise for i in bench.base.inputs])
    for x, size in ((record.u, noise), (record.y, bench.noise)):
        x = np.where(np.isfinite(x).any(axis=0), x, 0.0)  # a sensor that this recording lacks is at rest
        x = np.nan_to_num(x - np.nanmedian(x, axis=0))
        mean, square = (smooth(s, UPDATES // 2 * bench.update) for s in (x, x**2))
        most = (UNSEEN * size) ** 2
        moves |= np.any(square - mean**2 > most, axis=1)
    each: NDArray[np.bool_] = ~np.any(moves[: len(moves) // bench.update * bench.update].reshape(-1, bench.update), axis=1)
    return each


def predictive(part: Fit, left: NDArray[np.bool_], floor: Array) -> float:
    """Log density of the innovations left out under Student's t with FREEDOM degrees, whose width is that of the innovations fitted:
    a moment at which a friction sticks, or does not, is one moment and no block."""
    total = 0.0
    for j in range(part.nu.shape[1]):
        good = np.isfinite(part.nu[:, j])
        ours, theirs = part.nu[good & part.used[:, j], j], part.nu[good & left, j]
        if len(ours) and len(theirs):
            width = spread(ours, floor[j])
            total -= float(np.sum(0.5 * (FREEDOM + 1.0) * np.log1p(theirs**2 / (FREEDOM * width)))) + 0.5 * len(theirs) * float(
                np.log(width)
            )
    return total


def spread(x: Array, floor: float) -> float:
    """Square of the width of a Student's t with FREEDOM degrees that fits x best (Lange, Little and Taylor, JASA 84, 1989), at least
    floor."""
    width, before = max(float(np.mean(x**2)), floor), 0.0
    while abs(width - before) > 1e-5 * width:
        weight = (FREEDOM + 1.0) / (FREEDOM + x**2 / width)
        width, before = max(float(np.mean(weight * x**2)), floor), width
    return width


def posterior(scores: Sequence[Array], seed: int = 1) -> Array:
    """Probability [hypotheses] of each to predict best: block scores [blocks] weighted by Dirichlet draws (Rubin 1981)."""
    table = np.array(scores)
    draws = np.random.default_rng(seed).dirichlet(np.ones(table.shape[1]), DRAWS) * table.shape[1]
    best = np.argmax(draws @ table.T, axis=1)
    return np.bincount(best, minlength=len(table)) / DRAWS
