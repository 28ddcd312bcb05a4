# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forms of causes beside what a model has: proposed by a score test, put into the model together, fitted to innovations one by one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import GROUND

from .. import catalogue
from ..catalogue import drives, friction
from ..catalogue.actuators import ACTUATORS
from ..catalogue.form import Form, Motion, Moved
from ..evidence.bench import Bench, fit_level
from ..evidence.fit import Fit
from ..evidence.observer import Filter, drives as drives_of, force_at
from ..evidence.screening import AT_ONCE, Probe, Score, as_they_are, scores
from ..study.fit import Free
from . import clipping, holding
from .terms import Term, Trial, drive, free_of, moves, whole, with_forms
from .worth import MIN_GAIN, share

Array = NDArray[np.float64]
TRIED = 6  # forms that are fitted in a round, the best of each name and place first; and the best of every other place
PROMISE = 3.0  # log likelihood that a form has to promise for it
SMALL = 0.02  # of the force at a place: a force that is put on to see what it does, and a law's start
FREE_RUN, FOLLOWED = 10, 12  # iterations of a form's fits


def motions(probe: Probe) -> list[Motion]:
    """Motion at every place. On a body without any modelled force, the reference is the force that accelerates it."""
    found, bench = [], probe.bench
    driving = drives_of(bench.model)
    for k, place in enumerate(bench.places):
        loads = {force_at(p): 3 * i + 2 for i, p in enumerate(bench.places) if p.elements and {*p.ends} & {*place.ends} - {GROUND}}
        first = 3 * len(bench.places)
        loads |= {f"F_{e.name}": first + i for i, e in enumerate(driving) if {*e.ends} & {*place.ends} - {GROUND}}
        parts = [
            Moved(m[:, 3 * k], m[:, 3 * k + 1], np.arange(0.0, len(m)) * bench.step, {f: np.abs(m[:, i]) for f, i in loads.items()}, r.left)
            for m, r in zip(probe.motions, bench.records, strict=True)
        ]
        acts = float(np.std(np.concatenate([m[:, first + len(driving) + k] for m in probe.motions])))
        found.append(Motion.of(parts, acts if place.elements else _inertia(bench, place.ends[0])))
    return found


def _inertia(bench: Bench, body: str) -> float:
    """Rms of mass times acceleration of a body."""
    k, b = next((k, b) for k, b in enumerate(bench.model.bodies) if b.name == body)
    return bench.fit.values.get(b.mass, bench.model.parameters[b.mass].value) * float(bench.forces[k])


def propose(bench: Bench, terms: Sequence[Term], log: Callable[[str], None], stiffer: float = 1.0) -> list[Trial]:
    """The likeliest forms beside those accepted, fitted, the best first. They are looked for by an observer for `stiffer` times less
    unmodelled force than the bench has, and compared with the bench as it is. None where nothing is unmodelled and none of them promises
    what a cause has to gain."""
    base, bench = bench.fit, _corrected_less(bench, stiffer)
    probe = Probe.of(bench)
    moved = motions(probe)
    n_u = bench.records[0].u.shape[1]
    forms: list[Form] = []
    for k, (place, motion) in enumerate(zip(bench.places, moved, strict=True)):
        if motion.s_rms > 0.0 and motion.v_rms > 0.0 and motion.force > 0.0:
            turning = friction.turns(motion.rates)
            for file in catalogue.FILES:
                forms += (f for f in file.forms(bench.model, k, place, motion) if turning or f.kind not in catalogue.REVERSING)
    moving = [j for j in range(n_u) if moves(bench, j)]  # of others nothing would show
    forms += (f for f in drives.inputs(bench.model, n_u) if f.index in moving)
    forms += drives.sensors(bench.model, len(bench.noise))
    forms = [f for f in forms if not _taken(f, terms)]
    ranked = _screened(bench, probe, forms, moved)
    cut = {t.form.where for t in terms if t.form.how == "clip"}
    seen = bench.problem().predictor.sensors(bench.fit.free)
    limits = [pair for j, s in enumerate(bench.model.sensors) if s.name not in cut for pair in clipping.propose(bench, j, seen)]
    actuators = [pair for j in moving for pair in _bent(bench, j, terms)]
    ranked = sorted([*ranked, *limits, *actuators], key=lambda pair: -pair[0].gain)
    log("screened: " + ", ".join(f"{f.kind} {f.where} {f.note} {s.gain:.0f}" for s, f in ranked[:12]))
    chosen = _chosen(ranked) if bench.level.size > 0.0 or any(s.gain > MIN_GAIN for s, _ in ranked) else []
    trials = [_fitted(bench, base, form, moved, terms, s.sizes) for s, form in chosen]
    trials = [t for t in trials if t.form.kind]
    trials += [_fitted(bench, base, form, moved, terms, np.ones(1)) for form in _holds(bench, trials, terms)]
    trials += _of_all(bench, base, trials, moved, terms)
    return sorted(trials, key=lambda t: -t.gain)


