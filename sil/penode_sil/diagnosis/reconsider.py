# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Causes that were accepted before others were known: kept, left out, or exchanged."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .rounds import MIN_GAIN, Accepted, Grown, Rounds, name_of, of_curve, simplest, terms_of
from .worth import mostly


def reconsidered(rounds: Rounds, grown: Grown) -> Grown:
    """Where a search ended, or a better end (floating search; Pudil, Novovicova and Kittler 1994). A form of two laws, a friction with a
    constant, is also left for the best of one law and what that lets be found."""
    best = _exchanged(rounds, grown)
    for k, a in enumerate(grown.accepted):
        single = [t for t in a.trials if len(t.form.kinds) == 1]
        if len(a.terms) > 1 and single:
            first = Accepted(max(single, key=lambda t: float(np.sum(t.blocks))), a.number, (), tuple(single))
            other = _exchanged(rounds, rounds.grow([*grown.accepted[:k], first]))
            more = max(len(terms_of(other.accepted)) - len(terms_of(best.accepted)), 0)
            gain = float(np.sum(other.scores) - np.sum(best.scores))
            rounds.log(f"instead of {name_of(a.trial)} and a second law {[name_of(x.trial) for x in other.accepted]}: {gain:.0f} nats")
            if gain > MIN_GAIN * (1 + more):
                best = other
    return best


def _exchanged(rounds: Rounds, grown: Grown) -> Grown:
    """Each form in doubt left out if it is not needed, or exchanged for one that is simpler or predicts better beside all others; then the search
    goes on. In doubt is what was chosen before others were known: every large form, if a good one that is left takes most of what is
    missed, or else one that was preferred to a simpler form of its curve; and the last one, if another was exchanged."""
    found, whole = list(grown.accepted), float(np.sum(grown.scores))
    missed = any(mostly(t.whole) for t in grown.rest)
    doubted = [a for a, big in zip(found[:-1], grown.large) if big and (missed or _has_simpler(a))]
    last = found[-1:] if found and grown.large[-1] else []
    while doubted:
        a = doubted.pop(0)
        others = [x for x in found if x is not a]
        bench, scores, within = rounds.beside(others)
        if whole - float(np.sum(scores)) <= MIN_GAIN:
            rounds.log(f"{name_of(a.trial)} is not needed")
            found, whole = others, float(np.sum(scores))
            continue
        good = rounds.good(bench, scores, within)
        best = simplest(good, scores, terms_of(within)) if good else a.trial
        own = max((float(np.sum(t.blocks)) for t in good if name_of(t) == name_of(a.trial)), default=whole)
        simpler = len(best.term.free) < len(a.trial.term.free)
        if name_of(best) != name_of(a.trial) and (simpler or float(np.sum(best.blocks)) - own > MIN_GAIN):
            rounds.log(f"{name_of(best)} for {name_of(a.trial)}")
            number = 1 + max(x.number for x in found)  # the names of the former are in the fits of others
            found[found.index(a)] = Accepted(best, number, (), good)
            doubted, last = [*doubted, *last], []
    return grown if found == list(grown.accepted) else rounds.grow(found)


def _has_simpler(a: Accepted) -> bool:
    """Was a form preferred to another one of its curve with fewer values?"""
    return any(of_curve(t) == of_curve(a.trial) and len(t.term.free) < len(a.trial.term.free) for t in a.trials)
