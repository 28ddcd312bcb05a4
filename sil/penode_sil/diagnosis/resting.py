# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings that seem to start in motion, and start at rest with a load that was put on at the start."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from .exchange import ranked
from .explaining import explain, settled
from .explanation import LOADS, NEW, Explanation, loaded, numbers, rows, weight
from .pursuit import terms_of
from .search import NEAR, grow
from .study import MOVING, Study, loss, regression, with_noise_of

IDLE = 3.0  # chi2 that a free start state gains though nothing moves: 1, and twice its deviation
REST = 0.5  # of the noise: a load at rest that leaves so much more than a start in motion is none


def at_rest(rest: Study, free: Study, in_motion: Sequence[Explanation], log) -> tuple[Study, list[Explanation]]:
    """Explanations of a start in motion by a load that was put on at the start, alone or beside the causes that were found, or by
    the bias of a sensor that looks like one, and the study with the noise they leave; none where such a load is out of the
    question. `in_motion`: explanations that are about as good with a start in motion, from best to worst."""
    r = regression(rest, rest.null, [], {"constant_force"})
    gains = {k: r.gain([k])[0] for k in range(len(r.candidates))}
    gains = {k: g for k, g in gains.items() if g > 0.8 * (rest.null.cost - free.null.cost)}
    if not gains:
        return rest, []
    rest = replace(rest, nothing=loss(rest, rest.null))
    loads = {r.candidates[k].where: terms_of(r, [k]) for k in sorted(gains, key=gains.__getitem__)}.values()  # the best of each place
    lighter = [t for e in in_motion[:1] for t in e.terms if t.candidate.kind != "constant_force"]
    others = [t for t in lighter if t.candidate.kind != "sensor_bias"]  # in motion, a load looks like one
    ways = [(load, others) for load in loads]
    for e in [e for e in in_motion if LOADS & {g[0] for g in e.groups} == {"sensor_bias"}][:1]:
        bias = [t for t in e.terms if t.candidate.kind == "sensor_bias"]
        ways.append((bias, [t for t in e.terms if t not in bias]))
    there, formulas = (in_motion[0].fit, in_motion[0].formulas) if in_motion else (None, 0.0)
    moving = rest.nothing - free.nothing + (in_motion[0].score if in_motion else 0.0)
    idle = None
    if lighter and set(lighter) not in [set(first + more) for first, more in ways]:
        idle = explain(rest, lighter, start=there, formulas=formulas)
        log(f"at rest without a load {idle.score:.0f}, moving {moving:.0f}")
        if idle.score > moving - NEW and not loaded(in_motion[0]):
            return rest, []  # nothing moved that a load could have stood for
    beam = []
    for first, more in ways:
        beam.append(explain(rest, first))
        beam += [explain(rest, [*first, *more], start=there, formulas=max(beam[-1].gain, formulas))] if more else []
    beam.sort(key=lambda e: -e.score)
    log(f"at rest with {beam[0].groups} {beam[0].score:.0f}, moving {moving:.0f}")
    if idle is not None and beam[0].score < idle.score + NEW:
        if not loaded(in_motion[0]):
            return rest, []
        beam = [idle]  # the load was but a start in motion that is none
    if beam[0].score < max(NEW, moving - min(NEAR * moving, REST * rows(rest)) - NEW):
        return rest, []
    quiet = with_noise_of(rest, beam[0].fit)
    again = [explain(quiet, e.terms, 4, e.fit, e.formulas) for e in beam[:3]]
    if in_motion and set(beam[0].groups) == set(in_motion[0].groups):  # for which the search in motion has looked at all rivals
        found = ranked(quiet, settled(quiet, again[0]), again[1:], log)
    else:
        quiet, found = grow(quiet, again, log, 1)
    return quiet, [e for e in found if loaded(e) < weight(rest.model)]


def resting(other: Study, study: Study, explanations: list[Explanation], log: Callable[[str], None]) -> tuple[Study, list[Explanation]]:
    """Study and explanations at rest, where recordings that seem to start in motion are likelier to start at rest with other causes."""
    if not study.moving:
        return study, explanations
    equals = [e for e in explanations if e.score > explanations[0].score - NEW]
    other, found = at_rest(other, study, equals, log)
    if not found:
        return study, explanations
    costs = [s.nothing - (e[0].score if e else 0.0) for s, e in ((study, explanations), (other, found))]
    log(f"at rest {costs[1]:.0f}, moving {costs[0]:.0f}")
    losses = [s.nothing - max((x.gain for x in e), default=0.0) for s, e in ((study, equals), (other, found[:1]))]
    same = set(found[0].groups) in (set(e.groups) for e in equals)
    starts = len(study.model.states) * len(study.experiments)
    return (other, found) if rested(losses, costs, same, starts, numbers(found[0])) else (study, explanations)


def rested(losses: Sequence[float], costs: Sequence[float], same: bool, starts: int, loads: int) -> bool:
    """Did recordings start at rest? Losses, and what they cost with the causes, [in motion, at rest], whether the causes are the same,
    how many start states are free in motion, and how many numbers are of loads that take their place at rest, two of which any load has.
    Where the start states gain no more than noise gives them nothing moved, though it costs a load."""
    return losses[1] < losses[0] + IDLE * (starts - max(loads - 2, 0)) or (not same and costs[1] < costs[0] + MOVING * starts)
