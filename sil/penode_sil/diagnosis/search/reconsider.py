# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A second look at early choices: once later causes are known, each is kept, dropped, or exchanged."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .. import catalogue
from ..catalogue import others
from ..catalogue.form import Form, Motion
from ..evidence.bench import Bench
from ..evidence.observer import bias
from ..evidence.prior import SHARE, Stated
from ..evidence.screening import Probe
from .propose import as_it_is, is_part, motions
from .rounds import MIN_FORM, Accepted, Grown, Rounds, beyond_twice, moved, name_of, of_curve, score, scored, simplest, terms_of
from .terms import Trial
from .worth import MIN_GAIN, RATIO, Z_95, least, mostly, shift, wrong


def reconsidered(rounds: Rounds, grown: Grown) -> Grown:
    """Returns the end of a search, or a better one (floating search; Pudil, Novovicova and Kittler 1994). Where forces remain unmodelled,
    it also begins with the best forms of other curves. For each form of two laws, such as a friction with a constant, it also tries the
    best single law instead, and searches on from there."""
    best = _exchanged(rounds, grown)
    for first in _other_beginnings(grown, best) if best.bench.level.size > 0.0 else ():
        other = _exchanged(rounds, rounds.grow([first]))
        rounds.log(f"beginning with {name_of(first.trial)}: {_total(other) - _total(best):.0f} nats")
        best = other if _is_better(other, best, grown.accepted[0].trial) else best
    for k, a in enumerate(best.accepted):
        single = [t for t in a.trials if len(t.form.kinds) == 1]
        if len(a.trial.form.kinds) > 1 and single:
            first = Accepted(max(single, key=score), a.number, (), a.trials)
            other = _exchanged(rounds, rounds.grow([*best.accepted[:k], first]))
            names, gain = [name_of(x.trial) for x in other.accepted], _total(other) - _total(best)
            rounds.log(f"replacing the two-law form {name_of(a.trial)} by {names}: {gain:.0f} nats")
            if _is_better(other, best, grown.accepted[0].trial):
                return other
    return best


def _other_beginnings(grown: Grown, best: Grown) -> list[Accepted]:
    """Of every curve that the best end does not have, the best form that predicted about as well alone as the first one did: it may be
    what is there, and the first one, with others beside, what makes up for it."""
    found: dict[object, Accepted] = {}
    there = {of_curve(a.trial) for a in best.accepted}
    for first in grown.accepted[:1]:
        enough = score(first.trial) - max(MIN_GAIN, MIN_FORM * first.trial.gain)
        for t in first.trials:
            if of_curve(t) not in there and not is_part(first.trial.form, t.form) and score(t) >= enough:
                found.setdefault(of_curve(t), Accepted(t, first.number, (), first.trials))
    return list(found.values())


def _is_better(end: Grown, other: Grown, first: Trial) -> bool:
    """Does an end gain MIN_GAIN beyond another one, and as much again for each law that it has more, or anything with fewer? One that moves
    values of the file out of their tolerances, and with these has more than twice as many values, has to gain MIN_FORM of what the first
    form did."""
    gain, much = _total(end) - _total(other), max(MIN_GAIN, MIN_FORM * first.gain)
    if _imitates(end, other):
        return gain > much
    if _imitates(other, end):
        return gain > -much
    more = max(len(terms_of(end.accepted)) - len(terms_of(other.accepted)), -1)
    return gain > MIN_GAIN * (1 + more)


def _imitates(end: Grown, other: Grown) -> bool:
    """Does an end take more than twice the values of another one, with those of the file that it moves and the other does not?"""
    laws, own = (sum(len(t.free) for t in terms_of(x.accepted)) for x in (other, end))
    gone, left = (moved(a.bench.fit) - moved(b.bench.fit) for a, b in ((end, other), (other, end)))
    return bool(gone) and beyond_twice(own + len(gone), laws + len(left)) > 0


