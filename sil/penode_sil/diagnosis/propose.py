# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forms of causes beside what a model has: proposed by a score test, put into the model together, fitted to innovations one by one."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from penode_gen.laws import LAWS
from penode_gen.model import Element, Model

from . import catalogue
from .catalogue import drives
from .catalogue.form import Form, Motion, Moved, Part
from .evidence.bench import Bench, fit_level
from .evidence.fit import Fit
from .evidence.gain import Level
from .evidence.observer import Filter, scale
from .evidence.screening import Probe, Score, scores
from .fit import Free
from .plant import extend

Array = NDArray[np.float64]
TRIED = 6  # forms that are fitted in a round, the best of each name and place first
PROMISE = 3.0  # log likelihood that a form has to promise for it
SMALL = 0.02  # of the force at a place: a force that is put on to see what it does, and a law's start
LITTLE = 0.4  # of a unit, which is 0.05 of the force at the place
VAGUE = 0.5  # standard deviation of the logarithm of a parameter from which on it is hardly known
FREE_RUN, FOLLOWED = 10, 12  # iterations of a form's fits


@dataclass(frozen=True, eq=False)
class Term:
    """A form in a model: its elements there, one for each part, and its free values."""

    form: Form
    elements: tuple[str, ...]
    free: tuple[Free, ...]


@dataclass(frozen=True, eq=False)
class Trial:
    """A form beside what was accepted already, fitted: `gain` of the criterion, `blocks` [blocks] of predictive density."""

    form: Form
    term: Term
    fit: Fit
    gain: float
    level: Level
    blocks: Array | None = None


def motions(probe: Probe) -> list[Motion]:
    """Of every place. What acts on a body where nothing of the model does is what moves it."""
    found, bench = [], probe.bench
    for k, place in enumerate(bench.places):
        parts = [Moved(m[:, 3 * k], m[:, 3 * k + 1], np.arange(len(m)) * bench.step) for m in probe.motions]
        acts = float(np.std(np.concatenate([m[:, 3 * k + 2] for m in probe.motions])))
        found.append(Motion.of(parts, acts if place.elements else _inertia(bench, place.ends[0])))
    return found


def _inertia(bench: Bench, body: str) -> float:
    """Rms of mass times acceleration of a body."""
    k, b = next((k, b) for k, b in enumerate(bench.model.bodies) if b.name == body)
    return bench.fit.values.get(b.mass, bench.model.parameters[b.mass].value) * float(bench.forces[k])


def propose(bench: Bench, terms: Sequence[Term], log: Callable[[str], None]) -> tuple[list[Trial], Model]:
    """The likeliest forms beside those accepted, fitted, the best first; and the model that has all of them."""
    probe = Probe.of(bench)
    moved = motions(probe)
    n_u = bench.records[0].u.shape[1]
    forms: list[Form] = []
    for k, (place, motion) in enumerate(zip(bench.places, moved)):
        if motion.s_rms > 0.0 and motion.v_rms > 0.0 and motion.force > 0.0:
            for file in catalogue.FILES:
                forms += file.forms(bench.model, k, place, motion)
    forms += drives.inputs(bench.model, n_u)
    forms += drives.sensors(bench.model, len(bench.noise))
    forms = [f for f in forms if not _taken(f, terms)]
    ranked = _screened(bench, probe, forms, moved)
    chosen: dict[tuple[str, str, str], tuple[Score, Form]] = {}
    for score, form in ranked:
        if score.gain > PROMISE and len(chosen) < TRIED:
            chosen.setdefault((form.kind, form.where, form.note), (score, form))
    wide, made = with_forms(bench, [form for _, form in chosen.values()], moved, len(terms))
    log("screened: " + ", ".join(f"{f.kind} {f.where} {f.note} {s.gain:.0f}" for s, f in ranked[:12]))
    trials = [_fitted(bench, wide, t, s.sizes) for t, (s, _) in zip(made, chosen.values())]
    return sorted(trials, key=lambda t: -t.gain), wide


def _taken(form: Form, terms: Sequence[Term]) -> bool:
    """Has the model that form already, or one of a curve of which a place has only one?"""
    there = [t.form for t in terms if t.form.where == form.where]
    one = catalogue.curve(form.kind)
    return any((f.kind, f.note) == (form.kind, form.note) or one != form.kind and catalogue.curve(f.kind) == one for f in there)


def _screened(bench: Bench, probe: Probe, forms: Sequence[Form], moved: Sequence[Motion]) -> list[tuple[Score, Form]]:
    forces = [(f.index, [p.along(m) for m in moved[f.index].parts]) for f in forms if f.how == "force" for p in f.parts]
    size = SMALL * min(m.force for m in moved if m.force > 0.0)
    columns = iter(probe.columns(forces, size))
    hypotheses = []
    for f in forms:
        if f.how == "force":
            hypotheses.append(np.stack([next(columns) for _ in f.parts], axis=-1))
        else:
            hypotheses.append(_slope(bench, f)[:, :, None])
    return sorted(zip(scores(bench.fit, hypotheses), forms), key=lambda pair: -pair[0].gain)


def _slope(bench: Bench, form: Form) -> Array:
    """Change [updates, n_z] of the innovations with what is wrong with an input or a sensor."""
    (f,) = _free_of(bench, form)
    problem = bench.problem()
    free = (*bench.fit.free, f)
    shifts = np.zeros((2, len(free)))
    shifts[1, -1] = 0.1
    nu = problem.nu(free, shifts, bench.fit.by)
    return (nu[1] - nu[0]) / 0.1


