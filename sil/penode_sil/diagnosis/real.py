# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The answer for a model that is a little wrong everywhere: what innovations name, how sure that is, and what it is worth."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import constants

from penode_gen import units
from penode_gen.model import GROUND, Model

from . import catalogue, innovate, parameters
from .catalogue import drives, friction
from .catalogue.form import Form, Motion, Sizes
from .evidence.bench import Bench, build
from .evidence.blocks import posterior
from .evidence.colour import shape
from .evidence.fit import Fit
from .evidence.observer import Filter, Record, bias, sample_noise
from .evidence.screening import Probe
from .fit import Free
from .innovate import Found
from .noise import Experiment
from .plant import Place
from .propose import FREE_RUN, SMALL, motions
from .result import MAY_BE_NOTHING, Cause, Named, Value, place
from .rounds import MIN_TAKEN, name_of, terms_of
from .terms import Term, Trial
from .worth import RIGHT, WORTH, Z_95, confounded, least, own_of_sensors, share, systematic, undetermined

Array = NDArray[np.float64]
RIVAL = (
    1.0 - RIGHT
) / RIGHT  # posterior, RIGHT of which is as much as what is not in the catalogue has: from there on an explanation is listed


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
        targets = {f.target for t in self.found.terms if name_of(t) in gone for f in t.free} | {
            bias(w) for k, w in gone if k == "sensor_bias"
        }
        free = [f for f in self.run.free if f.target not in targets]
        run = bench.problem().solve(free, Filter.none(*bench.fit.by.gain.shape), FREE_RUN)
        causes = tuple(c for c in self.causes if (c.kind, c.where) not in gone)
        offsets = tuple(s for s in self.offsets if ("sensor_bias", s) not in gone)
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
    chances = {a.trial: _weighed([t for t in a.trials if name_of(t) not in names - {name_of(a.trial)}]) for a in found.named}
    for a, term in [(accepted, term) for accepted in found.named for term in accepted.terms]:
        enough, chance, first = least(found.level, a.trial.whole), chances[a.trial], term is a.terms[0]
        size = share(plain, [t for t in named if name_of(t) == name_of(term)], plain.fit, moved)
        rivals = _rivals(chance, term) if first else _loads(model, bench.places[term.form.index])
        cause = _cause(model, plain, moved, term, size, rivals, _sure(chance, a.trial.form), found.level)
        log(f"{cause.kind} at {cause.where}: {size:.1%} of the force there")
        if size >= enough and not cause.may_be_nothing:
            causes = _merged(causes, cause)
        elif first:
            withheld.append(cause)
            notes.append(_small(term, f"{size:.1%} of the force there") if size < enough else f"{place(*name_of(term))} {MAY_BE_NOTHING}")
    for a in found.small:
        what = (
            f"{a.trial.taken:.0%} of the power of prediction errors"
            if a.trial.taken < MIN_TAKEN
            else f"{a.trial.share:.1%} of the force there"
        )
        notes.append(_small(a.terms[0], what))
        sure = _sure(_weighed(a.trials), a.trial.form)
        withheld.append(_cause(model, after, moved, a.terms[0], a.trial.share, (), sure, found.level))
    stopped = () if model.inputs else friction.KINDS  # a free motion ends where friction holds it
    shifts = np.full(len(noise), np.inf) if any(c.kind in stopped for c in causes) else _shifts(after, found.run, found.terms)
    biased, remarks = _offsets(model, after, Probe.of(after), found.level, shifts)
    notes += [*judged.notes, *remarks]
    run = found.run
    offsets = [s.name for s in model.sensors if any(f.target == bias(s.name) for f in run.free)]
    notes += parameters.notes_on_guessed(model, run)
    powers = [np.nansum(np.where(r.used, r.nu, 0.0) ** 2, axis=0) for r in (alone, run)]
    taken = max(1.0 - float(np.mean(powers[1] / np.maximum(powers[0], 1e-300))), bench.fit.taken_whole(after.fit, bench.problem().floor))
    sets = _explanations([(a.terms[0], chances[a.trial]) for a in found.named])
    return Answer((*judged.causes, *causes, *biased), tuple(withheld), tuple(notes), sets, found, run, tuple(offsets), taken, after.model)


def _searched(model: Model, bench: Bench, log: Callable[[str], None]) -> tuple[Found, list[Motion], parameters.Judged]:
    """What the search finds, the motion with it, and its parameters. Where one of these only makes up for a form that is small beside it,
    small forms of at least WORTH of the force there are named too: they took little because the parameter had taken the rest."""

    def judged(found: Found) -> tuple[Found, list[Motion], parameters.Judged]:
        moved = motions(Probe.of(found.plain))
        return found, moved, parameters.judge(model, found, moved, RIGHT, log)

    first = judged(innovate.search(bench, log))
    large = [a for a in first[0].small if a.trial.share >= WORTH]
    if not first[2].absorbed or not large:
        return first
    wider = judged(first[0].naming(large))
    log(
        f"{', '.join(first[2].absorbed)} may have compensated for {', '.join(' at '.join(name_of(a.trial)) for a in large)}; "
        f"still does {wider[2].absorbed}"
    )
    return wider if set(wider[2].absorbed) < set(first[2].absorbed) else first


