# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model file with the result of a search."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field

from penode_gen import units
from penode_gen.laws import LAWS
from penode_gen.model import Element, Model

from ..catalogue import drives, stem
from ..catalogue.actuators import ACTUATORS
from ..evidence.bench import Bench
from ..evidence.fit import Fit
from ..evidence.observer import bias, scale
from ..plant.plant import extend
from ..search import clipping
from ..search.terms import Term
from . import late
from .entries import head, table, toml, unlike


@dataclass(frozen=True, eq=False)
class Applied:
    """Text of a model file that extends the nominal one; `left` lists effects that it cannot express."""

    text: str
    left: tuple[str, ...]


def apply(model: Model, bench: Bench, fit: Fit, terms: Sequence[Term], offsets: Collection[str]) -> Applied:
    """The nominal model with the values of a fit and the terms of it; `offsets`: sensors whose
    offset goes into it."""
    forces = [t for t in terms if t.form.how == "force"]
    taken = names(model)
    rename: dict[str, str] = {}
    for t in forces:
        for name in t.elements:
            rename[name] = unlike(stem(t.form.kind), {*taken, *rename.values()})

    def named(text: str) -> str:
        return re.sub(r"\b((?:[Fsv]_)?)(x\d+_\d+_\d+)(?=_|\b)", lambda m: m[1] + rename.get(m[2], m[2]), text)

    values = fit.values
    parameters, elements = _forces(model, bench, values, forces, named)
    driven = _driven(model, fit, terms, {*taken, *rename.values()})
    moved = redirected(model, driven, values)
    parameters += [p for p in moved["parameters"] if p not in parameters]
    own = [(e, bench.places[t.form.index]) for t in forces for e in bench.model.elements if e.name in t.elements]
    grown = extend(model, [e for e, _ in own], {}, [place for _, place in own])
    limits = {t.form.index: [fit.value(f.target) for f in t.free] for t in terms if t.form.how == "clip"}
    texts = [driven.through(named(s.expression)) for s in grown.sensors]
    delays = {t.form.index: (t.form.how, fit.value(t.free[0].target)) for t in terms if t.form.how in late.HOW}
    room = model.filter is None  # whose states a file lists, with how sure each is at the start
    driven.left += [] if room else [_uncorrected(t) for t in terms if t.form.how in late.HOW]
    delays = {j: (how, d) for j, (how, d) in delays.items() if room and d > late.SHORT * model.sample_time}
    sensors = [_sensor(model, j, text, values, offsets, limits, delays, driven) for j, text in enumerate(texts)]
    units_of = {o.name: o.unit for o in model.outputs}  # one name means one quantity
    outputs = [
        f"{s.name} = {table({**x, 'unit': units_of[s.name]})}"
        for s, x in zip(model.sensors, sensors, strict=True)
        if x and s.name in units_of
    ]
    outputs += [x for x in moved["outputs"] if x.split(" = ")[0] not in {o.split(" = ")[0] for o in outputs}]
    substeps = max((late.substeps(d, model.sample_time) for _, d in delays.values()), default=1)
    learnt = ", ".join(dict.fromkeys(f"{t.form.kind} at {t.form.where}" for t in terms))
    lines = head(model, learnt or "values only", substeps)
    for title, entries in (
        ("parameters", [*parameters, *driven.parameters]),
        ("actuators", driven.actuators),
        ("elements", [*moved["elements"], *elements]),
        ("states", driven.states),
        ("equations", [*moved["equations"], *driven.equations]),
        ("outputs", outputs),
        (
            "sensors",
            [
                f"{s.name} = {table({**x, 'noise': s.noise / units.factor(s.unit)})}"
                for s, x in zip(model.sensors, sensors, strict=True)
                if x
            ],
        ),
    ):
        if entries:
            lines += [f"[{title}]", *entries, ""]
    return Applied("\n".join(lines), tuple(driven.left))


