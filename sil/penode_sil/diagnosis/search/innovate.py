# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The search by innovations for missing effects of a model: the forms accepted, and those large enough to be named."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..evidence.bench import Bench
from ..evidence.blocks import BLOCKS, Blocks
from ..evidence.fit import Fit
from ..evidence.observer import Filter, bias
from ..evidence.screening import Probe
from .propose import FREE_RUN, motions
from .reconsider import at_one_place, centred, needed, reconsidered, stands_for_mass
from .rounds import LEVEL_FACTORS, MIN_FORM, Accepted, Grown, Rounds, is_large, name_of, terms_of
from .terms import Term, Trial
from .worth import FINEST, MIN_GAIN, RATIO, Z_95, least, mostly, remaining


@dataclass(frozen=True, eq=False)
class Found:
    """What a search has found: its `rounds` and their `end`; `plain`, a bench with only the forms worth naming (`named`, with their terms
    there); `small`, the other forms; the free `run` that fits best, with those sensor offsets that are surely none of noise; and the
    unmodelled `level` that remains, see `remaining`."""

    rounds: Rounds
    end: Grown
    plain: Bench
    named: tuple[Accepted, ...]
    small: tuple[Accepted, ...]
    run: Fit
    level: float

    @property
    def bench(self) -> Bench:
        """With all accepted forms."""
        return self.end.bench

    @property
    def possible(self) -> float:
        """The level that may remain where a free run shows none, for what no innovations alone require: parameters, offsets."""
        return max(self.level, self.bench.level.size)

    @property
    def terms(self) -> list[Term]:
        """All terms in it."""
        return terms_of(self.end.accepted)

    def naming(self, more: Sequence[Accepted]) -> Found:
        """The same with some of the small forms named too."""
        numbers = {a.number for a in (*self.named, *more)}
        return _found(self.rounds, self.end, [a.number in numbers for a in self.end.accepted], self.run, self.level)


def search(bench: Bench, log: Callable[[str], None]) -> Found:
    """Accepts causes round by round, revises early choices once later ones are known, and puts the large forms in a bench of their own.
    Where none is large, it looks again with an observer that corrects less: one that follows all that moves hides what happens seldom.
    It resumes without forms that only stand for another mass. Where a large one only makes up for others, it may hide one of them: the
    search resumes without it, and that end counts if more has a name in it and it predicts as well."""
    rounds = Rounds(bench, Blocks.moving(bench), log)
    end = reconsidered(rounds, rounds.grow())
    if not any(end.large) and bench.level.size > 0.0:
        stiffer = replace(rounds, stiffer=LEVEL_FACTORS[1])
        again = reconsidered(stiffer, stiffer.grow())
        rounds, end = (stiffer, again) if any(again.large) else (rounds, end)
    ended = _freely(rounds, centred(rounds, end))
    while ended.masses:
        rounds = replace(rounds, without=rounds.without | {name_of(a.trial) for a in ended.masses})
        log(f"stand for another mass: {sorted(rounds.without)}")
        others = [a for a in ended.end.accepted if a not in ended.masses]
        known = [replace(a, trials=tuple(t for t in a.trials if name_of(t) not in rounds.without)) for a in others]
        ended = _freely(rounds, rounds.grow(known))
    if kept := ended.without_what_makes_up():
        other = _freely(rounds, rounds.grow(kept))
        log(f"without what makes up for others: {[name_of(a.trial) for a in other.of_names]}")
        as_good = float(np.sum(other.end.scores)) > float(np.sum(ended.end.scores)) - MIN_GAIN
        ended = other if as_good and len(other.of_names) > len(ended.of_names) and not other.masses else ended
    rounds.tried.clear()  # slopes of every trial
    return _found(rounds, ended.end, ended.names, ended.run, ended.level)


@dataclass(frozen=True, eq=False)
class Ended:
    """The end of a search, which of its forms have `names`, the free `run` that fits best, the unmodelled `level` that remains, and forms
    that only stand for other `masses`."""

    end: Grown
    names: list[bool]
    run: Fit
    level: float
    masses: list[Accepted] = field(default_factory=list)

    @property
    def of_names(self) -> list[Accepted]:
        return [a for a, named in zip(self.end.accepted, self.names, strict=True) if named]

    def without_what_makes_up(self) -> list[Accepted]:
        """The forms without those large ones that have no name, for they make up for others; none if all large ones have."""
        kept = [a for a, big, named in zip(self.end.accepted, self.end.large, self.names, strict=True) if named or not big]
        return kept if len(kept) < len(self.end.accepted) else []


