# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Held-out blocks of the training: what a fit of the others predicts of each, and how sure that makes of a hypothesis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln

from .fit import Fit, Problem

Array = NDArray[np.float64]
BLOCKS = 4
BURN_IN = 0.15  # of the first block of a recording, that stay in training: they carry its start
REFIT = 3  # iterations from the fit of all blocks
DRAWS = 4000  # of the Bayesian bootstrap


@dataclass(frozen=True, eq=False)
class Blocks:
    """Which block each update belongs to, -1 for those of a burn-in."""

    number: NDArray[np.int64]

    @staticmethod
    def of(lengths: Sequence[int]) -> Blocks:
        """Of recordings with so many updates: as many blocks of each as there are, where one is short, a block is a whole recording."""
        total = sum(lengths)
        number = np.minimum((np.arange(total) * BLOCKS) // max(total, 1), BLOCKS - 1)
        begin = 0
        for n in lengths:
            stay = max(1, int(BURN_IN * min(n, total / BLOCKS)))
            number[begin : begin + stay] = -1
            begin += n
        return Blocks(number)

    def scores(self, problem: Problem, fit: Fit) -> Array:
        """Log predictive density [blocks] of each block by the fit of the others, their noise level integrated out: Student's t."""
        found = []
        for b in range(BLOCKS):
            left = self.number == b
            part = Problem(problem.follower, problem.floor, problem.fixed, left).solve(fit.free, fit.gain, REFIT)
            found.append(predictive(part, left, problem.floor))
        return np.array(found)


def predictive(part: Fit, left: NDArray[np.bool_], floor: Array) -> float:
    """Log density of the innovations left out, by the level of the others, constants apart that all fits share."""
    total = 0.0
    for j in range(part.nu.shape[1]):
        good = np.isfinite(part.nu[:, j])
        ours, theirs = part.nu[good & part.used[:, j], j], part.nu[good & left, j]
        n, m = len(ours), len(theirs)
        if not n or not m:
            continue
        before = max(float(ours @ ours), n * floor[j])
        total += float(gammaln(0.5 * (n + m)) - gammaln(0.5 * n) + 0.5 * n * np.log(before))
        total -= 0.5 * (n + m) * float(np.log(before + max(float(theirs @ theirs), m * floor[j])))
    return total


def posterior(scores: Sequence[Array], seed: int = 1) -> Array:
    """Probability [hypotheses] of each to predict best: block scores [blocks] weighted by Dirichlet draws (Rubin 1981)."""
    table = np.array(scores)
    draws = np.random.default_rng(seed).dirichlet(np.ones(table.shape[1]), DRAWS) * table.shape[1]
    best = np.argmax(draws @ table.T, axis=1)
    return np.bincount(best, minlength=len(table)) / DRAWS
