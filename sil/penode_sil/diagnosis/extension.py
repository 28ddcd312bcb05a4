# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The model file with the causes in it."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence

import numpy as np
from numpy.polynomial import Legendre, Polynomial
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.laws import LAWS
from penode_gen.model import Model

from . import late
from .build import Term
from .entries import extends, table, toml, unlike
from .explanation import Explanation
from .faulty import BLUNT
from .hypotheses import VALUED, Basis, Fault, size
from .resolving import resolved
from .result import Cause
from .study import Study

Array = NDArray[np.float64]


def extend_file(study: Study, e: Explanation | None, causes: Sequence[Cause]) -> tuple[str, Model]:
    """Text of model_extended.toml, and the model that it describes."""
    lines = _head(study, e, causes)
    if e is None:
        return resolved(study, "\n".join(lines))
    taken = {*study.model.parameters, *study.model.states, *(x.name for x in study.model.elements), *(s.name for s in study.model.sensors)}
    written = _Written(study, e, causes, taken)
    for j in range(len(study.model.sensors)):
        written.sensor(j)
    written.clock()
    for title, entries in written.sections():
        if entries:
            lines += [f"[{title}]", *entries, ""]
    return resolved(study, "\n".join(lines))


def _head(study: Study, e: Explanation | None, causes: Sequence[Cause]) -> list[str]:
    """Lines on what was learnt, and the section on the model with substeps that its fastest law asks for."""
    model = study.model
    learnt = ", ".join(f"{c.kind} at {c.where or '?'}" for c in causes)
    if e is not None and not e.terms and e.built.model.elements != model.elements:
        learnt = "an effect that no known cause explains; the element nameless approximates it"
    lines = [
        f"# Extension of {model.path.name} from recordings: {learnt or ('nothing' if e is None else 'values within tolerances')}.",
        "",
        "[model]",
        extends(model.path.resolve()),
        f"name = {toml(model.name + '_extended')}",
        f"sample_time = {toml(f'{model.sample_time:.12g} s')}",
        "",
    ]
    if any(c.kind == "integration_error" for c in causes):
        lines[-1:] = ['method = "rk4"', 'input = "linear"', ""]
    if e is not None:
        substeps = max([1, *(_fine(study, t, n, e) for t, n in zip(e.terms, e.built.names, strict=True))])
        values = {f.target: f.value for f in e.fit.free}
        delays = [(k[1], d) for k, d in values.items() if k[0] == "delay" and d > late.SHORT * model.sample_time]
        substeps = max([substeps, *(late.substeps(d, _rolled(values, j), model.sample_time) for j, d in delays)])
        if substeps > model.substeps:
            lines.insert(-1, f"substeps = {substeps}")
    return lines


def _renaming(e: Explanation, taken: Collection[str]) -> dict[str, str]:
    """Names of added elements by what they are for."""
    rename: dict[str, str] = {}
    for term, name in zip(e.terms, e.built.names, strict=True):
        stem = term.candidate.kind.replace("network_extrapolation", "beyond_range")  # network_ is the generator's own
        rename[name] = unlike(stem, {*taken, *rename.values()})
    return rename


