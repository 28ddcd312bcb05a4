# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The search for what is missing: propose by a score test, fit to innovations, compare on held-out blocks, stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .catalogue import curve
from .evidence.bench import SIZES, Bench
from .evidence.blocks import Blocks
from .evidence.fit import Problem
from .evidence.prior import stated
from .propose import PROMISE, adopt, propose
from .terms import Term, Trial
from .worth import WORTH, Z_95, least

Array = NDArray[np.float64]
SCORED = 4  # of the promising trials, how many are scored on held-out blocks
MIN_GAIN = 10.0  # log density by which a cause predicts left-out blocks better, at least
MIN_FORM = 0.2  # of what a form gains, which one with more values gains beyond it: waves of 3 % in a spring make a peak of 0.13 of a friction
MIN_TAKEN = 0.25  # of the power of a sensor's innovations: what is three times the mis-modelling at its place takes 0.9 there, and a vehicle has three
MIN_BLOCKS = 3  # of the blocks in which it does
LEVEL_FACTORS = (3.0, 10.0, 30.0)  # times a level: those that are tried


@dataclass(frozen=True, eq=False)
class Found:
    """What a search ends with: the bench with all accepted `terms` in it, and a `plain` one with those alone that are worth a name, `named`;
    `small`: the others, with their trials. Of every named one the trials compared, the best first."""

    bench: Bench
    plain: Bench
    terms: tuple[Term, ...]
    named: tuple[Term, ...]
    small: tuple[tuple[Term, Trial], ...]
    rounds: tuple[tuple[Trial, ...], ...]


def search(bench: Bench, log: Callable[[str], None]) -> Found:
    """Causes one by one, each the one that predicts best, until none predicts enough better, or the best is not worth a name and hides none
    that is."""
    terms: list[Term] = []
    named: list[Term] = []
    small: list[tuple[Term, Trial]] = []
    rounds: list[tuple[Trial, ...]] = []
    blocks = Blocks.of([len(r) // bench.update for r in bench.records])
    bench, base = _based(bench, blocks)
    plain = bench
    while good := _good(bench, terms, blocks, base, log):
        best = _simplest(good, base, terms)
        bench, term = adopt(bench, best)
        terms.append(term)
        bench, base = _based(bench, blocks)
        if _large(best, least(bench.level.size)):
            plain, term = adopt(plain, best) if small else (bench, term)
            named.append(term)
            rounds.append(good)
        else:
            small.append((term, best))
            if not any(_hidden(t, best) for t in good):
                break
    return Found(bench, plain, tuple(terms), tuple(named), tuple(small), tuple(rounds))


def _good(bench: Bench, terms: Sequence[Term], blocks: Blocks, base: Array, log: Callable[[str], None]) -> tuple[Trial, ...]:
    """Trials that predict left-out blocks enough better than `base`, the best first; only large ones if there are any."""
    trials, wide = propose(bench, terms, log)
    trials = sorted((t for t in trials if t.gain > PROMISE), key=lambda t: (not _large(t, WORTH), -t.gain))
    trials = [_scored(bench, bench.problem(wide), blocks, t) for t in trials[:SCORED]]
    better = [t.blocks - base for t in trials]
    for t, b in zip(trials, better):
        log(f"{t.form.kind} at {t.form.where} {t.form.note}: {t.gain:.1f} nats, {t.share:.1%}, {t.taken:.1%} of the power, blocks {np.round(b, 1)}")
    good = [t for t, b in zip(trials, better) if _accepted(t, b)]
    good = [t for t in good if not any(_is_enough(part, t) for part in trials)]  # what is left of it without the part is no gain
    good = [t for t in good if _large(t, WORTH)] or good
    return tuple(sorted(good, key=lambda t: -float(np.sum(t.blocks))))


def _hidden(t: Trial, small: Trial) -> bool:
    """May a form elsewhere be large once a small one is in the model? Its force is; what it takes of the innovations is less while others are
    in them, and the level of what wanders is theirs."""
    return t.form.where != small.form.where and t.share >= WORTH


def _large(t: Trial, least_share: float) -> bool:
    """Is a form more than one of many small deviations? A large force that changes little stands for what others do as well."""
    return t.share >= least_share and t.taken >= MIN_TAKEN


def _based(bench: Bench, blocks: Blocks) -> tuple[Bench, Array]:
    """The bench with the level that predicts best, and its scores [blocks]."""
    sizes = [max(bench.level.size, SIZES[1]) * factor for factor in LEVEL_FACTORS]
    level, fit, scores = blocks.fit_level(bench, bench.problem(), bench.fit, bench.level, sizes)
    return replace(bench, level=level, fit=fit), scores


def _scored(bench: Bench, problem: Problem, blocks: Blocks, t: Trial) -> Trial:
    """A trial with how it predicts left-out blocks, and lets parameters be what the file states."""
    own = [] if t.level == bench.level else [bench.level.size]
    level, fit, scores = blocks.fit_level(replace(bench, model=problem.predictor.model), problem, t.fit, t.level, own)
    relief = stated(bench.fit.free) - stated(fit.free)
    return replace(t, level=level, fit=fit, blocks=scores + relief / len(scores))


def _simplest(trials: Sequence[Trial], base: Array, terms: Sequence[Term]) -> Trial:
    """Of the curve that predicts best, the form with the fewest values; one with more where it predicts every block better, and all of
    them by MIN_FORM of what it gains. A new name, too, has to gain that much more than another law of a name already accepted."""

    def more_than(other: Trial) -> float:
        return max(MIN_GAIN, MIN_FORM * float(np.sum(other.blocks - base)))

    named = {(t.form.kind, t.form.where) for t in terms}
    best = next((t for t in trials if (t.form.kind, t.form.where) in named and np.sum(trials[0].blocks - t.blocks) <= more_than(trials[0])), trials[0])
    same = [t for t in trials if t.form.where == best.form.where and curve(t.form.kind) == curve(best.form.kind)]
    found, *more = sorted(same, key=lambda t: (len(t.term.free), -t.gain))
    for t in more:
        better = t.blocks - found.blocks
        if np.all(better > 0.0) and np.sum(better) > more_than(found):
            found = t
    return found


def _is_enough(part: Trial, t: Trial) -> bool:
    """Does a form with some of the laws of another one, a constant beside a friction, predict about as well alone?"""
    laws, more = ([p.law for p in x.form.parts] for x in (part, t))
    within = part.form.index == t.form.index and 0 < len(laws) < len(more) and set(laws) < set(more)
    return within and float(np.sum(t.blocks) - np.sum(part.blocks)) <= MIN_GAIN


def _accepted(t: Trial, better: Array) -> bool:
    """Is a form enough better, with a size that is not zero?"""
    if not (np.sum(better > 0.0) >= MIN_BLOCKS and np.sum(better) > MIN_GAIN):
        return False
    return all(abs(t.fit.value(f.target) - f.origin) > Z_95 * t.fit.deviation(f.target) for f in t.term.free if not f.log)