def centred(rounds: Rounds, grown: Grown) -> Grown:
    """Exchanges a form that needs offsets of sensors for one with its middle elsewhere, if that predicts as well without any offset: where
    a curve has its middle, and where a sensor has its zero, is the same, and this is one cause instead of two."""
    fit = grown.bench.fit
    biases = [f for b in (bias(s.name) for s in rounds.start.model.sensors) for f in fit.free if f.target == b]
    if all(abs(f.value) <= Z_95 * fit.deviation(f.target) for f in biases):
        return grown
    none, sensors = {f.target for f in biases}, [s.name for s in rounds.start.model.sensors]
    off = tuple((others.OFFSET, s) for s, f in zip(sensors, biases, strict=True) if abs(f.value) > Z_95 * fit.deviation(f.target))
    for k, a in enumerate(grown.accepted):
        form = catalogue.aside(_fitted_shapes(a, fit.values))
        if form is None:
            continue
        form = replace(form, alike=off)
        bench, _, within = rounds.beside([x for x in grown.accepted if x is not a])
        plain = replace(bench, fit=bench.problem().at([f for f in bench.fit.free if f.target not in none], bench.fit.by))
        t = as_it_is(plain, bench.fit, form, motions(Probe.of(bench)), terms_of(within))
        t = scored(plain, rounds.blocks, t)
        rounds.log(f"{form.kind} at {form.where} {form.note}: {score(t) - _total(grown):.1f} nats more, without offsets")
        if score(t) >= _total(grown) - MIN_GAIN:
            free = (*t.fit.free, *(replace(f, value=f.origin) for f in biases))
            other = Accepted(replace(t, fit=replace(t.fit, free=free)), a.number, (), (t, *a.trials))
            end = rounds.grow([*grown.accepted[:k], other, *grown.accepted[k + 1 :]])
            if _total(end) >= _total(grown) - MIN_GAIN:
                return end
    return grown


def needed(rounds: Rounds, grown: Grown) -> list[bool]:
    """Which forms have a name: the large ones, but for one that gains less than MIN_FORM of what another does at its place, input or
    sensor, each beside all others: the curve of that is not its textbook form, and the small one makes up for the difference. The least
    goes first, for of two that do the same each gains nothing beside the other."""
    gone: list[Accepted] = []
    left = 0.0  # score without those
    large = [a for a, big in zip(grown.accepted, grown.large, strict=True) if big]
    while doubted := [a for a in large if any(at_one_place(a, x) for x in large)]:
        whole = left if gone else rounds.score_without(grown, gone)
        gains = {a: whole - rounds.score_without(grown, [*gone, a]) for a in doubted}
        less = [a for a in gains if gains[a] <= MIN_FORM * max(gains[x] for x in gains if at_one_place(a, x))]
        if not less:
            break
        least = min(less, key=lambda a: gains[a])
        rounds.log(f"{name_of(least.trial)} gains {gains[least]:.0f} nats beside the others: it makes up for them")
        large, gone, left = [a for a in large if a is not least], [*gone, least], whole - gains[least]
    return [a in large for a in grown.accepted]


def stands_for_mass(bench: Bench, a: Accepted, along: Sequence[Motion], level: float) -> bool:
    """Does a form do what another mass does? It may, and a mass of the bodies at its place is fitted at more than RATIO tolerances from the
    file beside it, and no cause (see `shift`, `along` the motion of every place): it makes up for the difference. The unmodelled `level`
    remains."""
    if a.trial.form.kind not in getattr(catalogue.OF.get(a.trial.form.kind), "LIKE_MASSES", ()):
        return False
    ends, free = bench.places[a.trial.form.index].ends, {f.target: f for f in bench.fit.free if isinstance(f, Stated)}
    masses = [free[b.mass] for b in bench.model.bodies if b.name in ends and b.mass in free]
    off = [str(f.target) for f in masses if abs(f.value - f.origin) > RATIO * f.sigma / SHARE]
    return any(shift(bench.model, bench, along, m) < least(level, 0.0) for m in off)


