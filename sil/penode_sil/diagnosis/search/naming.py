# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The answer for a model that is a little wrong everywhere: what innovations name, how sure that is, and what it is worth."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from .. import catalogue
from ..catalogue import drives, friction, others
from ..catalogue.form import Form, Motion, Sizes
from ..evidence.bench import Bench, build
from ..evidence.blocks import posterior
from ..evidence.colour import shape
from ..evidence.fit import Fit
from ..evidence.observer import Filter, Record, bias, sample_noise
from ..evidence.screening import Probe
from ..plant.plant import Place
from ..result import MAY_BE_NOTHING, NOT_NAMED, Cause, Named, Value, place
from ..study.fit import Free, Target
from ..study.noise import Experiment
from . import innovate, offsets as offsets_of, parameters
from .innovate import Found
from .propose import FREE_RUN, motions
from .reconsider import at_one_place
from .rounds import MIN_TAKEN, Accepted, name_of, of_curve, terms_of
from .terms import Term, Trial
from .worth import WORTH, Z_95, least, share, systematic, undetermined

Array = NDArray[np.float64]
RIVAL = 0.075  # posterior from which on an explanation is listed


@dataclass(frozen=True, eq=False)
class Answer:
    """Causes; those `withheld`, for they are small; notes on them; the sets of explanations that held-out blocks cannot tell apart, with
    their posterior; where the search ended; the free `run` that fits best, and sensors whose `offsets` it has; the share `taken` of what
    the file's own model leaves: by the free run, or of the power of the innovations, whichever is more, for one that drifts shows little;
    and laws and offsets that are `gone` again, by kind and place."""

    causes: tuple[Cause, ...]
    withheld: tuple[Cause, ...]
    notes: tuple[str, ...]
    explanations: tuple[tuple[tuple[Named, ...], float], ...]
    found: Found
    run: Fit
    offsets: tuple[str, ...]
    taken: float
    model: Model
    gone: frozenset[tuple[str, str]] = frozenset()

    @property
    def terms(self) -> list[Term]:
        """All that was found and is written."""
        return [t for t in self.found.terms if name_of(t) not in self.gone]

    def without(self, gone: Collection[tuple[str, str]]) -> Answer:
        """The same without some laws or offsets, by kind and place, and with the rest fitted again."""
        bench, gone = self.found.bench, {*self.gone, *gone}
        targets = {f.target for t in self.found.terms if name_of(t) in gone for f in t.free}
        targets |= {bias(w) for k, w in gone if k == others.OFFSET}
        free = [f for f in self.run.free if f.target not in targets]
        run = bench.problem().solve(free, Filter.none(*bench.fit.by.gain.shape), FREE_RUN)
        causes = tuple(c for c in self.causes if (c.kind, c.where) not in gone)
        offsets = tuple(s for s in self.offsets if (others.OFFSET, s) not in gone)
        withheld = tuple(c for c in self.withheld if (c.kind, c.where) not in gone)
        notes = tuple(n for n in self.notes if not any(n.startswith(place(*name)) for name in gone))
        return replace(self, causes=causes, withheld=withheld, notes=notes, run=run, offsets=offsets, gone=frozenset(gone))