def _small(t: Term, what: str) -> str:
    """A note on a term that is too small to be named."""
    return f"{place(*name_of(t))} is real but small: {what}; not named, but in model_extended.toml"


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
    own = (catalogue.curve(form.kind), form.where)
    return sum(p for f, p in names if (catalogue.curve(f.kind), f.where) == own)


def _explanations(named: Sequence[tuple[Term, Sequence[tuple[Form, float]]]]) -> tuple[tuple[tuple[Named, ...], float], ...]:
    """Sets of causes with their posterior: the one found, and it with one cause exchanged for a rival; what is not in the catalogue has the
    rest."""
    own = tuple(dict.fromkeys(Named(*name_of(t)) for t, _ in named))
    if not own:
        return ()
    sure = [_sure(options, t.form) for t, options in named]
    sets = [(own, RIGHT * float(np.prod(sure)))]
    for k, (term, options) in enumerate(named):
        others = RIGHT * float(np.prod(sure[:k] + sure[k + 1 :]))
        for r in _rivals(options, term):
            p = next(p for f, p in options if (f.kind, f.where) == (r.kind, r.where))
            sets.append((tuple(r if n == Named(*name_of(term)) else n for n in own), others * p))
    whole = max(sum(p for _, p in sets) / RIGHT, 1.0)  # forms of one curve count for the simplest of them, and each for itself
    return tuple((names, p / whole) for names, p in sets)


def _cause(
    model: Model, bench: Bench, moved: Sequence[Motion], term: Term, size: float, rivals: tuple[Named, ...], sure: float, level: float
) -> Cause:
    """A term as a cause with sizes and intervals, along a motion of every place; `sure`: posterior of its name among the forms of the
    catalogue; `level`: the unmodelled force that remains."""
    form = term.form
    file = catalogue.OF.get(form.kind, drives)
    own = {t.target for t in term.free}
    at = bench.places[form.index] if form.how == "force" else None
    first = moved[form.index].parts[0] if at else None

    def sizes(values: Mapping[object, float]) -> dict[str, tuple[str, float]]:
        if file is drives:
            unit = units.si((model.inputs if form.how.startswith("input_") else model.sensors)[form.index].unit)
            return drives.sizes(form, Sizes({}, {}, True, values[term.free[0].target]), unit)
        parts = {}
        for k, (name, part) in enumerate(zip(term.elements, form.parts, strict=True)):
            for key in (part.gain[0], *part.shapes):
                parts[k, key] = values.get(f"{name}_{key}", bench.model.parameters[f"{name}_{key}"].value)
        linear: dict[str, float] = {}
        for e in model.elements:
            if any(e.name == n for n, _ in at.elements):
                for argument, parameter in e.arguments.items():
                    key = f"{e.law}.{argument}"
                    linear[key] = linear.get(key, 0.0) + values.get(parameter, model.parameters[parameter].value)
        known = Sizes(parts, linear, bool(model.bodies), first=first)
        return {k: (at.unit(u), v) for k, (u, v) in file.sizes(form, known).items()}

    values = {f.target: f.value for f in bench.fit.free}
    found = sizes(values)
    ratios = undetermined(model, bench.fit)
    covariance = bench.fit.covariance(ratios)
    slopes = {key: np.zeros(len(bench.fit.free)) for key in found}
    for i, f in enumerate(bench.fit.free):
        if isinstance(f.target, str) or f.target in own:
            step = 1e-4
            moved = sizes({**values, f.target: float(f.value * np.exp(step) if f.log else f.value + step * f.unit)})
            for key in found:
                slopes[key][i] = (moved[key][1] - found[key][1]) / step
    wider = _wider(bench, term, size, level)
    given = {}
    for key, (unit, value) in found.items():
        sd = wider * float(np.sqrt(max(slopes[key] @ covariance @ slopes[key], 0.0)))
        if not slopes[key].any():  # looked for, not fitted: known as well as the size that goes with it
            alone = term.free[0].target
            sd = wider * abs(value) * bench.fit.deviation(alone, ratios) / max(abs(bench.fit.value(alone)), 1e-300)
        given[key] = Value(value, unit, (value - Z_95 * sd, value + Z_95 * sd))
    return Cause(form.kind, form.where, given, RIGHT * min(max(sure, 0.0), 1.0), rivals)


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


