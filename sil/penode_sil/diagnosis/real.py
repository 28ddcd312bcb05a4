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

from . import catalogue, innovate
from .catalogue import drives
from .catalogue.form import Form, Sizes
from .evidence.bench import UNSTATED, Bench, build
from .evidence.blocks import posterior
from .evidence.fit import Fit
from .evidence.observer import Filter, Record, bias, sample_noise
from .evidence.screening import Probe
from .innovate import Z_95, Found
from .noise import Experiment
from .propose import Term, Trial, motions
from .plant import Place
from .result import Cause, Named, Value, place

Array = NDArray[np.float64]
WORTH = 0.06  # of the force at its place, of an input or of a signal: less is a small deviation, as any model has, of 2 to 5 %
RIVAL = 0.1  # posterior from which on an explanation is listed


@dataclass(frozen=True, eq=False)
class Answer:
    """Causes, notes on what is small, the sets of explanations that held-out blocks cannot tell apart with their posterior, and where
    the search ended; `free` values of the free run that fits best."""

    causes: tuple[Cause, ...]
    notes: tuple[str, ...]
    explanations: tuple[tuple[tuple[Named, ...], float], ...]
    found: Found
    run: Fit
    model: Model


def answer(
    model: Model, places: Sequence[Place], experiments: Sequence[Experiment], fastest: float, set_name: str, log: Callable[[str], None]
) -> Answer:
    """Searches recordings for causes by innovations, and weighs what is found."""
    records = [Record.of(e) for e in experiments]
    noise = sample_noise(records, np.array([s.noise for s in model.sensors]))
    bench = build(model, places, records, noise, fastest, set_name)
    log(f"corrected every {bench.update} samples; {bench.level.size:.3g} of what moves wanders, for {bench.level.tau:.3g} s")
    found = innovate.search(bench, log)
    after = found.bench
    causes, notes = [], []
    probabilities = [_weighed(r) for r in found.rounds]
    for k, term in enumerate(found.terms):
        cause, size = _cause(model, after, term, _rivals(probabilities[k], term), _sure(probabilities[k], term))
        if size >= WORTH or any((c.kind, c.where) == (cause.kind, cause.where) for c in causes):
            causes = _merged(causes, cause)
        else:
            notes.append(f"{place(cause.kind, cause.where)} is real but small: {size:.1%} of what acts there; not named, but in model_extended.toml")
    wrong, more = _parameters(model, after, _shared(model, after, found.terms))
    notes += more + _offsets(model, after)
    still = Filter.none(*after.fit.by.gain.shape)
    run = after.problem().solve(after.fit.free, still, 20)
    return Answer((*wrong, *causes), tuple(notes), _explanations(found, probabilities), found, run, after.model)


def _merged(causes: list[Cause], new: Cause) -> list[Cause]:
    """Causes with another one; a second form of one that is there gives it more parameters."""
    same = [c for c in causes if (c.kind, c.where) == (new.kind, new.where)]
    if not same:
        return [*causes, new]
    return [replace(c, parameters={**new.parameters, **c.parameters}) if c is same[0] else c for c in causes]


def _weighed(trials: Sequence[Trial]) -> list[tuple[Form, float]]:
    """Posterior of the names of a round: of each, its best form, summed over the forms of one name."""
    if not trials:
        return []
    chance = posterior([t.blocks for t in trials])
    total: dict[tuple[str, str], float] = {}
    forms: dict[tuple[str, str], Form] = {}
    for t, p in zip(trials, chance):
        name = (t.form.kind, t.form.where)
        total[name] = total.get(name, 0.0) + float(p)
        forms.setdefault(name, t.form)
    return sorted(((forms[n], p) for n, p in total.items()), key=lambda pair: -pair[1])


def _rivals(names: Sequence[tuple[Form, float]], term: Term) -> tuple[Named, ...]:
    own = (term.form.kind, term.form.where)
    return tuple(Named(f.kind, f.where) for f, p in names if (f.kind, f.where) != own and p > RIVAL)[:3]


def _sure(names: Sequence[tuple[Form, float]], term: Term) -> float:
    return next((p for f, p in names if (f.kind, f.where) == (term.form.kind, term.form.where)), 0.5)


def _explanations(found: Found, names: Sequence[Sequence[tuple[Form, float]]]) -> tuple[tuple[tuple[Named, ...], float], ...]:
    """Sets of causes with their posterior: the one found, and it with one cause exchanged for a rival."""
    own = tuple(dict.fromkeys(Named(t.form.kind, t.form.where) for t in found.terms))
    if not own:
        return ()
    sets = [(own, float(np.prod([_sure(n, t) for n, t in zip(names, found.terms)])))]
    for k, (options, term) in enumerate(zip(names, found.terms)):
        for r in _rivals(options, term):
            p = next(p for f, p in options if (f.kind, f.where) == (r.kind, r.where))
            here = Named(term.form.kind, term.form.where)
            sets.append((tuple(r if n == here else n for n in own), p))
    return tuple(sets)


