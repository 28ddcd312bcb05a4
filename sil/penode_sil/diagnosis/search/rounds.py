# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rounds of the search: propose by a score test, fit to innovations, compare on held-out blocks, accept the best, until none is good."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ..catalogue import curve
from ..catalogue.form import Form
from ..evidence.bench import SIZES, Bench, fit_level
from ..evidence.blocks import BLOCKS, Blocks
from ..evidence.fit import Fit, Problem
from ..evidence.gain import Level
from ..evidence.prior import SHARE, Stated, stated
from ..evidence.screening import Probe
from ..extend import late
from ..study.fit import Target
from . import holding
from .adopting import adopt
from .propose import FOLLOWED, PROMISE, is_part, motions, propose
from .terms import Term, Trial, without_any
from .worth import MIN_GAIN, WORTH, Z_95, alone, least, mostly, share, undetermined, wrong

Array = NDArray[np.float64]
SCORED = 4  # of the promising trials, how many are scored on held-out blocks, beside the one with the best free run
MIN_FORM = (
    0.2  # of what a form gains, which one with more values gains beyond it: waves of 3 % in a spring make a peak of 0.13 of a friction
)
# of the power of a sensor's innovations: what is three times the mis-modelling at its place takes 0.9 there, and a vehicle has three
MIN_TAKEN = 0.25
MIN_BLOCKS = BLOCKS - 1  # in which it does
LEVEL_FACTORS = (3.0, 10.0, 30.0)  # times a level: those that are tried


@dataclass(frozen=True, eq=False)
class Accepted:
    """An accepted form: its `trial`; the `number` in its parameter names; its `terms` in the bench, one for each kind of law; and the
    `trials` it was compared with, best first."""

    trial: Trial
    number: int
    terms: tuple[Term, ...]
    trials: tuple[Trial, ...]


@dataclass(frozen=True, eq=False)
class Grown:
    """The state of a search: the bench with all accepted forms, its `scores` [blocks] on held-out blocks, which forms are `large`, and
    `rest`, the good trials not accepted."""

    bench: Bench
    scores: Array
    accepted: tuple[Accepted, ...]
    large: tuple[bool, ...]
    rest: tuple[Trial, ...]


@dataclass(frozen=True, eq=False)
class Tried:
    """The `first` trials beside accepted `forms` (kept, for their identity is the key), and the promising ones `scored`, in a bench of
    the score `total`."""

    forms: tuple[Form, ...]
    first: list[Trial]
    scored: list[Trial]
    total: float


