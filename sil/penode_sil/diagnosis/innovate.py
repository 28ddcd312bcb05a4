# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The search for what is missing: propose by a score test, fit to innovations, compare on held-out blocks, stop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from . import holding
from .adopting import adopt
from .catalogue import curve
from .evidence.bench import SIZES, Bench
from .evidence.blocks import Blocks
from .evidence.fit import Problem
from .evidence.prior import stated
from .propose import PROMISE, is_part, propose
from .terms import Term, Trial
from .worth import WORTH, Z_95, alone, least, mostly, undetermined

Array = NDArray[np.float64]
SCORED = 4  # of the promising trials, how many are scored on held-out blocks
MIN_GAIN = 10.0  # log density by which a cause predicts left-out blocks better, at least
MIN_FORM = 0.2  # of what a form gains, which one with more values gains beyond it: waves of 3 % in a spring make a peak of 0.13 of a friction
MIN_TAKEN = 0.25  # of the power of a sensor's innovations: what is three times the mis-modelling at its place takes 0.9 there, and a vehicle has three
MIN_BLOCKS = 3  # of the blocks in which it does
LEVEL_FACTORS = (3.0, 10.0, 30.0)  # times a level: those that are tried


@dataclass(frozen=True, eq=False)
class Accepted:
    """A form that was accepted: its trial, what it is in the bench, one term for each kind of its laws, and the `trials` compared in its
    round, the best first."""

    trial: Trial
    terms: tuple[Term, ...]
    trials: tuple[Trial, ...]


@dataclass(frozen=True, eq=False)
class Found:
    """What a search ends with: the bench with all accepted `terms` in it, and a `plain` one with those forms alone that are worth a name,
    `named`, with their terms in it; `small`: the others."""

    bench: Bench
    terms: tuple[Term, ...]
    plain: Bench
    named: tuple[Accepted, ...]
    small: tuple[Accepted, ...]


def search(bench: Bench, log: Callable[[str], None]) -> Found:
    """Accepts causes one at a time, the best predictor first, until none predicts enough better, or the best is too small for a name and
    cannot hide a larger one. A small one that takes most of what is missed may be all of it but for one other cause: if that is found, what
    wanders beside both is little, and all are judged again by that."""
    accepted: list[Accepted] = []
    large: list[bool] = []
    blocks = Blocks.of([len(r) // bench.update for r in bench.records])
    bench, base = _based(bench, blocks)
    start, hides = bench, True
    while good := _good(bench, [x for a in accepted for x in a.terms], blocks, base, log):
        best = _simplest(good, base, [x for a in accepted for x in a.terms])
        if not hides and not _matters(best):
            break
        bench, terms = adopt(bench, best, len(accepted))
        bench, base = _based(bench, blocks)
        accepted.append(Accepted(best, tuple(terms), good))
        large.append(_large(best, least(bench.level.size, best.whole)))
        hides = large[-1] or any(_hidden(t, best) for t in good)
        if not hides and not mostly(best.whole):
            break
    if accepted and alone(accepted[-1].trial.whole):
        large = [_large(a.trial, least(bench.level.size, a.trial.whole)) for a in accepted]
    return _apart(start, bench, accepted, large)


def _apart(start: Bench, bench: Bench, accepted: Sequence[Accepted], large: Sequence[bool]) -> Found:
    """What a search has accepted, the large forms in a bench of their own."""
    plain, named = start, []
    for number, a in ((n, a) for n, (a, big) in enumerate(zip(accepted, large)) if big):
        plain, terms = (bench, a.terms) if all(large) else adopt(plain, a.trial, number)
        named.append(Accepted(a.trial, tuple(terms), a.trials))
    small = tuple(a for a, big in zip(accepted, large) if not big)
    return Found(bench, tuple(x for a in accepted for x in a.terms), plain, tuple(named), small)


def _good(bench: Bench, terms: Sequence[Term], blocks: Blocks, base: Array, log: Callable[[str], None]) -> tuple[Trial, ...]:
    """Trials that predict left-out blocks better than `base` by MIN_GAIN, the best first. If a large form predicts as well as the best, to MIN_GAIN,
    only large ones; otherwise the large form only imitates a smaller one."""
    trials, wide = propose(bench, terms, log)
    trials = sorted((t for t in trials if t.gain > PROMISE), key=lambda t: (not _matters(t), -t.gain))
    trials = holding.told_apart(bench, wide, [_scored(bench, bench.problem(wide), blocks, t) for t in trials[:SCORED]])
    better = [t.blocks - base for t in trials]
    for t, b in zip(trials, better):
        log(f"{t.form.kind} at {t.form.where} {t.form.note}: {t.gain:.1f} nats, {t.share:.1%}, {t.taken:.1%} of the power, blocks {np.round(b, 1)}")
    good = [t for t, b in zip(trials, better) if _accepted(bench, t, b)]
    good = [t for t in good if not any(_is_enough(part, t) for part in trials)]  # what is left of it without the part is no gain
    matter = [t for t in good if _matters(t)]
    if matter and max(np.sum(t.blocks) for t in good) - max(np.sum(t.blocks) for t in matter) <= MIN_GAIN:
        good = matter
    return tuple(sorted(good, key=lambda t: -float(np.sum(t.blocks))))


def _hidden(t: Trial, small: Trial) -> bool:
    """May a form at another place prove large once a small one is in the model? Its force is large enough; its share of the innovations
    rises when the small one is gone."""
    return t.form.where != small.form.where and t.share >= WORTH


def _matters(t: Trial) -> bool:
    """Is a form large, or, as small as it is, nearly all that is missed?"""
    return _large(t, WORTH) or alone(t.whole)


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
    them by MIN_FORM of what it gains. Curves that predict equally well, to MIN_GAIN, also rank by their values. A new name has to gain
    as much more than another law of a name already accepted as a form has."""

    def more_than(other: Trial) -> float:
        return max(MIN_GAIN, MIN_FORM * float(np.sum(other.blocks - base)))

    named = {(t.form.kind, t.form.where) for t in terms}
    first = min((t for t in trials if np.sum(trials[0].blocks - t.blocks) <= MIN_GAIN), key=lambda t: (len(t.term.free), -np.sum(t.blocks)))
    best = next((t for t in trials if (t.form.kind, t.form.where) in named and np.sum(trials[0].blocks - t.blocks) <= more_than(trials[0])), first)
    same = [t for t in trials if t.form.where == best.form.where and curve(t.form.kind) == curve(best.form.kind)]
    found, *more = sorted(same, key=lambda t: (len(t.term.free), -t.gain))
    for t in more:
        better = t.blocks - found.blocks
        if np.all(better > 0.0) and np.sum(better) > more_than(found):
            found = t
    return found


def _is_enough(part: Trial, t: Trial) -> bool:
    """Does a form with some of the laws of another one, a constant beside a friction, predict about as well alone?"""
    return is_part(part.form, t.form) and float(np.sum(t.blocks) - np.sum(part.blocks)) <= MIN_GAIN


def _accepted(bench: Bench, t: Trial, better: Array) -> bool:
    """Is a form enough better, with a size that is not zero?"""
    if not (np.sum(better > 0.0) >= MIN_BLOCKS and np.sum(better) > MIN_GAIN):
        return False
    known = undetermined(bench.model, t.fit)
    return all(abs(t.fit.value(f.target) - f.origin) > Z_95 * t.fit.deviation(f.target, known) for f in t.term.free if not f.log)