def _cause(model: Model, bench: Bench, term: Term, rivals: tuple[Named, ...], sure: float) -> tuple[Cause, float]:
    """A term as a cause with sizes and intervals, and its share of what acts at its place."""
    form = term.form
    file = catalogue.OF.get(form.kind, drives)
    own = {t.target for t in term.free}
    at = bench.places[form.index] if form.how == "force" else None

    def sizes(values: Mapping[object, float]) -> dict[str, tuple[str, float]]:
        if file is drives:
            unit = units.si(model.inputs[form.index].unit) if form.how.startswith("input_") else "1"
            return drives.sizes(form, Sizes({}, {}, 0.0, True, values[term.free[0].target]), unit)
        parts = {}
        for k, (name, part) in enumerate(zip(term.elements, form.parts)):
            for key in (part.gain[0], *part.shapes):
                parts[k, key] = values.get(f"{name}_{key}", bench.model.parameters[f"{name}_{key}"].value)
        linear: dict[str, float] = {}
        for e in model.elements:
            if any(e.name == n for n, _ in at.elements):
                for argument, parameter in e.arguments.items():
                    key = f"{e.law}.{argument}"
                    linear[key] = linear.get(key, 0.0) + values.get(parameter, model.parameters[parameter].value)
        longest = max(len(r) * r.step for r in bench.records)
        return {k: (at.unit(u), v) for k, (u, v) in file.sizes(form, Sizes(parts, linear, longest, bool(model.bodies))).items()}

    values = {f.target: f.value for f in bench.fit.free}
    found = sizes(values)
    covariance = bench.fit.covariance()
    slopes = {key: np.zeros(len(bench.fit.free)) for key in found}
    for i, f in enumerate(bench.fit.free):
        if isinstance(f.target, str) or f.target in own:
            step = 1e-4
            moved = sizes({**values, f.target: float(f.value * np.exp(step) if f.log else f.value + step * f.unit)})
            for key in found:
                slopes[key][i] = (moved[key][1] - found[key][1]) / step
    parameters = {}
    for key, (unit, value) in found.items():
        sd = float(np.sqrt(max(slopes[key] @ covariance @ slopes[key], 0.0)))
        parameters[key] = Value(value, unit, (value - Z_95 * sd, value + Z_95 * sd))
    return Cause(form.kind, form.where, parameters, min(max(sure, 0.0), 0.99), rivals), _share(bench, term)


def _share(bench: Bench, term: Term) -> float:
    """Rms of a term as a share of what acts at its place, of its input, or of its sensor."""
    form, fit = term.form, bench.fit
    if form.how != "force":
        value = fit.value(term.free[0].target)
        turn = 2.0 * np.pi / (16 * bench.update * bench.step)  # of the motion [rad/s]
        if form.how == "input_offset":
            return abs(value) / max(float(np.std(np.concatenate([r.u[:, form.index] for r in bench.records]))), 1e-300)
        return 2.0 * abs(value - 1.0) if form.how == "scale" else 2.0 * abs(value) if form.how == "input_gain" else abs(value) * turn
    moved = motions(Probe.of(bench))[form.index]
    total = [np.zeros(len(m.s)) for m in moved.parts]
    for name, part in zip(term.elements, form.parts):
        shapes = {k: (fit.values.get(f"{name}_{k}", v), u) for k, (v, u) in part.shapes.items()}
        now = replace(part, shapes=shapes)
        total = [x + fit.value(f"{name}_{part.gain[0]}") * now.along(m) for x, m in zip(total, moved.parts)]
    return float(np.sqrt(np.mean(np.concatenate(total) ** 2))) / moved.force


def _shared(model: Model, bench: Bench, terms: Sequence[Term]) -> set[str]:
    """Parameters of straight lines at places where a law of the catalogue has a straight part of its own: how much of the line is whose
    is a matter of writing it down."""
    places = {t.form.index for t in terms if t.form.how == "force" and t.form.kind in getattr(catalogue.OF[t.form.kind], "STRAIGHT", ())}
    names = {name for k in places for name, _ in bench.places[k].elements}
    return {p for e in model.elements if e.name in names for p in e.arguments.values()}


def _parameters(model: Model, bench: Bench, shared: Collection[str]) -> tuple[list[Cause], list[str]]:
    """Parameters that are not what the file says, beyond what it vouches for, and a note on those that are shared with a law."""
    fit, causes, notes = bench.fit, [], []
    for name, p in model.parameters.items():
        f = next((f for f in fit.free if f.target == name), None)
        if f is None or np.isinf(p.tolerance):
            continue
        sd = fit.deviation(name)
        limit = p.tolerance if p.tolerance > 0.0 else UNSTATED
        off = abs(f.value / p.value - 1.0)
        low, high = f.value - Z_95 * sd, f.value + Z_95 * sd
        if off > limit and not low <= p.value * (1.0 + limit * np.sign(f.value / p.value - 1.0)) <= high and not low <= p.value <= high:
            if name in shared:
                notes.append(f"{name} is {f.value:.4g} {units.si(p.unit)} beside what was found at its place, which shares its straight part")
                continue
            sure = 0.99 if p.tolerance else 0.95
            causes.append(Cause("wrong_parameter", name, {name: Value(f.value, units.si(p.unit), (low, high))}, sure))
    return causes, notes


def _offsets(model: Model, bench: Bench) -> list[str]:
    """Notes on offsets of sensors that the recordings show."""
    found = []
    for s in model.sensors:
        value, sd = bench.fit.value(bias(s.name)), bench.fit.deviation(bias(s.name))
        if abs(value) > 3.0 * sd:
            found.append(f"{s.name} has an offset of {value:.4g} {units.si(s.unit)}: gravity, ride height, a zero that is off?")
    return found
