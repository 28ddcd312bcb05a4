# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The search for what is missing: propose by a score test, fit to innovations, compare on held-out blocks, stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .catalogue import curve
from .evidence.bench import Bench
from .evidence.blocks import Blocks
from .evidence.fit import Problem
from .propose import Term, Trial, adopt, propose

Array = NDArray[np.float64]
SCORED = 3  # of which so many have to predict blocks
MIN_GAIN = 10.0  # log density by which a cause predicts left-out blocks better, at least
MIN_SHARE = 0.1  # and of what the first cause gains
MIN_BLOCKS = 3  # of the blocks in which it does
MIN_CRITERION = 0.5  # of that, which a criterion has to promise before blocks are asked
LEVEL_FACTORS = (3.0, 10.0, 30.0)  # times a level: those that are tried
MIN_LEVEL = 1e-4  # level that is as good as none
MAX_CAUSES = 4  # at most
Z_95 = 1.96  # standard deviations that hold 95 %


@dataclass(frozen=True, eq=False)
class Found:
    """What a search ends with: the bench with all accepted terms in it, and of every round the trials compared, the best first."""

    bench: Bench
    terms: tuple[Term, ...]
    rounds: tuple[tuple[Trial, ...], ...]


def search(bench: Bench, log: Callable[[str], None]) -> Found:
    """Causes one by one, each the one that predicts best, until none predicts enough better."""
    terms: list[Term] = []
    rounds: list[tuple[Trial, ...]] = []
    first = 0.0
    lengths = [len(r) // bench.update for r in bench.records]
    blocks = Blocks.of(lengths)
    bench, base = _based(bench, blocks)
    while len(terms) < MAX_CAUSES:
        trials, wide = propose(bench, terms, log)
        trials = [_scored(bench, bench.problem(wide), blocks, t) for t in trials[:SCORED] if t.gain > MIN_CRITERION * MIN_GAIN]
        for t in trials:
            log(f"{t.form.kind} at {t.form.where} {t.form.note}: {t.gain:.1f} nats, blocks {np.round(t.blocks - base, 1)}")
        good = [t for t in trials if _accepted(t, base, first)]
        rounds.append(tuple(sorted(good, key=lambda t: -float(np.sum(t.blocks)))))
        if not good:
            break
        best = _simplest(rounds[-1])
        first = first or float(np.sum(best.blocks - base))
        bench, term = adopt(bench, best)
        terms.append(term)
        bench, base = _based(bench, blocks)
    return Found(bench, tuple(terms), tuple(rounds))


def _based(bench: Bench, blocks: Blocks) -> tuple[Bench, Array]:
    """The bench with the level that predicts best, and its scores [blocks]."""
    sizes = [max(bench.level.size, MIN_LEVEL) * factor for factor in LEVEL_FACTORS]
    level, fit, scores = blocks.fit_level(bench, bench.problem(), bench.fit, bench.level, sizes)
    return replace(bench, level=level, fit=fit), scores


def _scored(bench: Bench, problem: Problem, blocks: Blocks, t: Trial) -> Trial:
    own = [] if t.level == bench.level else [bench.level.size]
    level, fit, scores = blocks.fit_level(replace(bench, model=problem.predictor.model), problem, t.fit, t.level, own)
    return replace(t, level=level, fit=fit, blocks=scores)


def _simplest(trials: Sequence[Trial]) -> Trial:
    """Of the curve that predicts best, the form with the fewest values; one with more where it predicts every block better, and all of
    them by MIN_GAIN."""
    first = trials[0].form
    same = [t for t in trials if t.form.where == first.where and curve(t.form.kind) == curve(first.kind)]
    found, *more = sorted(same, key=lambda t: (len(t.term.free), -t.gain))
    for t in more:
        better = t.blocks - found.blocks
        if np.all(better > 0.0) and np.sum(better) > MIN_GAIN:
            found = t
    return found


def _accepted(t: Trial, base: Array, first: float) -> bool:
    """Does a form predict left-out blocks enough better, with a size that is not zero?"""
    better = t.blocks - base
    if not (np.sum(better > 0.0) >= MIN_BLOCKS and np.sum(better) > max(MIN_GAIN, MIN_SHARE * first)):
        return False
    return all(abs(t.fit.value(f.target) - f.origin) > Z_95 * t.fit.deviation(f.target) for f in t.term.free if not f.log)