@dataclass(frozen=True, eq=False)
class Rounds:
    """Rounds of a search that starts from a bench without any cause. Causes are proposed by an observer for `stiffer` times less unmodelled
    force than there is. What was `tried` beside the same forms is not tried again; forms of the names `without` are not found."""

    start: Bench
    blocks: Blocks
    log: Callable[[str], None]
    stiffer: float = 1.0
    tried: dict[tuple[object, ...], Tried] = field(default_factory=dict)
    without: frozenset[tuple[str, str]] = frozenset()

    def grow(self, accepted: Sequence[Accepted] = ()) -> Grown:
        """Accepts causes beside those accepted already, one at a time, the best predictor first, until none predicts enough better, or the
        best is too small for a name and cannot hide a larger one. The search goes on after a small form that takes most of the misfit, or
        that every block demands (`_is_sure`), or, while none is large, enough that little may remain: one more cause may explain the rest.
        If it does, all forms are judged again by the smaller level that remains."""
        bench, scores, found = self.beside(accepted)
        good = self.good(bench, scores, found)
        if not good and not found and bench.level.size >= WORTH:
            bench, scores, found = self.beside(self.pair(bench, scores))
            good = self.good(bench, scores, found) if found else ()
        large = [is_large(a.trial, least(bench.level.size, a.trial.whole)) for a in found]
        hides = not found or large[-1] or any(_hidden(t, found[-1].trial) for t in found[-1].trials)
        while good:
            best = simplest(good, scores, terms_of(found))
            sure = _is_sure(bench, best, scores, found)
            if not hides and not sure and not _matters(best) and not _may_remain(bench, large, best):
                break
            number = 1 + max((a.number for a in found), default=-1)
            best, bench, terms = _adopted(bench, best, good, number)
            bench, scores = _based(bench, self.blocks)
            rivals = tuple(replace(t, blocks=scores) if t is best else t for t in good)  # with edges as steep as they are now
            found.append(Accepted(best, number, tuple(terms), rivals))
            large.append(is_large(best, least(bench.level.size, best.whole)))
            hides = large[-1] or any(_hidden(t, best) for t in good)
            if not hides and not sure and not mostly(best.whole) and not _may_remain(bench, large, best):
                good = ()
                break
            good = self.good(bench, scores, found)
        if found and (alone(found[-1].trial.whole) or least(bench.level.size, 0.0) < WORTH):
            large = [is_large(a.trial, least(bench.level.size, a.trial.whole)) for a in found]
        return Grown(bench, scores, tuple(found), tuple(large), good)

    def pair(self, bench: Bench, scores: Array) -> list[Accepted]:
        """Two causes that together predict left-out blocks better than `scores`, where no cause does alone: the delay and the friction of a
        drive that starts from rest. Empty without any."""
        best, total = [], float(np.sum(scores)) + 2.0 * MIN_GAIN
        for t in (scored(bench, self.blocks, x) for x in self.trials(bench, scores, ()).first):
            beside, terms = adopt(bench, t, 0)
            beside, level = _based(beside, self.blocks)
            first = Accepted(t, 0, tuple(terms), (t,))
            if good := self.good(beside, level, [first]):
                second = simplest(good, level, terms)
                if np.sum(second.blocks > scores) >= MIN_BLOCKS and np.sum(second.blocks) > total:
                    best, total = [first, Accepted(second, 1, (), good)], float(np.sum(second.blocks))
        self.log(f"a pair: {[name_of(a.trial) for a in best]}")
        return best

    def beside(self, accepted: Sequence[Accepted]) -> tuple[Bench, Array, list[Accepted]]:
        """Rebuilds the bench with these forms; returns it, its scores, and the forms with the share of their name in it. What a form took
        of the misfit stays that of its round."""
        bench, found = self.start, []
        for a in accepted:
            bench, terms = adopt(bench, a.trial, a.number)
            found.append(replace(a, terms=tuple(terms)))
        moved = motions(Probe.of(bench)) if found else []
        same = [[x for o in found if name_of(o.trial) == name_of(a.trial) for x in o.terms] for a in found]
        shares = [share(bench, terms, bench.fit, moved) for terms in same]
        found = [replace(a, trial=replace(a.trial, share=x)) for a, x in zip(found, shares, strict=True)]
        return *_based(bench, self.blocks), found

    def score_without(self, grown: Grown, gone: Sequence[Accepted]) -> float:
        """Score of all held-out blocks without some of the forms, the rest fitted again at the level that there is."""
        own = {f.target for x in terms_of(gone) for f in x.free}
        bench = grown.bench
        problem = bench.problem(without_any(bench.model, terms_of(gone)))
        fit = problem.solve([f for f in bench.fit.free if f.target not in own], bench.fit.by, FOLLOWED) if own else bench.fit
        return float(np.sum(self.blocks.scores(problem, fit))) - stated(fit.free)

    def trials(self, bench: Bench, scores: Array, accepted: Sequence[Accepted]) -> Tried:
        """Trials beside accepted forms in a bench with these scores, and the promising ones scored, with the one of the best free run. They
        are those of before if that bench had the same score, to PROMISE."""
        forms = tuple(a.trial.form for a in accepted)
        key = self.stiffer, self.without, *((a.number, id(f)) for a, f in zip(accepted, forms, strict=True))
        total = float(np.sum(scores))
        if key not in self.tried or abs(self.tried[key].total - total) > PROMISE:
            every = [t for t in propose(bench, terms_of(accepted), self.log, self.stiffer) if name_of(t) not in self.without]
            promising = sorted((t for t in every if t.gain > PROMISE), key=lambda t: (not _matters(t), -t.gain))
            freest = sorted(promising, key=lambda t: -t.run)[:1]
            some = [t for t in promising if t in promising[:SCORED] or t in freest]
            found = holding.told_apart(bench, [scored(bench, self.blocks, t) for t in some])
            self.tried[key] = Tried(forms, every[:SCORED], found, total)
        return self.tried[key]

    def good(self, bench: Bench, scores: Array, accepted: Sequence[Accepted]) -> tuple[Trial, ...]:
        """Trials that predict left-out blocks better than `scores` by MIN_GAIN, the best first. If a large form predicts as well as the
        best, to MIN_GAIN, and needs no more values, only large ones; otherwise the large form only imitates a smaller one."""
        trials = self.trials(bench, scores, accepted).scored
        better = [t.blocks - scores for t in trials]
        for t, b in zip(trials, better, strict=True):
            self.log(
                f"{t.form.kind} at {t.form.where} {t.form.note}: {t.gain:.1f} nats, {t.share:.1%}, "
                f"{t.taken:.1%} of the power, blocks {np.round(b, 1)}"
            )
        good = [t for t, b in zip(trials, better, strict=True) if _accepted(bench, t, b)]
        good = [t for t in good if not any(_is_enough(part, t) for part in trials)]  # what is left of it without the part is no gain
        matter = [t for t in good if _matters(t)]
        if matter:
            large = max(matter, key=score)
            if not any(score(t) > score(large) + MIN_GAIN or _is_imitated(t, large, scores) for t in good):
                good = matter
        return tuple(like_the_file(sorted(good, key=lambda t: -score(t)), scores))