def answer(
    model: Model,
    places: Sequence[Place],
    experiments: Sequence[Experiment],
    fastest: float,
    set_name: str,
    log: Callable[[str], None],
    levels: Sequence[Array] = (),
) -> Answer:
    """Searches recordings for causes by innovations, and weighs what is found. `levels` [f, n_z] of each recording: variances per sample of
    the sensors' noise by frequency; white without."""
    records = [Record.of(e) for e in experiments]
    noise = sample_noise(records, np.array([s.noise for s in model.sensors]))
    bench = build(model, places, records, noise, fastest, set_name, shape=shape(experiments, levels) if levels else None)
    log(f"noise: {'white' if bench.colour is None else 'coloured'}")
    unmodelled = f"{bench.level.size:.3g} of all forces, correlated over {bench.level.tau:.3g} s"
    log(f"corrected every {bench.update} samples; unmodelled force: {unmodelled}")
    alone = bench.problem().solve(bench.fit.free, Filter.none(*bench.fit.by.gain.shape), FREE_RUN)
    found, moved, judged = _searched(model, bench, log)
    plain, after = found.plain, found.bench
    causes: list[Cause] = []
    withheld, notes = [], []
    named = terms_of(found.named)
    names = {name_of(a.trial) for a in found.named}
    chances = {a.trial: _weighed([t for t in a.trials if name_of(t) not in names - {name_of(a.trial)}], a.trial) for a in found.named}
    for a, term in [(accepted, term) for accepted in found.named for term in accepted.terms]:
        enough, chance, first = least(found.level, a.trial.whole), chances[a.trial], term is a.terms[0]
        size = share(plain, [t for t in named if name_of(t) == name_of(term)], plain.fit, moved)
        rivals = _rivals(chance, term) if first else offsets_of.inputs_alike(model, bench.places[term.form.index])
        rivals = (*rivals, *(Named(*same) for same in term.form.alike))
        cause = _cause(model, plain, moved, term, size, rivals, _sure(chance, a.trial.form), found.level)
        log(f"{cause.kind} at {cause.where}: {size:.1%} of the force there")
        if size >= enough and not cause.may_be_nothing:
            causes = _merged(causes, cause)
            if size < WORTH and term.form.how == "force":
                notes.append(f"{place(*name_of(term))} is small: {size:.1%} of the force there")
        elif first:
            withheld.append(cause)
            notes.append(_small(term, f"{size:.1%} of the force there") if size < enough else f"{place(*name_of(term))} {MAY_BE_NOTHING}")
    for a in found.small:
        notes.append(_withheld(a, found))
        sure = _sure(_weighed(a.trials, a.trial), a.trial.form)
        withheld.append(_cause(model, after, moved, a.terms[0], a.trial.share, (), sure, found.level))
    stopped = () if model.inputs else friction.KINDS  # a free motion ends where friction holds it
    shifts = np.full(len(noise), np.inf) if any(c.kind in stopped for c in causes) else offsets_of.shifts(after, found.run, found.terms)
    biased, remarks = offsets_of.named(model, after, found.possible, shifts)
    notes += [*judged.notes, *remarks]
    run = found.run
    offsets = [s.name for s in model.sensors if any(f.target == bias(s.name) for f in run.free)]
    notes += parameters.notes_on_guessed(model, run)
    powers = [np.nansum(np.where(r.used, r.nu, 0.0) ** 2, axis=0) for r in (alone, run)]
    taken = max(1.0 - float(np.mean(powers[1] / np.maximum(powers[0], 1e-300))), bench.fit.taken_whole(after.fit, bench.problem().floor))
    sets = _explanations([(a.terms[0], chances[a.trial]) for a in found.named])
    return Answer((*judged.causes, *causes, *biased), tuple(withheld), tuple(notes), sets, found, run, tuple(offsets), taken, after.model)


def _searched(model: Model, bench: Bench, log: Callable[[str], None]) -> tuple[Found, list[Motion], parameters.Judged]:
    """What the search finds, the motion with it, and its parameters. Where one of these only makes up for forms that are small beside it,
    these are named too: they took little because the parameter had taken the rest."""

    def judged(found: Found) -> tuple[Found, list[Motion], parameters.Judged]:
        moved = motions(Probe.of(found.plain))
        return found, moved, parameters.judge(model, found, moved, 1.0, log)

    first = judged(innovate.search(bench, log))
    small = [a for a in first[0].small if a.trial.share > first[0].level]  # what is no more than the rest would name that at random
    if not first[2].absorbed or not small:
        return first
    wider = judged(first[0].naming(small))
    log(
        f"{', '.join(first[2].absorbed)} may have compensated for {', '.join(' at '.join(name_of(a.trial)) for a in small)}; "
        f"still does {wider[2].absorbed}"
    )
    return wider if set(wider[2].absorbed) < set(first[2].absorbed) else first


