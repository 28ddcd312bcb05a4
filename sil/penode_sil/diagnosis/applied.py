# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model file with what a search by innovations found in it."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

from penode_gen import units
from penode_gen.laws import LAWS
from penode_gen.model import Element, Model

from .evidence.bench import Bench
from .evidence.fit import Fit
from .evidence.observer import bias, scale
from .extension import extends, table, toml, unlike
from .plant import extend
from .terms import Term


@dataclass(frozen=True, eq=False)
class Applied:
    """Text of a model file that extends the nominal one; `left` says what it cannot have."""

    text: str
    left: tuple[str, ...]


def apply(model: Model, bench: Bench, fit: Fit, terms: Sequence[Term], offsets: Collection[str]) -> Applied:
    """The nominal model with the values of a fit and the terms of it; `offsets`: sensors whose
    offset goes into it."""
    forces = [t for t in terms if t.form.how == "force"]
    taken = {*model.parameters, *model.states, *(x.name for x in model.elements), *(s.name for s in model.sensors)}
    rename: dict[str, str] = {}
    for t in forces:
        for name in t.elements:
            rename[name] = unlike(t.form.kind, {*taken, *rename.values()})

    def named(text: str) -> str:
        return re.sub(r"\b((?:[Fsv]_)?)(x\d+_\d+_\d+)(?=_|\b)", lambda m: m[1] + rename.get(m[2], m[2]), text)

    values = fit.values
    parameters = [_changed(model, name, values[name]) for name in model.parameters if name in values and values[name] != model.parameters[name].value]
    elements = []
    for t in forces:
        for name in t.elements:
            own = next(e for e in bench.model.elements if e.name == name)
            parameters += [
                f"{named(p.name)} = {table({'value': values.get(p.name, p.value), 'unit': p.unit})}"
                for p in bench.model.parameters.values() if p.name.startswith(f"{name}_")
            ]  # fmt: skip
            elements.append(f"{named(name)} = {table(_element(own, named))}")
    driven, left = _driven(model, fit, terms)
    own = [(e, bench.places[t.form.index]) for t in forces for e in bench.model.elements if e.name in t.elements]
    grown = extend(model, [e for e, _ in own], {}, [place for _, place in own])
    limits = {t.form.index: values[t.free[0].target] for t in terms if t.form.how == "clip"}
    sensors = [_sensor(model, j, named(grown.sensors[j].expression), values, offsets, limits, parameters) for j in range(len(model.sensors))]
    units_of = {o.name: o.unit for o in model.outputs}  # one name means one quantity
    outputs = [f"{s.name} = {table({**x, 'unit': units_of[s.name]})}" for s, x in zip(model.sensors, sensors) if x and s.name in units_of]
    learnt = ", ".join(dict.fromkeys(f"{t.form.kind} at {t.form.where}" for t in terms))
    lines = [
        f"# What the recordings taught about {model.path.name}: {learnt or 'nothing but values'}.",
        "", "[model]", extends(model.path.resolve()), f"name = {toml(model.name + '_extended')}",
        f"sample_time = {toml(f'{model.sample_time:.12g} s')}", "",
    ]  # fmt: skip
    for title, entries in (
        ("parameters", [*parameters, *driven["parameters"]]), ("actuators", driven["actuators"]), ("elements", [*driven["elements"], *elements]),
        ("equations", driven["equations"]), ("outputs", outputs), ("sensors", [f"{s.name} = {table({**x, 'noise': s.noise / units.factor(s.unit)})}" for s, x in zip(model.sensors, sensors) if x]),
    ):  # fmt: skip
        if entries:
            lines += [f"[{title}]", *entries, ""]
    return Applied("\n".join(lines), tuple(left))


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
    model: Model, j: int, expression: str, values: dict[str, float], offsets: Collection[str], limits: Mapping[int, float],
    parameters: list[str],
) -> dict[str, object]:  # fmt: skip
    """What a sensor that measures otherwise has as its value and unit; nothing for one that does not."""
    s, unit = model.sensors[j], units.si(model.sensors[j].unit)
    if scale(s.name) in values:
        parameters.append(f"gain_{s.name} = {table({'value': values[scale(s.name)], 'unit': '1'})}")
        expression = f"gain_{s.name}*({expression})"
    if s.name in offsets:
        parameters.append(f"bias_{s.name} = {table({'value': values[bias(s.name)], 'unit': unit})}")
        expression = f"{expression} + bias_{s.name}"
    if j in limits:
        parameters.append(f"limit_{s.name} = {table({'value': limits[j], 'unit': unit})}")
        expression = f"min(max({expression}, -limit_{s.name}), limit_{s.name})"
    if expression == s.expression:
        return {}
    return {"value": expression, "unit": s.unit}