def _offsets(model: Model, bench: Bench, probe: Probe, level: float, shifts: Array) -> tuple[list[Cause], list[str]]:
    """Sensor offsets that the recordings show. An offset is a cause if it is surely above the share of the signal's rms that has a name
    (`worth.least`, beside the unmodelled `level` that remains) and below 100 %, and above the shift [n_z] of the signal's mean by what else
    was found, the curves of which are not known that well. Others, and those near 1 g, become notes. Nothing where start states have the
    same effect: a plant without a spring to ground has no zero, and its sensors are off against each other at most."""
    causes, notes = [], []
    biases = [bias(s.name) for s in model.sensors]
    shares, mixed = own_of_sensors(bench.model, bench.fit, biases), confounded(bench.model, bench.fit, biases)
    rms = [max(float(np.nanstd(np.concatenate([r.y[:, j] for r in bench.records]))), 1e-300) for j in range(len(biases))]
    if any(abs(mixed.get(b, 0.0)) > WORTH * shown for b, shown in zip(biases, rms, strict=True)):
        off = ", ".join(s.name for s in model.sensors if bias(s.name) in mixed)
        notes.append(f"the offsets of {off} differ; the recordings do not tell which is wrong")
    for s, alone, shown, shift in zip(model.sensors, shares[:-1], rms, shifts, strict=True):
        value, sd = bench.fit.value(bias(s.name)), bench.fit.deviation(bias(s.name))
        if alone * abs(value) <= 3.0 * sd or bias(s.name) in mixed:
            continue
        # collinearity with other free values amplifies the effect of model error
        sd, size = float(np.hypot(sd, systematic(level) * shown / alone)), abs(value)
        large = least(level, 0.0) * shown < size - Z_95 * sd and size < shown and abs(size / constants.g - 1.0) > WORTH
        if bench.places and size > shift and large:  # without places it may stand for any law
            causes.append(
                _load(model, bench, probe, s.name, value, sd) or _constant("sensor_bias", s.name, "bias", value, sd, units.si(s.unit))
            )
        else:
            notes.append(f"{s.name} has an offset of {value:.4g} {units.si(s.unit)}: gravity, ride height, a zero that is off?")
    return causes, notes


def _shifts(bench: Bench, run: Fit, terms: Sequence[Term]) -> Array:
    """By how much terms shift the mean of each sensor [n_z] in a free run, by its slopes, each in its own direction."""
    own = {f.target for t in terms for f in t.free if not f.log}
    sizes = np.array([abs(f.value - f.origin) / f.unit * (f.target in own) for f in run.free])
    whitened = 1.0 if bench.colour is None else np.abs(1.0 - bench.colour.taps.sum(axis=0))  # of a mean, is left
    return np.abs(np.nanmean(np.where(run.used[:, :, None], run.slopes, np.nan), axis=0)) @ sizes / whitened


def _constant(kind: str, where: str, name: str, value: float, sd: float, unit: str, alike: tuple[Named, ...] = ()) -> Cause:
    return Cause(kind, where, {name: Value(value, unit, (value - Z_95 * sd, value + Z_95 * sd))}, RIGHT, alike)


def _load(model: Model, bench: Bench, probe: Probe, sensor: str, offset: float, deviation: float) -> Cause | None:
    """The constant force on a body, if any, with the same effect on all sensors as this `offset` (+- `deviation`) of one: the simpler
    cause, and what an input or the sensor itself may be off by as well."""
    i = [f.target for f in bench.fit.free].index(bias(sensor))
    f = bench.fit.free[i]
    used, white = bench.fit.used, 1.0 / np.sqrt(bench.fit.variance)
    seen = (bench.fit.slopes[:, :, i] * white)[used] / f.unit
    starts = (bench.fit.slopes * white[None, :, None])[used][
        :, [not isinstance(x.target, str) and x.target[0] == "start" for x in bench.fit.free]
    ]
    for k, p in enumerate(bench.places):
        if GROUND not in p.ends or p.role == "tyre":
            continue
        (column,) = probe.columns([(k, [np.ones(len(r)) for r in bench.records])], SMALL * float(np.min(bench.forces)))
        force = (column * white)[used]
        columns = np.column_stack([force, starts])
        columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
        sizes = np.linalg.lstsq(columns, seen, rcond=1e-9)[0]
        if np.linalg.norm(seen - columns @ sizes) < WORTH * np.linalg.norm(seen):
            factor = float(sizes[0]) / float(np.linalg.norm(force))
            value, sd = -factor * offset, abs(factor) * deviation
            alike = (Named("sensor_bias", sensor), *_loads(model, p))
            return _constant("constant_force", p.name, "force", value, sd, p.unit("N"), alike)
    return None


def _loads(model: Model, p: Place) -> tuple[Named, ...]:
    """Inputs whose offset may be a constant force at a place."""
    return tuple(Named("input_offset", x.name) for x in model.inputs if p.unit("N") == x.unit)