class _Written:
    """Entries of the extended file, section by section. `taken`: names of the model file; `rename` gives those of added elements, `age` and
    `recorded` those of the time since the start and of the longest recording."""

    def __init__(self, study: Study, e: Explanation, causes: Sequence[Cause], taken: Collection[str]) -> None:
        self.study, self.e, self.causes, self.taken = study, e, causes, taken
        self.rename, self.age, self.recorded = _renaming(e, taken), unlike("age", taken), unlike("recorded", taken)
        self.values = {f.target: f.value for f in e.fit.free}
        self.parameters = self._parameters()
        self.sensors: list[str] = []
        self.states: list[str] = []
        self.equations: list[str] = []
        self.changed: dict[str, str] = {}  # expressions of sensors that are not what they were

    def named(self, text: str) -> str:
        """Text with the names that elements have in the file."""
        return re.sub(r"\b((?:[Fsv]_)?)(x\d+)(?=_|\b)", lambda m: m[1] + self.rename.get(m[2], m[2]), text)

    def _parameters(self) -> list[str]:
        found = []
        for p in self.e.built.model.parameters.values():
            known = self.study.model.parameters.get(p.name)
            value = self.values.get(p.name, p.value)
            if known is None:
                found.append(f"{self.named(p.name)} = {table({'value': value, 'unit': p.unit})}")
            elif p.name in self.values and value != known.value:
                more = {"tolerance": known.tolerance if np.isfinite(known.tolerance) else "unknown"} if known.tolerance else {}
                more |= {"tunable": True} if known.tunable else {}
                more |= {"description": known.description} if known.description else {}
                found.append(f"{p.name} = {table({'value': value / units.factor(p.unit), 'unit': p.unit, **more})}")
        return found

    def _elements(self) -> list[str]:
        found = []
        for x in self.e.built.model.elements[len(self.study.model.elements) :]:
            entry: dict[str, object] = {"between": x.ends, "law": x.law}
            if x.law == "expression":
                entry["force"] = self.named(x.expression)
            else:
                entry |= {k: self.named(x.arguments[k]) for k in LAWS[x.law].arguments}
            found.append(f"{self.named(x.name)} = {table(entry)}")
        return found

    def sensor(self, j: int) -> None:
        """What sensor j measures, with its faults."""
        s, old, values = self.e.built.model.sensors[j], self.study.model.sensors[j], self.values
        expression, unit, share = self.named(s.expression), units.si(s.unit), f"min({self.age}/{self.recorded}, 1)"
        bent = _bent(self.e, values, j, f"({expression})", s.name, unit, share, self.parameters)
        if bent:
            expression = f"{expression} + {bent}"
        if values.get(("delay", j), 0.0) > late.SHORT * self.study.model.sample_time:
            expression = self._delayed(expression, j)
        if ("scale", j) in values:
            self.parameters.append(f"gain_{s.name} = {table({'value': 1.0 + values[('scale', j)], 'unit': '1'})}")
            expression = f"gain_{s.name}*({expression})"
        if ("bias", j) in values:
            self.parameters.append(f"bias_{s.name} = {table({'value': values[('bias', j)], 'unit': unit})}")
            expression = f"{expression} + bias_{s.name}"
        if drift := _drift(self.e, values, j, s.name, unit, share, self.parameters):
            expression = f"{expression} + {drift}"
        if ("rail", j) in values:
            expression = _railed(expression, values[("rail", j)], values[("sharpness", j)], s.name, unit, self.parameters)
        rails = next((c.parameters for c in self.causes if (c.kind, c.where) == ("sensor_clipping", s.name)), {})
        for side, cut in (("high", "min"), ("low", "max")):
            if side in rails:
                self.parameters.append(f"{side}_{s.name} = {table({'value': rails[side].value, 'unit': unit})}")
                expression = f"{cut}({expression}, {side}_{s.name})"
        if expression != old.expression:
            self.changed[s.name] = expression
            self.sensors.append(f"{s.name} = {table({'value': expression, 'unit': s.unit, 'noise': s.noise / units.factor(s.unit)})}")

    def _delayed(self, expression: str, j: int) -> str:
        """An expression as late as sensor j is."""
        name, unit = self.e.built.model.sensors[j].name, units.si(self.e.built.model.sensors[j].unit)
        names = [unlike(f"{what}_{name}", self.taken) for what in ("delay", "late", "late_rate")]
        found = late.written(expression, names, unit, max(self.values[("delay", j)], 1e-9), _rolled(self.values, j))
        self.parameters.append(found.parameter)
        self.states += found.states
        self.equations += found.equations
        return found.expression

    def clock(self) -> None:
        """The time since the start, where a sensor asks for it."""
        if any(re.search(rf"\b{self.age}\b", expression) for expression in self.changed.values()):
            last = max(float(x.time[-1] - x.time[0]) for x in self.study.experiments)
            self.parameters.append(
                f"{self.recorded} = {table({'value': last, 'unit': 's', 'description': 'the longest recording of the training'})}"
            )
            self.states.append(f"{self.age} = {table({'unit': 's', 'description': 'since the start'})}")
            self.equations.append(f"{self.age} = {toml(f'der({self.age}) = 1')}")

    def sections(self) -> tuple[tuple[str, list[str]], ...]:
        """Titles and entries, in the order of the file."""
        outputs = [
            # one name means one quantity
            f"{s.name} = {table({'value': self.changed.get(s.name, self.named(s.expression)), 'unit': s.unit})}"
            for s, old in zip(self.e.built.model.outputs, self.study.model.outputs, strict=True)
            if s.expression != old.expression or s.name in self.changed
        ]
        return (
            ("parameters", self.parameters),
            ("elements", self._elements()),
            ("states", self.states),
            ("equations", self.equations),
            ("outputs", outputs),
            ("sensors", self.sensors),
        )