def _freely(rounds: Rounds, end: Grown) -> Ended:
    """The end of a search after free runs with all that was found, which show what innovations do not."""
    bench, model = end.bench, rounds.start.model
    none = [b for b in (bias(s.name) for s in model.sensors) if abs(bench.fit.value(b)) <= Z_95 * bench.fit.deviation(b)]
    run = bench.problem().solve([f for f in bench.fit.free if f.target not in none], Filter.none(*bench.fit.by.gain.shape), 2 * FREE_RUN)
    level = remaining(bench, run, np.array([s.noise for s in model.sensors]))
    rounds.log(f"what remains: {level:.3g} of all forces")
    end = _run_free(end, level, rounds.log)
    moved = motions(Probe.of(bench)) if any(end.large) else []
    large = [a for a, big in zip(end.accepted, end.large, strict=True) if big]
    masses = [a for a in large if stands_for_mass(bench, a, moved, max(level, bench.level.size))]
    return Ended(end, needed(rounds, end), run, level, masses)


def _run_free(end: Grown, level: float, log: Callable[[str], None]) -> Grown:
    """The end of a search, with those forms large that have a name beside the unmodelled `level` that remains. One too small for that
    counts by the error of a free run without it: the observer follows what changes slowly, so that innovations show little of it. Of
    several small forms at a place none has a name: its curve is that of none of them."""
    bench, still = end.bench, Filter.none(*end.bench.fit.by.gain.shape)
    accepted, most = list(end.accepted), max((a.trial.gain for a in end.accepted), default=0.0)
    large = [
        _is_required(a.trial, level, end.bench.level.size, most) or is_large(a.trial, _worth(a.trial, level, a.trial.whole))
        for a in accepted
    ]
    if all(large):
        return replace(end, large=tuple(large))
    problem = bench.problem()
    whole = problem.solve(bench.fit.free, still, FREE_RUN)
    for k, a in enumerate(end.accepted):
        if large[k]:
            continue
        own = {f.target for t in a.terms for f in t.free}
        starts = [[f for f in fit.free if f.target not in own] for fit in (bench.fit, whole)]
        without = max((problem.solve(free, still, FREE_RUN) for free in starts), key=lambda f: f.cost)
        taken = without.taken_whole(whole, problem.floor)
        log(f"{name_of(a.trial)} explains {taken:.1%} of the error of a free run without it")
        if mostly(taken) and not any(_shares(a, x) for x in end.accepted):
            accepted[k] = replace(a, trial=replace(a.trial, whole=max(taken, a.trial.whole)))
            large[k] = a.trial.share >= _worth(a.trial, level, taken)
    return replace(end, accepted=tuple(accepted), large=tuple(large))


def _shares(a: Accepted, other: Accepted) -> bool:
    """Is it at the place of another form, which gained as much as one has to that is no more than what another one lacks?"""
    return at_one_place(a, other) and other.trial.gain >= MIN_FORM * a.trial.gain


def _is_required(t: Trial, level: float, followed: float, most: float) -> bool:
    """Is it one beside which next to nothing remains, by the `level` of a free run and, but where every block demands it on average by
    MIN_GAIN, by that which the observer has `followed`? Held-out blocks have accepted it; but where another form gained the `most`, a curve
    that is off by MIN_FORM from what is there leaves the square of that for others to make up for."""
    remains = level if t.gain > BLOCKS * MIN_GAIN else max(level, followed)
    share, gain = max(RATIO * remains, _finest(t)), MIN_FORM**2 * most
    return t.share >= share and t.gain >= gain


def _worth(t: Trial, level: float, taken: float) -> float:
    """The share from which on a form has a name, see `least`."""
    return max(least(level, taken), _finest(t))


def _finest(t: Trial) -> float:
    """The least share of a form of an input or a sensor."""
    return FINEST * (t.form.how != "force")


def _found(rounds: Rounds, end: Grown, worth_naming: Sequence[bool], run: Fit, level: float) -> Found:
    named = [a for a, worth in zip(end.accepted, worth_naming, strict=True) if worth]
    small = tuple(a for a, worth in zip(end.accepted, worth_naming, strict=True) if not worth)
    plain, _, named = rounds.beside(named) if small else (end.bench, end.scores, named)
    return Found(rounds, end, plain, tuple(named), small, run, level)