def _free_of(bench: Bench, form: Form) -> tuple[Free, ...]:
    """The value of a form of an input or a sensor."""
    step = bench.update * bench.step
    match form.how:
        case "input_gain":
            return (Free((form.how, form.index), 0.0, 0.01, sigma=0.3),)
        case "input_offset":
            size = max(float(np.std(np.concatenate([r.u[:, form.index] for r in bench.records]))), 1e-12)
            return (Free((form.how, form.index), 0.0, 0.01 * size, sigma=size),)
        case "input_delay" | "input_lag":
            return (Free((form.how, form.index), 0.2 * bench.step, 0.2 * step, sigma=2.0 * step, low=0.0),)
        case "scale":
            return (Free(scale(form.where), 1.0, 0.01, sigma=0.3, origin=1.0),)
        case "late":
            return (Free((form.how, form.index), 0.2 * bench.step, 0.1 * step, sigma=step, low=0.0),)
    raise ValueError(form.how)


def with_forms(bench: Bench, forms: Sequence[Form], moved: Sequence[Motion], first: int) -> tuple[Model, list[Term]]:
    """The model with all forms in it, each without any force yet, and their terms."""
    elements, where, parameters, terms = [], [], {}, []
    for i, form in enumerate(forms):
        if form.how != "force":
            terms.append(Term(form, (), _free_of(bench, form)))
            continue
        place, names, free = bench.places[form.index], [], []
        for j, part in enumerate(form.parts):
            name = f"x{first}_{i}_{j}"
            own = {part.gain[0]: (0.0, part.gain[1]), **part.shapes}
            parameters |= {f"{name}_{key}": entry for key, entry in own.items()}
            elements.append(_element(name, place.ends, part))
            where.append(place)
            names.append(name)
            size = moved[form.index].force / max(_rms([part.along(m) for m in moved[form.index].parts]), 1e-300)
            low, high = (0.0 if part.sign > 0 else -np.inf), (0.0 if part.sign < 0 else np.inf)
            free.append(Free(f"{name}_{part.gain[0]}", 0.0, 0.05 * size, sigma=size, low=low, high=high))
            for key, (value, _) in part.shapes.items():
                if key not in part.fixed:
                    free.append(Free(f"{name}_{key}", value, value, log=True, sigma=1.0, origin=value, low=value / 30.0, high=30.0 * value))
        terms.append(Term(form, tuple(names), tuple(free)))
    return extend(bench.model, elements, parameters, where), terms


def _element(name: str, ends: tuple[str, str], part: Part) -> Element:
    """A part as an element whose parameters begin with its name."""
    if part.law in LAWS:
        return Element(name, ends, part.law, {a: f"{name}_{a}" for a in LAWS[part.law].arguments})
    keys = [part.gain[0], *part.shapes]
    text = re.sub(r"\b(" + "|".join(keys) + r")\b", lambda m: f"{name}_{m[1]}", part.law)
    return Element(name, ends, "expression", expression=re.sub(r"\b([sv])\b", lambda m: f"{m[1]}_{name}", text))


def _rms(series: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(list(series)) ** 2)))


def _fitted(bench: Bench, wide: Model, term: Term, sizes: Array) -> Trial:
    """A term beside all that was accepted: from the best so far with the sizes that its score promises; where parameters are hardly known
    also from the nominal ones, and from its own free run, for the motion of a wrong plant promises little."""
    problem = bench.problem(wide)
    n_x = len(wide.states)
    by, still = bench.fit.by.padded(n_x), Filter.none(n_x, len(bench.noise))
    starts = [(*bench.fit.free, *_sized(term, sizes))]
    if any(f.log and f.sigma > VAGUE for f in bench.nominal):
        little = np.clip(sizes, *np.outer((-1.0, 1.0), [LITTLE * f.unit for f in term.free if not f.log]))
        starts += [(*bench.nominal, *_sized(term, little)), (*bench.fit.free, *_sized(term, little))]
        runs = [problem.solve(f, still, FREE_RUN) for f in starts[1:]]
        starts.append(max(runs, key=lambda f: f.cost).free)
    best = max((problem.solve(f, by, FOLLOWED) for f in starts), key=lambda f: f.cost)
    level, best = fit_level(replace(bench, model=wide), problem, best, bench.level)
    return Trial(term.form, term, best, best.criterion() - bench.fit.criterion(), level)


def _sized(term: Term, sizes: Array) -> list[Free]:
    """The free values of a term with sizes of its parts, halved, for a score looks at small ones, and of the sign that they may have."""
    at = iter(sizes)
    return [f if f.log else replace(f, value=float(np.clip(f.value + 0.5 * next(at), f.low, f.high))) for f in term.free]


def adopt(bench: Bench, t: Trial) -> tuple[Bench, Term]:
    """The bench with a trial's form in its model, and the term that it has become."""
    moved = motions(Probe.of(bench))
    wide, (term,) = with_forms(bench, [t.form], moved, 90 + len(bench.model.elements))
    names = dict(zip([f.target for f in t.term.free], term.free))
    free = tuple(replace(f, target=names[f.target].target) if f.target in names else f for f in t.fit.free)
    fresh = replace(bench, model=wide, free=free, level=t.level)
    problem = fresh.problem()
    return replace(fresh, fit=problem.solve(free, t.fit.by.cut(len(bench.model.states)).padded(len(wide.states)), FOLLOWED)), term