def _small(t: Term, what: str) -> str:
    """A note on a term that is too small to be named."""
    return f"{place(*name_of(t))} is real but small: {what}; {NOT_NAMED}"


def _withheld(a: Accepted, found: Found) -> str:
    """A note on an accepted form without a name."""
    corrected = [x for x in found.named if at_one_place(a, x)]
    large = [x.number for x, big in zip(found.end.accepted, found.end.large, strict=True) if big]
    if corrected and a.number in large and a.trial.form.how == "force":
        whose = f"{place(*name_of(corrected[0].trial))}, which is not quite the textbook form"
        return f"{place(*name_of(a.trial))} corrects the curve of {whose}; {NOT_NAMED}"
    if a.trial.taken < MIN_TAKEN:
        return _small(a.terms[0], f"{a.trial.taken:.0%} of the power of prediction errors")
    return _small(a.terms[0], f"{a.trial.share:.1%} of the force there")


def _merged(causes: list[Cause], new: Cause) -> list[Cause]:
    """Causes with another one; a second form of one that is there gives it more parameters."""
    same = [c for c in causes if (c.kind, c.where) == (new.kind, new.where)]
    if not same:
        return [*causes, new]
    return [replace(c, parameters={**new.parameters, **c.parameters}) if c is same[0] else c for c in causes]


def _weighed(trials: Sequence[Trial], chosen: Trial) -> list[tuple[Form, float]]:
    """Posterior of the names of a round: of each, its best form, summed over the forms of one name. A trial of another curve that predicts
    better than the one that was chosen, for that takes fewer values, is as likely as that."""
    if not trials:
        return []
    chance = posterior([t.blocks for t in trials])
    own = np.array([of_curve(t) == of_curve(chosen) for t in trials])
    sums = np.array([np.sum(t.blocks) for t in trials])
    passed = ~own & (sums > np.max(sums[own], initial=-np.inf))
    if own.any() and passed.any():
        whole = np.sum(chance[own]) + np.sum(chance[passed])
        share = whole / (1.0 + np.sum(passed))
        chance = np.where(passed, share, np.where(own, share / np.sum(own), chance))
    total: dict[tuple[str, str], float] = {}
    forms: dict[tuple[str, str], Form] = {}
    for t, p in zip(trials, chance, strict=True):
        name = name_of(t)
        total[name] = total.get(name, 0.0) + float(p)
        forms.setdefault(name, t.form)
    return sorted(((forms[n], p) for n, p in total.items()), key=lambda pair: -pair[1])


def _rivals(names: Sequence[tuple[Form, float]], term: Term) -> tuple[Named, ...]:
    own = name_of(term)
    return tuple(Named(f.kind, f.where) for f, p in names if (f.kind, f.where) != own and p > RIVAL)[:3]


def _sure(names: Sequence[tuple[Form, float]], form: Form) -> float:
    """Posterior of a name, with that of the other forms of its curve: of these the simplest that will do is taken."""
    own = (catalogue.curve(form.kind), form.at)
    return sum(p for f, p in names if (catalogue.curve(f.kind), f.at) == own)


def _explanations(named: Sequence[tuple[Term, Sequence[tuple[Form, float]]]]) -> tuple[tuple[tuple[Named, ...], float], ...]:
    """Sets of causes with their posterior among those of the catalogue: the one found, and it with one cause exchanged for a rival."""
    own = tuple(dict.fromkeys(Named(*name_of(t)) for t, _ in named))
    if not own:
        return ()
    sure = [_sure(options, t.form) for t, options in named]
    sets = [(own, float(np.prod(sure)))]
    for k, (term, options) in enumerate(named):
        others = float(np.prod(sure[:k] + sure[k + 1 :]))
        for r in _rivals(options, term):
            p = next(p for f, p in options if (f.kind, f.where) == (r.kind, r.where))
            sets.append((tuple(r if n == Named(*name_of(term)) else n for n in own), others * p))
    whole = max(sum(p for _, p in sets), 1.0)  # forms of one curve count for the simplest of them, and each for itself
    return tuple((names, p / whole) for names, p in sets)