def _corrected_less(bench: Bench, stiffer: float) -> Bench:
    """The bench fitted with an observer for so many times less unmodelled force."""
    if stiffer == 1.0:
        return bench
    level = replace(bench.level, size=bench.level.size / stiffer)
    return replace(bench, level=level, fit=bench.problem().solve(bench.fit.free, bench.gains(bench.fit).at(level), FREE_RUN))


def _chosen(ranked: Sequence[tuple[Score, Form]]) -> list[tuple[Score, Form]]:
    """The forms that are fitted: of each kind, place and note the best; of these the TRIED with the largest gain beyond PROMISE for each of
    their sizes, no more than half of them of one curve at a place, and forms of one fault of an input or a sensor for one; the best force
    of every place that is not among them, for small improvements where much acts would crowd out the cause where little does, what is a
    part of one of them, and the best limit of every other input and sensor: little else does what they do."""
    best: dict[tuple[str, str, str], tuple[Score, Form]] = {}
    for score, form in ranked:
        if score.gain > PROMISE:
            best.setdefault((form.kind, form.where, form.note), (score, form))
    plainest = sorted(best.values(), key=lambda pair: PROMISE * len(pair[0].sizes) - pair[0].gain)
    chosen: list[tuple[Score, Form]] = []
    for pair in plainest:
        alike = [f for _, f in chosen if (catalogue.curve(f.kind), f.at) == (catalogue.curve(pair[1].kind), pair[1].at)]
        faults = {(f.kind, f.at) for _, f in chosen if f.how != "force"}  # of inputs and sensors: their forms do about the same
        if sum(f.how == "force" for _, f in chosen) + len(faults) < TRIED and len(alike) < TRIED // 2:
            chosen.append(pair)
    for score, form in [pair for pair in plainest if pair not in chosen]:
        own = [f for _, f in chosen if f.at == form.at and (f.limit or not form.limit)]
        if (form.how == "force" and (not own or any(is_part(form, f) for f in own))) or (form.limit and not own):
            chosen.append((score, form))
    return chosen


def is_part(form: Form, whole: Form) -> bool:
    """Has a form some of the laws of another one at its place? It may do alone where the rest turns out to be nothing."""
    own, all_of_it = ({law for p in f.parts for law in (p.law, p.includes) if law} for f in (form, whole))
    return form.index == whole.index and form.how == whole.how == "force" and own < all_of_it


def _taken(form: Form, terms: Sequence[Term]) -> bool:
    """Has the model that form already, or one of a curve of which a place has only one?"""
    there = [t.form for t in terms if t.form.at == form.at]
    one = catalogue.curve(form.kind)
    same = [f.kind for f in there if f.how != "force" or f.note == form.note]  # of an input or a sensor, a kind is there once
    return form.kind in same or (one != form.kind and any(catalogue.curve(f.kind) == one for f in there))


def _screened(bench: Bench, probe: Probe, forms: Sequence[Form], moved: Sequence[Motion]) -> list[tuple[Score, Form]]:
    forces = [(f.index, [p.along(m) for m in moved[f.index].parts]) for f in forms if f.how == "force" for p in f.parts]
    size = SMALL * min((m.force for m in moved if m.force > 0.0), default=1.0)
    columns = iter(probe.columns(forces, size))
    hypotheses = []
    for f in forms:
        if f.how == "force":
            hypotheses.append(np.stack([next(columns) for _ in f.parts], axis=-1))
        else:
            hypotheses.append(_slope(bench, f)[:, :, None])
    return sorted(zip(scores(bench.fit, hypotheses), forms, strict=True), key=lambda pair: -pair[0].gain)