def _forces(
    model: Model, bench: Bench, values: Mapping[str, float], forces: Sequence[Term], named: Callable[[str], str]
) -> tuple[list[str], list[str]]:
    """Entries of parameters, those of the model that differ and those of the new elements, and of these elements."""
    parameters = [
        _changed(model, name, values[name]) for name in model.parameters if name in values and values[name] != model.parameters[name].value
    ]
    elements = []
    for name in (name for t in forces for name in t.elements):
        own = next(e for e in bench.model.elements if e.name == name)
        parameters += [
            f"{named(p.name)} = {table({'value': values.get(p.name, p.value), 'unit': p.unit})}"
            for p in bench.model.parameters.values()
            if p.name.startswith(f"{name}_")
        ]
        elements.append(f"{named(name)} = {table(_element(own, named))}")
    return parameters, elements


def names(model: Model) -> set[str]:
    """All names of a model file."""
    lists = (model.inputs, model.bodies, model.points, model.sampled, model.elements, model.variables, model.outputs, model.sensors)
    return {*model.parameters, *model.states, *(x.name for some in lists for x in some)}


def _changed(model: Model, name: str, value: float) -> str:
    known = model.parameters[name]
    more: dict[str, object] = {"tolerance": known.tolerance if known.tolerance < float("inf") else "unknown"} if known.tolerance else {}
    more |= {"tunable": True} if known.tunable else {}
    more |= {"description": known.description} if known.description else {}
    return f"{name} = {table({'value': value / units.factor(known.unit), 'unit': known.unit, **more})}"


def _element(e: Element, named: Callable[[str], str]) -> dict[str, object]:
    entry: dict[str, object] = {"between": e.ends, "law": e.law}
    if e.law == "expression":
        return entry | {"force": named(e.expression)}
    return entry | {k: named(e.arguments[k]) for k in LAWS[e.law].arguments}


def _sensor(
    model: Model,
    j: int,
    expression: str,
    values: dict[str, float],
    offsets: Collection[str],
    limits: Mapping[int, Sequence[float]],
    delays: Mapping[int, tuple[str, float]],
    driven: Driven,
) -> dict[str, object]:
    """What a sensor that measures otherwise has as its value and unit; nothing for one that does not."""
    s, unit = model.sensors[j], units.si(model.sensors[j].unit)

    def added(stem: str, value: float, unit: str) -> str:
        name = driven.name(f"{stem}_{s.name}")
        driven.parameters.append(f"{name} = {table({'value': value, 'unit': unit})}")
        return name

    if j in delays:
        how, delay = delays[j]
        stems, written = late.HOW[how]
        found = written(expression, [driven.name(f"{stem}_{s.name}") for stem in stems], unit, delay)
        driven.parameters.append(found.parameter)
        driven.states += found.states
        driven.equations += found.equations
        expression = found.expression
    if scale(s.name) in values:
        expression = f"{added('gain', values[scale(s.name)], '1')}*({expression})"
    if s.name in offsets:
        expression = f"{expression} + {added('bias', values[bias(s.name)], unit)}"
    if j in limits:
        most, *sharp = (added(stem, x, own) for x, stem, own in zip(limits[j], ("limit", "sharpness"), (unit, "1"), strict=False))
        expression = clipping.expression(expression, most, *sharp)
    if expression == s.expression:
        return {}
    return {"value": expression, "unit": s.unit}


@dataclass
class Driven:
    """What terms of inputs and late sensors add to a model file: entries by section, what stands for an input now (`acts`), its offset, and
    notes on what the file cannot express. `taken`: names that the file has."""

    taken: set[str]
    parameters: list[str] = field(default_factory=list)
    actuators: list[str] = field(default_factory=list)
    states: list[str] = field(default_factory=list)
    equations: list[str] = field(default_factory=list)
    acts: dict[str, str] = field(default_factory=dict)
    offsets: dict[str, str] = field(default_factory=dict)
    left: list[str] = field(default_factory=list)

    def name(self, stem: str) -> str:
        """A name that is not taken, and is from now on."""
        found = unlike(stem, self.taken)
        self.taken.add(found)
        return found

    def through(self, text: str) -> str:
        """An expression with its inputs replaced; an offset has no rate."""
        if self.acts:
            text = re.sub(rf"\b({'|'.join(self.acts)})\b", lambda m: self.acts[m[1]], text)
        for name, offset in self.offsets.items():
            text = re.sub(rf"(?<!der\()\b{self.acts[name]}\b", f"({self.acts[name]} + {offset})", text)
        return text