def at_one_place(a: Accepted, other: Accepted) -> bool:
    """Are they two forms at one place, or of one input or sensor?"""
    return a is not other and a.trial.form.at == other.trial.form.at


def _fitted_shapes(a: Accepted, values: Mapping[str, float]) -> Form:
    """An accepted form with its shapes as they are fitted."""
    parts = [part for term in a.terms for _, part in term.laws(values)]
    return replace(a.trial.form, parts=tuple(parts))


def _exchanged(rounds: Rounds, grown: Grown) -> Grown:
    """Drops each doubtful form that the others make unnecessary, or exchanges it for one that is simpler or predicts better beside them;
    then resumes the search, and keeps the new end if that loses no more than what was dropped or simplified may. Doubtful are large forms
    other than the last: all of them if a trial that was not accepted would take most of what is still missed, else those preferred to a
    simpler form of the same curve, or of a curve of which a place has one. After an exchange the last form is checked too."""
    found, whole, loss = list(grown.accepted), _total(grown), 0.0
    missed = any(mostly(t.whole) for t in grown.rest)
    doubted = [a for a, big in zip(found[:-1], grown.large[:-1], strict=True) if big and (missed or _has_other(a))]
    last = found[-1:] if found and grown.large[-1] else []
    while doubted:
        a = doubted.pop(0)
        others = [x for x in found if x is not a and not _makes_up(x.trial, a.trial)]
        bench, scores, within = rounds.beside(others)
        if whole - float(np.sum(scores)) <= MIN_GAIN:
            rounds.log(f"{name_of(a.trial)} is not needed")
            found, whole, loss = others, float(np.sum(scores)), loss + MIN_GAIN
            continue
        good = rounds.good(bench, scores, within)
        own = max((score(t) for t in good if name_of(t) == name_of(a.trial)), default=whole)
        best = simplest(good, scores, terms_of(within)) if good else a.trial
        share = wrong(bench.level.size) if is_part(best.form, a.trial.form) else 1.0
        less = max(MIN_GAIN, share * MIN_FORM * (own - float(np.sum(scores))))
        simpler = len(best.term.free) < len(a.trial.term.free) and score(best) >= own - less
        if name_of(best) != name_of(a.trial) and (simpler or score(best) - own > MIN_GAIN):
            rounds.log(f"{name_of(best)} for {name_of(a.trial)}")
            number = 1 + max(x.number for x in found)  # a fresh one: fits of other forms still hold parameters named after the old one
            found[found.index(a)] = Accepted(best, number, (), good)
            whole, loss = float(np.sum(rounds.beside(found)[1])), loss + less * simpler
            doubted, last = [*doubted, *last], []
        elif any(name_of(t) == name_of(a.trial) for t in good):
            found[found.index(a)] = replace(a, trials=good)  # its rivals are those beside all others
    if [a.number for a in found] == [a.number for a in grown.accepted]:
        return replace(grown, accepted=tuple(found))
    end = rounds.grow(found)
    return end if _total(end) >= _total(grown) - loss else grown


def _makes_up(t: Trial, other: Trial) -> bool:
    """Does a form gain less than MIN_FORM of what another does at its place: is the curve of that not quite what is there?"""
    return t.form.at == other.form.at and t.gain < MIN_FORM * other.gain


def _has_other(a: Accepted) -> bool:
    """Was a form preferred to one of another name, of the same curve, with fewer values; or is it of a curve of which a place has one, so
    that no other form of that was tried beside what came later?"""
    others = [t for t in a.trials if of_curve(t) == of_curve(a.trial) and name_of(t) != name_of(a.trial)]
    return any(len(t.term.free) < len(a.trial.term.free) for t in others) or catalogue.has_one_curve(a.trial.form.kind)


def _total(grown: Grown) -> float:
    return float(np.sum(grown.scores))