def _fine(study: Study, term: Term, name: str, e: Explanation) -> int:
    """Steps a sample, so that none jumps over the presliding of a friction, a relaxation, or the motion of a small mass."""
    what, step = term.candidate.what, study.model.sample_time
    if isinstance(what, tuple):
        m, k, d = (e.fit.value(f"{name}_{key}") for key in ("mass", "stiffness", "damping"))
        return min(int(np.ceil(step * max(d / m, np.sqrt(k / m)))), 100)
    if not isinstance(what, Basis):
        return 1
    if "relaxation" in what.shapes:
        return min(int(np.ceil(step / e.fit.value(f"{name}_relaxation"))), 100)
    if "presliding" not in what.shapes:
        return 1
    speed = size([s.motions[what.place] for s in study.seen])[1]
    return min(int(np.ceil(1.5 * speed * step / e.fit.value(f"{name}_presliding"))), 100)


def _series(e: Explanation, values: dict[object, float], sensor: int) -> list[tuple[Fault, float]]:
    """What faults of a sensor there are beside bias, scale and delay, each with its gain."""
    faults = [t.candidate.what for t in e.terms if isinstance(t.candidate.what, Fault)]
    series = [f for f in faults if f.what not in VALUED]
    return [(f, values[("fault", i)]) for i, f in enumerate(series) if f.sensor == sensor]


def _rolled(values: dict[object, float], sensor: int) -> float:
    """The roll-off of a sensor's signal, of the square of its delay."""
    return values.get(("roll_off", sensor), 0.0) / values[("delay", sensor)] ** 2


def _bent(
    e: Explanation, values: dict[object, float], sensor: int, signal: str, name: str, unit: str, share: str, parameters: list[str]
) -> str:
    """What a scale of two sides, of several pieces, a bent or a drifting one adds to a signal; `share` of the recording is over."""
    parts = []
    bends = [(f.shape, k) for f, k in _series(e, values, sensor) if f.what == "scale_bend"]
    if bends:  # one cube, however many causes share it
        curve = bends[0][0]
        parts.append(f"{sum(k * (curve / shape) ** 2 for shape, k in bends):.7g}*{signal}^3/curve_{name}^2")
        parameters.append(f"curve_{name} = {table({'value': curve, 'unit': unit})}")
    for f, k in _series(e, values, sensor):
        if f.what == "scale_side":
            parts.append(f"{k:.7g}*abs{signal}")
        if f.what == "scale_drift":
            parts.append(f"{k:.7g}*{signal}*({share} - 0.5)")
        if f.what == "clip":
            side, edge = np.sign(f.shape), f"edge_{name}_{len(parts)}"
            parts.append(f"{-side * k:.7g}*max({side:.0f}*{signal} - {edge}, 0)")
            parameters.append(f"{edge} = {table({'value': abs(f.shape), 'unit': unit})}")
    return " + ".join(parts)


def _railed(signal: str, rail: float, sharpness: float, name: str, unit: str, parameters: list[str]) -> str:
    """A signal that comes near its limits smoothly: see `railed`."""
    sharpness = max(sharpness, BLUNT)
    slope = np.tanh(0.5 * sharpness)
    knee, width = f"knee_{name}", f"width_{name}"
    parameters += [f"{key} = {table({'value': x * slope / rail, 'unit': unit})}" for key, x in ((knee, 1.0), (width, 1.0 / sharpness))]
    ends = f"softplus(({signal} - {knee})/{width}) - softplus((-({signal}) - {knee})/{width})"
    return f"({signal} - {width}*({ends}))/{slope:.7g}"


def _drift(e: Explanation, values: dict[object, float], sensor: int, name: str, unit: str, share: str, parameters: list[str]) -> str:
    """What a bias changes by while a recording goes on; after the longest one of the training it stays."""
    own = _series(e, values, sensor)
    slow = sum(
        (k * Legendre.basis(int(f.shape), domain=(0.0, 1.0)) for f, k in own if f.what == "drift"), Legendre([0.0], domain=(0.0, 1.0))
    )
    parts = [
        (c, f"*{share}{f'^{power}' if power > 1 else ''}" if power else "")
        for power, c in enumerate(slow.convert(kind=Polynomial).coef)
        if c
    ]
    parts += [(k, f"*(1 - exp(-{f.shape:.7g}*{share}))") for f, k in own if f.what == "warming"]
    named = [f"drift_{name}_{n}" for n in range(1, len(parts) + 1)]
    parameters += [f"{own} = {table({'value': size, 'unit': unit})}" for own, (size, _) in zip(named, parts, strict=True)]
    return " + ".join(own + shape for own, (_, shape) in zip(named, parts, strict=True))