def _driven(model: Model, fit: Fit, terms: Sequence[Term], taken: set[str]) -> Driven:
    """What terms of inputs add to a model file, several of one input in a row."""
    found = Driven(taken)
    own = sorted((t for t in terms if t.form.how.startswith("input_")), key=_order)
    for name in dict.fromkeys(t.form.where for t in own):
        mine = [t for t in own if t.form.where == name]
        if bound(model, name):
            found.left += [_uncorrected(t) for t in mine]
            continue
        found.acts[name] = name
        for t in mine:
            value = fit.value(t.free[0].target)
            if drives.is_constant(t.form) and not any(name in e.ends for e in model.elements):
                found.offsets[name] = found.name(f"{name}_offset")
                unit = units.si(next(i.unit for i in model.inputs if i.name == name))
                found.parameters.append(f"{found.offsets[name]} = {table({'value': value, 'unit': unit})}")
            else:
                found.acts[name] = _actuator(model, t, value, found.acts[name], found)
    return found


def _order(t: Term) -> int:
    """Place of a term in the row in which those of an input act, as they were fitted."""
    return ACTUATORS[t.form.how].order if t.form.how in ACTUATORS else 0


def bound(model: Model, name: str) -> bool:
    """Does an actuator or a point of the file take an input, which a file that extends it cannot take elsewhere?"""
    actuated = [q.text for q in model.equations if q.text.startswith(f"der({q.name})*")] + [p.text for p in model.points]
    return any(s.source == name for s in model.sampled) or any(re.search(rf"\b{name}\b", text) for text in actuated)


def _actuator(model: Model, t: Term, value: float, source: str, found: Driven) -> str:
    """Adds what a term makes of a signal; the name of that, or of the signal itself where the model file has no law for it."""
    name, samples = t.form.where, (t.form.series.period if t.form.series else value) / model.sample_time
    own = ACTUATORS.get(t.form.how)
    law: dict[str, object] = {}
    if own and own.law:
        unit = units.si(next(i.unit for i in model.inputs if i.name == name))
        law["law"] = own.law
        for key, (stem, size, of) in own.entry(value).items():
            if not stem:
                law[key] = f"{size:.9g} {drives.of_input(of, unit)}"
                continue
            law[key] = found.name(f"{name}_{stem}")
            found.parameters.append(f"{law[key]} = {table({'value': size, 'unit': drives.of_input(of, unit)})}")
    elif (t.form.series or drives.is_late(t.form)) and round(samples) >= 1:
        law = {"law": "held" if t.form.series else "delay", "samples": round(samples)}
        if abs(samples - round(samples)) > 0.1:
            found.left.append(f"{t.form.how} of {name} is {samples:.2f} samples; the model file has {round(samples)}")
    else:
        found.left.append(_uncorrected(t))
        return source
    acts = found.name(f"{name}_acts")
    found.actuators.append(f"{acts} = {table({'input': source, **law})}")
    return acts


def _uncorrected(t: Term) -> str:
    return f"{t.form.how} of {t.form.where}: a recording has to be corrected, the model file has no law for it"


def redirected(model: Model, driven: Driven, values: Mapping[str, float]) -> dict[str, list[str]]:
    """Elements, equations and outputs on which inputs act, with the expressions that replace these; and the parameters, with fitted
    `values`, that quantities in these elements become."""
    found: dict[str, list[str]] = {"parameters": [], "elements": [], "equations": [], "outputs": []}
    for e in model.elements:
        ends = driven.acts.get(e.ends[0], e.ends[0]), driven.acts.get(e.ends[1], e.ends[1])
        text = driven.through(e.expression)
        if ends != e.ends or text != e.expression:
            entry = _element(Element(e.name, ends, e.law, e.arguments, e.network, e.network_inputs, text), lambda x: x)
            found["elements"].append(f"{e.name} = {table(entry)}")
            own = [name for key, name in e.arguments.items() if name == f"{e.name}_{key}"]  # they may be quantities in the file's element
            found["parameters"] += [_changed(model, name, values.get(name, model.parameters[name].value)) for name in own]
    for q in model.equations:
        if (text := driven.through(q.text)) != q.text:
            found["equations"].append(f"{q.name} = {toml(text)}")
    for o in model.outputs:
        if (text := driven.through(o.expression)) != o.expression:
            found["outputs"].append(f"{o.name} = {table({'value': text, 'unit': o.unit})}")
    return found
