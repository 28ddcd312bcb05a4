# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forms of causes as terms of a model: elements, free values, and their fitted values."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.laws import LAWS
from penode_gen.model import Element, Model

from ..catalogue.actuators import ACTUATORS, Drive
from ..catalogue.form import Form, Motion, Part
from ..evidence.bench import UPDATES, Bench
from ..evidence.fit import Fit
from ..evidence.gain import Level
from ..evidence.observer import scale
from ..plant.plant import extend
from ..study.fit import Free
from . import clipping

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Term:
    """A form in a model: its elements there, one for each part, and its free values."""

    form: Form
    elements: tuple[str, ...]
    free: tuple[Free, ...]

    def laws(self, values: Mapping[str, float]) -> list[tuple[float, Part]]:
        """Its laws as they are fitted, each with its gain."""
        found = []
        for name, part in zip(self.elements, self.form.parts, strict=True):
            shapes = {k: (values.get(f"{name}_{k}", v), unit) for k, (v, unit) in part.shapes.items()}
            gain = values.get(*part.own) if part.own else values.get(f"{name}_{part.gain[0]}", 0.0)
            found.append((gain, replace(part, shapes=shapes)))
        return found


@dataclass(frozen=True, eq=False)
class Trial:
    """A form beside those accepted, fitted: `gain` of the criterion; `share` of the force there (see `worth`); `taken`, the share of
    a sensor's innovation power beyond its noise that it explains, of the sensor that shows it most; `whole`, that share over all sensors
    together; `run`: log likelihood of its free run, where one was made; `blocks` [blocks] of predictive density, none before it is scored;
    `model`: that of the fit, with this form and those accepted."""

    form: Form
    term: Term
    fit: Fit
    gain: float
    level: Level
    model: Model
    share: float = 0.0
    taken: float = 0.0
    whole: float = 0.0
    run: float = -np.inf
    blocks: Array = field(default_factory=lambda: np.zeros(0))


def drive(bench: Bench, index: int) -> Drive:
    """An input as the bench's recordings have it."""
    update = bench.update * bench.step
    return Drive([r.u[:, index] for r in bench.records], bench.step, update, UPDATES * update)


def moves(bench: Bench, index: int) -> bool:
    """Does an input change in any recording?"""
    return any(np.ptp(r.u[:, index]) > 0.0 for r in bench.records)


def free_of(bench: Bench, form: Form) -> tuple[Free, ...]:
    """The value of a form of an input or a sensor."""
    step = bench.update * bench.step
    match form.how:
        case "input_added" if form.series:
            return (Free(("input_added", form.index, form.series), 0.0, 0.1, sigma=1.0, low=0.0, high=1.2),)
        case "scale":
            return (Free(scale(form.where), 1.0, 0.01, sigma=0.3, origin=1.0),)
        case "late" | "lag":
            return (Free((form.how, form.index), 0.0, 0.1 * step, sigma=step, low=0.0),)
    v = ACTUATORS[form.how].fitted(drive(bench, form.index))
    return (Free((form.how, form.index), form.limit or v.start, v.unit, sigma=v.sigma, low=v.low, high=v.high),)


def with_forms(bench: Bench, forms: Sequence[Form], moved: Sequence[Motion], first: int) -> tuple[Model, list[Term]]:
    """The model with all forms in it, each without any force yet, and their terms."""
    elements, where, parameters, terms, model = [], [], {}, [], bench.model
    for i, form in enumerate(forms):
        if form.how == "clip":
            model, values = clipping.limited(model, form, f"x{first}_{i}", clipping.least(bench, form.index))
            terms.append(Term(form, (), values))
            continue
        if form.how != "force":
            terms.append(Term(form, (), free_of(bench, form)))
            continue
        free: list[Free] = []
        place, names = bench.places[form.index], []
        for j, part in enumerate(form.parts):
            name = f"x{first}_{i}_{j}"
            own = {**({} if part.own else {part.gain[0]: (0.0, part.gain[1])}), **part.shapes}
            parameters.update({f"{name}_{key}": entry for key, entry in own.items()})
            elements.append(element(name, place.ends, part))
            where.append(place)
            names.append(name)
            free += _values(name, part, moved[form.index])
        terms.append(Term(form, tuple(names), tuple(free)))
    return extend(model, elements, parameters, where), terms


def _values(name: str, part: Part, motion: Motion) -> Iterator[Free]:
    """The free values of a part: its gain, and its shapes in their logarithm. Of one that takes all of an element, the first shape is its
    size, 0 where it has no effect."""
    first = part.loose[:1] if part.own else []
    if not part.own:
        size = motion.force / max(rms([part.along(m) for m in motion.parts]), 1e-300)
        low, high = (0.0 if part.sign > 0 else -np.inf), (0.0 if part.sign < 0 else np.inf)
        yield Free(f"{name}_{part.gain[0]}", 0.0, 0.05 * size, sigma=size, low=low, high=high)
    for key in part.loose:
        value, span = part.shapes[key][0], part.rounds if key == part.edge else part.span
        low, high = value / span, span * value
        if key in first:
            yield Free(f"{name}_{key}", value, 0.05 * value, sigma=value, low=low, high=high)
        else:
            yield Free(f"{name}_{key}", value, value, log=True, sigma=1.0, origin=value, low=low, high=high)


def without_any(model: Model, terms: Sequence[Term]) -> Model:
    """The model in which terms that are not fitted have no force: in it gains are 0, and the size of a law that takes all of an element is
    not."""
    sizes = {f"{name}_{p.loose[0]}" for t in terms for name, p in zip(t.elements, t.form.parts, strict=True) if p.own}
    return replace(model, parameters={n: replace(p, value=0.0) if n in sizes else p for n, p in model.parameters.items()})


def whole(bench: Bench, t: Trial) -> Form | None:
    """The form of a trial with laws that take away all of an element, as a play in series with all of a spring does; None if it has others.
    Of a narrow play, only its gap times what it takes is seen, and that stays as it was fitted."""
    near = {n for n, _ in bench.places[t.form.index].elements} if t.form.how == "force" else set()
    parts = []
    for gain, part in t.term.laws(t.fit.values):
        owned = [p for e in bench.base.elements if e.name in near and e.law == part.takes for p in e.arguments.values()]
        if part.own or len(owned) != 1 or gain == 0.0:
            return None
        value, size = bench.base.parameters[owned[0]].value, part.loose[0]
        shapes = {k: (x * abs(gain / value) if k == size else x, unit) for k, (x, unit) in part.shapes.items()}
        parts.append(replace(part, shapes=shapes, own=(owned[0], value)))
    return replace(t.form, parts=tuple(parts)) if parts else None


def element(name: str, ends: tuple[str, str], part: Part) -> Element:
    """A part as an element whose parameters begin with its name."""
    names = {key: f"{name}_{key}" for key in (part.gain[0], *part.shapes)} | ({part.gain[0]: part.own[0]} if part.own else {})
    if part.law in LAWS:
        return Element(name, ends, part.law, {a: names[a] for a in LAWS[part.law].arguments})
    text = re.sub(r"\b(" + "|".join(names) + r")\b", lambda m: names[m[1]], part.law)
    text = re.sub(r"\b([sv])\b", lambda m: f"{m[1]}_{name}", text)
    return Element(name, ends, "expression", expression=re.sub(r"\bload\b", f"abs({part.load})", text))


def rms(series: Sequence[Array]) -> float:
    return float(np.sqrt(np.mean(np.concatenate(list(series)) ** 2)))
