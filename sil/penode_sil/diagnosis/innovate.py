# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The search for what is missing: propose by a score test, fit to innovations, compare on held-out blocks, stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import catalogue
from .catalogue.form import Form
from .evidence.bench import Bench
from .evidence.blocks import Blocks
from .evidence.fit import Fit, Problem
from .propose import Term, Trial, adopt, propose

Array = NDArray[np.float64]
KEPT = 3  # of which so many have to predict blocks
NATS = 10.0  # log density by which a cause predicts left-out blocks better, at least
SHARE = 0.1  # and of what the first cause gains
AGREE = 3  # of the blocks in which it does
HOPE = 0.5  # of that, which a criterion has to promise before blocks are asked
WIDER = (3.0, 10.0, 30.0)  # times a level: those that are tried
LEAST = 1e-4  # level that is as good as none
CAUSES = 4  # at most
INTERVAL = 1.96  # standard deviations that hold 95 %


@dataclass(frozen=True, eq=False)
class Found:
    """What a search ends with: the bench with all accepted terms in it, and of every round the trials compared, the best first."""

    bench: Bench
    terms: tuple[Term, ...]
    rounds: tuple[tuple[Trial, ...], ...]
    null: Fit


def search(bench: Bench, log: Callable[[str], None]) -> Found:
    """Causes one by one, each the one that predicts best, until none predicts enough better."""
    terms: list[Term] = []
    rounds: list[tuple[Trial, ...]] = []
    null, first = bench.fit, 0.0
    lengths = [len(r) // bench.update for r in bench.records]
    blocks = Blocks.of(lengths)
    bench, base = _based(bench, blocks)
    while len(terms) < CAUSES:
        trials, wide = propose(bench, terms, log)
        trials = [_scored(bench, bench.problem(wide), blocks, t) for t in trials[:KEPT] if t.gain > HOPE * NATS]
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
    return Found(bench, tuple(terms), tuple(rounds), null)


def _based(bench: Bench, blocks: Blocks) -> tuple[Bench, Array]:
    """The bench with the level that predicts best, and its scores [blocks]."""
    sizes = [max(bench.level.size, LEAST) * factor for factor in WIDER]
    level, fit, scores = blocks.leveled(bench, bench.problem(), bench.fit, bench.level, sizes)
    return replace(bench, level=level, fit=fit), scores


def _scored(bench: Bench, problem: Problem, blocks: Blocks, t: Trial) -> Trial:
    own = [] if t.level == bench.level else [bench.level.size]
    level, fit, scores = blocks.leveled(replace(bench, model=problem.follower.model), problem, t.fit, t.level, own)
    return replace(t, level=level, fit=fit, blocks=scores)


def _simplest(trials: Sequence[Trial]) -> Trial:
    """Of the curve that predicts best, the form with the fewest values; one with more where it predicts every block better, and all of
    them by NATS."""
    first = trials[0].form
    same = [t for t in trials if t.form.where == first.where and _curve(t.form) is _curve(first)]
    found, *more = sorted(same, key=lambda t: (len(t.term.free), -t.gain))
    for t in more:
        better = t.blocks - found.blocks
        if np.all(better > 0.0) and np.sum(better) > NATS:
            found = t
    return found


def _curve(form: Form) -> object:
    """The file of the catalogue that a form is of, where only one of it is at a place; else its kind."""
    file = catalogue.OF.get(form.kind)
    return file if getattr(file, "ONE", False) else form.kind


def _accepted(t: Trial, base: Array, first: float) -> bool:
    """Does a form predict left-out blocks enough better, with a size that is not zero?"""
    better = t.blocks - base
    if not (np.sum(better > 0.0) >= AGREE and np.sum(better) > max(NATS, SHARE * first)):
        return False
    return all(abs(t.fit.value(f.target) - f.origin) > INTERVAL * t.fit.deviation(f.target) for f in t.term.free if not f.log)