def terms_of(accepted: Sequence[Accepted]) -> list[Term]:
    """All terms of accepted forms."""
    return [x for a in accepted for x in a.terms]


def _adopted(bench: Bench, best: Trial, good: Sequence[Trial], number: int) -> tuple[Trial, Bench, list[Term]]:
    """Adopts the best trial, or one of the same name with as many values, if that fits better with its edges as steep as they are: a peak
    that falls more slowly makes up for an edge that is too wide."""

    def likeness(t: Trial) -> tuple[object, ...]:
        return name_of(t), len(t.term.free), any(p.edge for p in t.form.parts)

    alike = [t for t in good if t is best or (likeness(t) == likeness(best) and any(p.edge for p in t.form.parts))]
    return max(((t, *adopt(bench, t, number)) for t in alike), key=lambda x: x[1].fit.cost)


def _hidden(t: Trial, small: Trial) -> bool:
    """May a form at another place prove large once a small one is in the model? Its force is large enough; its share of the innovations
    rises when the small one is gone."""
    return t.form.at != small.form.at and t.share >= WORTH


def _may_remain(bench: Bench, large: Sequence[bool], best: Trial) -> bool:
    """May small forms together leave so little that they have names? Where none is large, the last has taken its share of a sensor's
    innovations, and the unmodelled force is small already."""
    return not any(large) and best.taken >= MIN_TAKEN and least(bench.level.size, 0.0) < WORTH


def _is_sure(bench: Bench, best: Trial, scores: Array, found: Sequence[Accepted]) -> bool:
    """Does every block demand a form by MIN_GAIN, where little is unmodelled, and more of it than the curve of another one may be off?"""
    demanded = bool(np.all(best.blocks - scores > MIN_GAIN)) and least(bench.level.size, 0.0) < WORTH
    return demanded and all(best.gain >= MIN_FORM * a.trial.gain for a in found)


def _matters(t: Trial) -> bool:
    """Is a form large, or, as small as it is, nearly all that is missed?"""
    return is_large(t, WORTH) or alone(t.whole)


def is_large(t: Trial, least_share: float) -> bool:
    """Is a form more than one of many small deviations? A large force that changes little stands for what others do as well."""
    return t.share >= least_share and t.taken >= MIN_TAKEN


def levels(level: Level) -> list[float]:
    """Larger sizes of the unmodelled force that are tried, up to all forces: beyond that an observer follows any motion."""
    return [size for factor in LEVEL_FACTORS if (size := max(level.size, SIZES[1]) * factor) <= 1.0]


def _based(bench: Bench, blocks: Blocks) -> tuple[Bench, Array]:
    """The bench with the level that predicts best, and its scores [blocks], less what parameters cost that are not what the file states.
    The likeliest comes first: a form that is new there lets it fall, which would count for the next form otherwise."""
    problem = bench.problem()
    level, fit = _converged(bench, problem)
    level, fit, scores = blocks.fit_level(bench, problem, fit, level, levels(level))
    return replace(bench, level=level, fit=fit), scores - stated(fit.free) / len(scores)


def _converged(bench: Bench, problem: Problem) -> tuple[Level, Fit]:
    """The likeliest level and fit from those of a bench on, as long as going on gains PROMISE: along a narrow valley, the iterations of any
    trial are progress too."""
    level, fit, gained = bench.level, bench.fit, np.inf
    while gained > PROMISE:
        before = fit.cost
        level, fit = fit_level(bench, problem, problem.solve(fit.free, fit.by, FOLLOWED), level)
        gained = fit.cost - before
    return level, fit


def scored(bench: Bench, blocks: Blocks, t: Trial) -> Trial:
    """A trial with its scores, as those of a bench."""
    own = [] if t.level == bench.level else [bench.level.size]
    level, fit, scores = blocks.fit_level(replace(bench, model=t.model), bench.problem(t.model), t.fit, t.level, own)
    return replace(t, level=level, fit=fit, blocks=scores - stated(fit.free) / len(scores))