def _bent(bench: Bench, index: int, terms: Sequence[Term]) -> list[tuple[Score, Form]]:
    """Forms of an input whose effect is not proportional to their value, each at the best of the values tried."""
    forms = [f for f in drives.bent(bench.model, index, drive(bench, index)) if not _taken(f, terms)]
    if not forms:
        return []
    kinds = list(dict.fromkeys(f.kind for f in forms))
    free = (*bench.fit.free, *(replace(free_of(bench, Form(k, forms[0].where, k, index))[0], value=0.0) for k in kinds))
    shifts = np.zeros((1 + len(forms), len(free)))
    for row, f in zip(shifts[1:], forms, strict=True):
        at = len(bench.fit.free) + kinds.index(f.kind)
        row[at] = f.limit / free[at].unit
    problem, parts = bench.problem(), np.array_split(shifts, -(-len(shifts) // AT_ONCE))
    nu = np.concatenate([problem.nu(free, rows, bench.fit.by) for rows in parts])
    scored = list(zip(as_they_are(bench.fit, nu[1:] - nu[0]), forms, strict=True))
    best = [max((p for p in scored if p[1].kind == k), key=lambda p: p[0].gain) for k in kinds]
    gains = [_moved_gain(bench, f) if s.gain > PROMISE or not ACTUATORS[f.how].small else 0.0 for s, f in best]
    return [(Score(gain, np.zeros(1)), form) for gain, (_, form) in zip(gains, best, strict=True)]


def _moved_gain(bench: Bench, form: Form) -> float:
    """Log likelihood that a form gains within a few steps of a fit: what else is free may have to move far with it, as a gain beside a dead
    zone does."""
    fit = bench.problem().solve((*bench.fit.free, *free_of(bench, form)), bench.fit.by, FREE_RUN)
    return max(fit.likelihood - bench.fit.likelihood, 0.0)


def _holds(bench: Bench, trials: Sequence[Trial], terms: Sequence[Term]) -> list[Form]:
    """Holds of inputs of which a delay gained at least half as much as the best trial: the delay is the main effect of a hold."""
    taken = [t.form.where for t in terms if t.form.series]
    most = max((t.gain for t in trials), default=0.0)
    late = [t for t in trials if drives.is_late(t.form) and t.form.where not in taken and t.gain > max(0.5 * most, PROMISE)]
    found = [holding.propose(bench, t.form.index, t.fit.value(t.term.free[0].target)) for t in late]
    return [form for form in found if form]


def _of_all(bench: Bench, base: Fit, trials: Sequence[Trial], moved: Sequence[Motion], terms: Sequence[Term]) -> list[Trial]:
    """Trials of laws that take away all of an element, for those that gained at least half as much as the best one with a share of it: with
    both a share and a width, neither is known well."""
    most, found = max((t.gain for t in trials), default=0.0), []
    for t in trials:
        form = whole(bench, t) if t.gain > max(0.5 * most, PROMISE) else None
        if form:
            found.append(as_it_is(bench, base, form, moved, terms))
    return found


def as_it_is(bench: Bench, base: Fit, form: Form, moved: Sequence[Motion], terms: Sequence[Term]) -> Trial:
    """A form fitted from its own values on, beside the terms accepted."""
    return _fitted(bench, base, form, moved, terms)


def _slope(bench: Bench, form: Form) -> Array:
    """Change [updates, n_z] of the innovations with what is wrong with an input or a sensor, for a value of 1."""
    (f,) = free_of(bench, form)
    problem = bench.problem()
    free = (*bench.fit.free, f)
    shifts = np.zeros((2, len(free)))
    shifts[1, -1] = 0.1
    nu = problem.nu(free, shifts, bench.fit.by)
    slope: Array = (nu[1] - nu[0]) / (0.1 * f.unit)
    return slope


def _fitted(bench: Bench, base: Fit, form: Form, moved: Sequence[Motion], terms: Sequence[Term], promised: Array | None = None) -> Trial:
    """Fits a form beside those accepted, from the best fit so far with the sizes `promised` by its score; its gain is that over `base`.
    Its model has no other form that is tried: a step of one with all of them takes four times as long, and as short as one of them needs.
    Where parameters are hardly known, and for a limit, which may have bent them, it also starts from the nominal values, and from a free
    run of these: the motion of a wrong plant promises little."""
    model, (term,) = with_forms(bench, [form], moved, len(terms))
    problem, n_x = bench.problem(model), len(model.states)
    sizes = np.zeros(len(term.free)) if promised is None else promised
    by, still = bench.fit.by.padded(n_x), Filter.none(n_x, len(bench.noise))
    starts, runs = [(*bench.fit.free, *_sized(term, sizes))], []
    if term.form.how == "clip" or any(f.log for f in bench.nominal):
        most = [SMALL * f.sigma for f in term.free if not f.log]
        little = np.clip(sizes[: len(most)], *np.outer((-1.0, 1.0), most))
        own = {f.target for f in bench.nominal}
        nominal = (*bench.nominal, *(f for f in bench.fit.free if f.target not in own))
        starts += [(*nominal, *_sized(term, little)), (*bench.fit.free, *_sized(term, little))]
        runs = [problem.solve(f, still, FREE_RUN) for f in starts[1:]]
        starts.append(max(runs, key=lambda f: f.cost).free)
    best = max((problem.solve(f, by, FOLLOWED) for f in starts), key=lambda f: f.cost)
    level, best = fit_level(replace(bench, model=model), problem, best, bench.level)
    taken = float(np.max(base.taken(best, problem.floor)))  # the force at one place is seen by few sensors
    whole = base.taken_whole(best, problem.floor)
    gain, free = best.criterion() - base.criterion(), max((r.likelihood for r in runs), default=-np.inf)
    if form.how == "force":
        term = replace(term, form=catalogue.fitted(form, term.laws(best.values), moved[form.index]))
    same = [t for t in terms if (t.form.kind, t.form.where) == (term.form.kind, term.form.where)]
    return Trial(term.form, term, best, gain, level, model, share(bench, [*same, term], best, moved), taken, whole, free)


def _sized(term: Term, sizes: Array) -> list[Free]:
    """The free values of a term with sizes of its parts, halved, for a score looks at small ones, and of the sign that they may have."""
    at = iter(sizes)
    return [f if f.log else replace(f, value=float(np.clip(f.value + 0.5 * next(at), f.low, f.high))) for f in term.free]