def _cause(
    model: Model, bench: Bench, moved: Sequence[Motion], term: Term, size: float, rivals: tuple[Named, ...], sure: float, level: float
) -> Cause:
    """A term as a cause with sizes and intervals, along a motion of every place; `sure`: posterior of its name among the forms of the
    catalogue; `level`: the unmodelled force that remains."""
    form = term.form
    own = {t.target for t in term.free}
    at = bench.places[form.index] if form.how == "force" else None
    first = moved[form.index].parts[0] if at else None

    def sizes(values: Mapping[Target, float]) -> dict[str, tuple[str, float]]:
        if at is None:
            unit = units.si((model.inputs if form.how.startswith("input_") else model.sensors)[form.index].unit)
            return drives.sizes(form, Sizes({}, {}, True, values[term.free[0].target]), unit)
        parts = {}
        for k, (name, part) in enumerate(zip(term.elements, form.parts, strict=True)):
            for key in (part.gain[0], *part.shapes):
                own = part.own[0] if part.own and key == part.gain[0] else f"{name}_{key}"
                parts[k, key] = values.get(own, bench.model.parameters[own].value)
        linear: dict[str, float] = {}
        for e in model.elements:
            if any(e.name == n for n, _ in at.elements):
                for argument, parameter in e.arguments.items():
                    key = f"{e.law}.{argument}"
                    linear[key] = linear.get(key, 0.0) + values.get(parameter, model.parameters[parameter].value)
        known = Sizes(parts, linear, bool(model.bodies), first=first)
        return {k: (at.unit(u), v) for k, (u, v) in catalogue.OF[form.kind].sizes(form, known).items()}

    values = {f.target: f.value for f in bench.fit.free}
    found = sizes(values)
    ratios = undetermined(model, bench.fit)
    covariance = bench.fit.covariance(ratios)
    slopes = {key: np.zeros(len(bench.fit.free)) for key in found}
    for i, f in enumerate(bench.fit.free):
        if isinstance(f.target, str) or f.target in own:
            step = 1e-4
            there = sizes({**values, f.target: float(f.value * np.exp(step) if f.log else f.value + step * f.unit)})
            for key in found:
                slopes[key][i] = (there[key][1] - found[key][1]) / step
    wider = _wider(bench, term, size, level)
    given = {}
    for key, (unit, value) in found.items():
        sd = wider * float(np.sqrt(max(float(slopes[key] @ covariance @ slopes[key]), 0.0)))
        if not slopes[key].any():  # looked for, not fitted: known as well as the size that goes with it
            alone = term.free[0].target
            sd = wider * abs(value) * bench.fit.deviation(alone, ratios) / max(abs(bench.fit.value(alone)), 1e-300)
        given[key] = Value(value, unit, (value - Z_95 * sd, value + Z_95 * sd))
    return Cause(form.kind, form.where, given, min(max(sure, 0.0), 1.0), rivals)


def _wider(bench: Bench, term: Term, size: float, level: float) -> float:
    """Factor of the deviations of a term of this share of the force there: noise alone makes less of them than unmodelled forces."""
    cut = term.form.how == "clip"  # the size of which is its limit itself
    ratios = undetermined(bench.model, bench.fit)
    known = min(
        bench.fit.deviation(f.target, ratios) / max(abs(f.value - (0.0 if cut else f.origin)), 1e-300)
        for f in _values_of(bench, term)
        if cut or not f.log
    )
    bent = systematic(level)
    return float(np.hypot(1.0, bent / max(size, bent, 1e-300) / max(known, 1e-12)))


def _values_of(bench: Bench, term: Term) -> list[Free]:
    """The free values of a term as they are in the bench."""
    return [f for f in bench.fit.free if f.target in {t.target for t in term.free}]