def simplest(trials: Sequence[Trial], base: Array, terms: Sequence[Term]) -> Trial:
    """Of the curve that predicts best, the form with the fewest values; one with more where it predicts blocks better (`_in_all`), and all
    of them by `margin`. Curves that predict equally well, to MIN_GAIN, also rank by their values; to more, where one has half of
    them (`_simplicity`). A new name has to gain as much more than another law of a name already accepted as a form has."""
    named, most = {name_of(t) for t in terms}, trials[0]
    alike = [t for t in trials if np.sum(most.blocks - t.blocks) <= margin(t, base, _simplicity(t, most))]
    first = min(alike, key=lambda t: (_values(t, most) - _values(most, t), -np.sum(t.blocks)))
    best = next((t for t in trials if name_of(t) in named and np.sum(most.blocks - t.blocks) <= margin(most, base)), first)
    same = [t for t in trials if of_curve(t) == of_curve(best)]
    found, *more = sorted(same, key=lambda t: (len(t.term.free), -t.gain))
    for t in more:
        better, same_name = t.blocks - found.blocks, name_of(t) == name_of(found)
        nested = same_name or is_part(found.form, t.form)
        share = max(wrong(t.level.size), 0.0 if same_name else MIN_FORM) if nested else 1.0
        if _in_all(better) and np.sum(better) > margin(found, base, share):
            found = t
    return found


def like_the_file(trials: Sequence[Trial], base: Array) -> list[Trial]:
    """Trials, the best first, without those at the place of the best that are about as good (`margin`) as one there whose fit takes fewer
    values of the file away: one curve in two words, for a stop beside a spring that has gone is a play."""
    near = [t for t in trials if t.form.at == trials[0].form.at and np.sum(trials[0].blocks - t.blocks) <= margin(t, base)]
    gone = [sum(isinstance(f, Stated) and mostly(1.0 - f.value / f.origin) for f in t.fit.free) for t in near]
    return [t for t in trials if t not in near or gone[near.index(t)] == min(gone)]


def _simplicity(t: Trial, other: Trial) -> float:
    """Share of MIN_FORM by which a form may gain less than another of more values: MIN_FORM where it has half of them, all where it has
    less. A mass on a spring and a damper may stand for many a law with one value, a spring and a damper for a delay."""
    more = beyond_twice(_values(other, t), _values(t, other))
    return float(more > 0) or MIN_FORM * (more >= 0)


def beyond_twice(values: int, others: int) -> int:
    """How many values there are more than twice as many as others; below zero for fewer."""
    return values - 2 * others


def _is_imitated(t: Trial, large: Trial, base: Array) -> bool:
    """Does a form gain about as much as a large one that takes more than twice its values?"""
    return beyond_twice(_values(large, t), _values(t, large)) > 0 and score(large) - score(t) <= margin(t, base)


def score(t: Trial) -> float:
    """Of all held-out blocks."""
    return float(np.sum(t.blocks))


def _values(t: Trial, other: Trial) -> int:
    """Values that a form takes: its own, and those of the file that it moves out of their tolerances and another form leaves there."""
    return len(t.term.free) + len(moved(t.fit) - moved(other.fit))


def moved(fit: Fit) -> set[Target]:
    """Values of the file that are surely out of their tolerances."""
    stated = [f for f in fit.free if isinstance(f, Stated)]
    return {f.target for f in stated if abs(f.value - f.origin) > f.sigma / SHARE + Z_95 * fit.deviation(f.target)}


def margin(t: Trial, base: Array, share: float = 1.0) -> float:
    """What another form has to gain beyond a trial if it has more values, or another name: a `share` of MIN_FORM of its gain. One that has
    all laws of the trial, and more, or the same name, has to gain less where the world is less wrong: waves in other curves look like more
    laws."""
    return max(MIN_GAIN, share * MIN_FORM * float(np.sum(t.blocks - base)))


def _is_enough(part: Trial, t: Trial) -> bool:
    """Does a form with some of the laws of another one, a constant beside a friction, predict about as well alone?"""
    return is_part(part.form, t.form) and float(np.sum(t.blocks) - np.sum(part.blocks)) <= MIN_GAIN


def _in_all(better: Array) -> bool:
    """Is it better in MIN_BLOCKS of the blocks, and in no other one worse by MIN_GAIN and by more than it gains on average?"""
    return bool(np.sum(better > 0.0) >= MIN_BLOCKS and -np.min(better) < max(MIN_GAIN, float(np.mean(better))))


def _accepted(bench: Bench, t: Trial, better: Array) -> bool:
    """Is a form enough better in all blocks, its size not zero, nor a delay too short to be one?"""
    if not _in_all(better) or np.sum(better) <= MIN_GAIN:
        return False
    if t.form.how in late.HOW and t.fit.value(t.term.free[0].target) < late.SHORT * bench.step:
        return False
    known = undetermined(bench.model, t.fit)
    return all(abs(t.fit.value(f.target) - f.origin) > Z_95 * t.fit.deviation(f.target, known) for f in t.term.free if not f.log)


def of_curve(t: Trial) -> tuple[object, int | str]:
    return curve(t.form.kind), t.form.at


def name_of(t: Term | Trial) -> tuple[str, str]:
    return t.form.kind, t.form.where