SAMPLED = ("input_delay", "input_added")  # laws of samples: gains and lags go behind them


def _driven(model: Model, fit: Fit, terms: Sequence[Term]) -> tuple[dict[str, list[str]], list[str]]:
    """What terms of inputs add to a model file, those of one input in a row, and what they cannot."""
    found: dict[str, list[str]] = {"parameters": [], "actuators": [], "elements": [], "equations": []}
    left: list[str] = []
    own = sorted((t for t in terms if t.form.how.startswith("input_")), key=lambda t: t.form.how not in SAMPLED)
    for name in dict.fromkeys(t.form.where for t in own):
        acts = name
        for t in (t for t in own if t.form.where == name and t.form.how != "input_offset"):
            acts = _actuator(model, t, fit.value(t.free[0].target), acts, found, left)
        offsets = [t for t in own if t.form.where == name and t.form.how == "input_offset"]
        if offsets and _places(model, name):
            left.append(_uncorrected(offsets[0]))
        elif offsets:
            value, unit = fit.value(offsets[0].free[0].target), units.si(next(i.unit for i in model.inputs if i.name == name))
            found["parameters"].append(f"{name}_offset = {table({'value': value, 'unit': unit})}")
            acts = f"({acts} + {name}_offset)"
        if acts != name:
            _redirected(model, name, acts, found)
    return found, left


def _actuator(model: Model, t: Term, value: float, source: str, found: dict[str, list[str]], left: list[str]) -> str:
    """Adds what a term makes of a signal; the name of that, or of the signal itself where the model file has no law for it."""
    name, acts = t.form.where, f"{source}_acts"
    samples = round((t.form.series.period if t.form.series else value) / model.sample_time)
    law: dict[str, object] = {}
    match t.form.how:
        case "input_gain":
            law = {"law": "gain", "gain": f"{name}_gain"}
            found["parameters"].append(f"{name}_gain = {table({'value': 1.0 + value, 'unit': '1'})}")
        case "input_lag":
            law = {"law": "lag", "time": f"{name}_lag"}
            found["parameters"].append(f"{name}_lag = {table({'value': value, 'unit': 's'})}")
        case "input_delay" if samples < 1:
            left.append(_uncorrected(t))
            return source
        case _:
            law = {"law": "held" if t.form.series else "delay", "samples": max(samples, 1)}
    found["actuators"].append(f"{acts} = {table({'input': source, **law})}")
    return acts


def _uncorrected(t: Term) -> str:
    return f"{t.form.how} of {t.form.where}: a recording has to be corrected, the model file has no law for it"


def _places(model: Model, name: str) -> bool:
    """Is an input a position to which elements are tied, rather than a part of expressions?"""
    return any(name in e.ends for e in model.elements) or any(re.search(rf"\b{name}\b", p.text) for p in model.points)


def _redirected(model: Model, name: str, acts: str, found: dict[str, list[str]]) -> None:
    """Adds the elements and equations on which an input acts, with what an actuator makes of it instead."""
    for e in model.elements:
        ends = tuple(acts if x == name else x for x in e.ends)
        text = re.sub(rf"\b{name}\b", acts, e.expression)
        if ends != e.ends or text != e.expression:
            entry = _element(Element(e.name, ends, e.law, e.arguments, e.network, e.network_inputs, text), lambda x: x)
            found["elements"].append(f"{e.name} = {table(entry)}")
    for q in model.equations:
        text = re.sub(rf"\b{name}\b", acts, q.text)
        if text != q.text:
            found["equations"].append(f"{q.name} = {toml(text)}")
