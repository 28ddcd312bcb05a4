# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The model as seen by a diagnosis: places where a force may be missing, and the linearised way from there to the sensors.

A place is a pair of ends between which at least one element acts, or a body and ground. A force that is missing at a place
is seen by every sensor through a transfer function, whatever its law; so hypotheses about laws need no simulation each.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen import laws
from penode_gen.algebra import mechanics
from penode_gen.model import GROUND, Element, Input, Model, Parameter, Signal, State
from penode_gen.sets import fold

from .compiling import functions

Array = NDArray[np.float64]
KEPT = 32  # results that are kept, one to three for each recording: transfers, spectra, inputs


@dataclass(frozen=True)
class Place:
    """Ends between which a force may act. `elements` act there already, each with its sense; `role` says what may be
    found there: "force" (any element), "tyre" (a wheel on a measured road), or "body" (nothing acts there yet)."""

    ends: tuple[str, str]
    elements: tuple[tuple[str, int], ...]
    role: str
    trained: tuple[tuple[str, str, float, float, bool], ...] = ()  # element, "s" or "v", range of its network, if it is stated
    turns: bool = False
    lacks: tuple[str, ...] = ()  # laws, of a spring and of a damper that are straight lines, that no element there has
    damper: str = ""  # the first element that is a damper or a friction, if any is

    @property
    def name(self) -> str:
        """What a report calls it: its first element, or the body."""
        return self.elements[0][0] if self.elements else self.ends[0]

    @property
    def loss(self) -> str:
        """What a report calls it where damping or friction is meant: the first element that is one, if any is."""
        return self.damper or self.name

    def unit(self, of_length: str) -> str:
        """A unit of the force there: `of_length`, or the rotational one where the ends turn."""
        return laws.for_angles(of_length) if self.turns else of_length


def places(model: Model, set_name: str = "default") -> tuple[Place, ...]:
    """All places of a model, those with elements first; ranges of networks are those of a set."""
    found: dict[tuple[str, str], list[tuple[str, int]]] = {}
    for e in model.elements:
        if not external(model, e):
            back = e.ends[::-1]
            key, sense = (back, -1) if back in found else (e.ends, 1)
            found.setdefault(key, []).append((e.name, sense))
    inputs, moved = {i.name for i in model.inputs}, moving_ends(model)
    carried = {end for ends in found if set(ends) <= moved for end in ends}
    result = []
    for ends, elements in found.items():
        turns = mechanics.rotational(model, ends)
        tyre = bool(set(ends) & inputs) and bool(set(ends) & carried) and not turns
        own = [e for e in model.elements if any(e.name == name for name, _ in elements)]
        trained = tuple(entry for e in own if e.network for entry in _trained(model, e, set_name))
        lacks = () if tyre else _lacking(model, own)
        damper = next((e.name for e in own if _dissipates(model, e)), "")
        result.append(Place(ends, tuple(elements), "tyre" if tyre else "force", trained, turns, lacks, damper))
    known = {frozenset(p.ends) for p in result}
    result += [Place((b.name, GROUND), (), "body", (), b.rotational) for b in model.bodies if frozenset((b.name, GROUND)) not in known]
    return tuple(result)


def _lacking(model: Model, elements: Sequence[Element]) -> tuple[str, ...]:
    """The laws of lines that none of the elements of a place has, nor an expression or a network that may be one."""
    words = {word for e in elements if e.law not in laws.LAWS for word in _words(e)}
    learnt = any(e.network for e in elements)
    lines = zip(("linear_spring", "linear_damper"), _ways(model), strict=True)
    return tuple(law for law, names in lines if not learnt and not names & words and all(e.law != law for e in elements))


def _dissipates(model: Model, e: Element) -> bool:
    """Is an element a damper or a friction: does its force depend on the rate of its ends, and not on their deflection?"""
    deflections, rates = _ways(model)
    words = _words(e)
    return bool(words & rates) and not words & deflections


def _ways(model: Model) -> tuple[set[str], set[str]]:
    """What a law calls a deflection, and a rate."""
    return {"s", *(b.position for b in model.bodies)}, {"v", *(b.velocity for b in model.bodies)}


def _words(e: Element) -> set[str]:
    """Names in the force of an element, s and v without that of the element."""
    if e.network:
        return {{"deflection": "s", "rate": "v"}.get(name, name) for name in e.network_inputs}
    words = set(re.findall(r"\w+", laws.LAWS[e.law].force if e.law in laws.LAWS else e.expression))
    return words | {word[0] for word in words if word in (f"s_{e.name}", f"v_{e.name}")}


def placeless(found: Sequence[Place]) -> str:
    """A note on a model in which no force can be missing; empty for others."""
    return "" if found else "the model has no elements and no bodies: causes are looked for in its parameters and sensors"


def moving_ends(model: Model) -> set[str]:
    """Bodies, and the points that move with any."""
    return {b.name for b in model.bodies} | {p.name for p in model.points if mechanics.place_of(p, model)}


def _trained(model: Model, e: Element, set_name: str) -> list[tuple[str, str, float, float, bool]]:
    """Where its network was trained; if it does not say, where eight tenths of its kinks are: it is straight beyond them."""
    network = model.sets[set_name].networks[e.network]
    low, high, stated = network.input_min, network.input_max, True
    if low is None or high is None:
        if not fold.foldable(network) or len(kinks := fold.kinks(network)) < 3:
            return []
        (low, high), stated = np.quantile(kinks, (0.1, 0.9))[:, None], False
    ranges = zip(e.network_inputs, low, high, strict=True)
    return [(e.name, "s" if what == "deflection" else "v", float(low), float(high), stated) for what, low, high in ranges]


def external(model: Model, e: Element) -> bool:
    """A measured force that is put on a body: an expression without deflection or rate, and without any state."""
    moves = "|".join(["[sv]", r"[sv]_\w+", *map(re.escape, model.states)])
    return e.law == "expression" and not re.search(rf"\b({moves})\b", e.expression)


def extend(model: Model, elements: Sequence[Element], parameters: Mapping[str, tuple[float, str]], where: Sequence[Place] = ()) -> Model:
    """The model with more elements; units of `parameters` are those of elements that move along a line. What measures the force at
    a place then measures theirs as well."""
    elements = [_told_apart(model, e) for e in elements]
    sensors, outputs = model.sensors, model.outputs
    for e, place in zip(elements, where, strict=False):  # `where` may be left out
        sensors, outputs = (tuple(_share(s, e.name, place) for s in signals) for signals in (sensors, outputs))
    states = tuple(
        State(e.state(name), mechanics.unit(model, e.ends, state.unit))
        for e in elements
        for name, state in (laws.LAWS[e.law].states.items() if e.law in laws.LAWS else ())
    )
    turning = tuple(f"{e.name}_" for e in elements if mechanics.rotational(model, e.ends))
    values = {
        name: Parameter(name, value, laws.for_angles(unit) if name.startswith(turning) else unit)
        for name, (value, unit) in parameters.items()
    }
    return replace(
        model,
        elements=(*model.elements, *elements),
        parameters={**model.parameters, **values},
        sensors=sensors,
        outputs=outputs,
        extra_states=(*model.extra_states, *states),
    )


def _told_apart(model: Model, e: Element) -> Element:
    """An element whose expression has s_NAME and v_NAME for s and v where the model has others of that name."""
    taken = {*model.states, *model.parameters, *(x.name for x in model.inputs), *(x.name for x in model.variables)} & {"s", "v"}
    return replace(e, expression=re.sub(r"\b[sv]\b", lambda m: f"{m[0]}_{e.name}" if m[0] in taken else m[0], e.expression))


def _share(signal: Signal, new: str, place: Place) -> Signal:
    """A signal that mentions the force of an element of the place gets that of the new element beside it."""
    for name, sense in place.elements:
        pattern = rf"\bF_{name}\b"
        if re.search(pattern, signal.expression):
            both = f"(F_{name} {'+' if sense > 0 else '-'} F_{new})"
            return replace(signal, expression=re.sub(pattern, both, signal.expression, count=1))
    return signal


def rotational_unit(model: Model, ends: tuple[str, str], of_length: str) -> str:
    """A unit of the force between two ends: `of_length`, or the rotational one where they turn."""
    return mechanics.unit(model, ends, of_length)


def anonymous(model: Model) -> Model:
    """The same equations under a common name: models of one structure then share one compiled library."""
    return replace(model, name="plant", description="", path=Path("plant.toml"), digest="0" * 16)


@dataclass(frozen=True, eq=False)
class Linear:
    """The model linearised: dx = a x + b w + b1 dw, y = c x + d w + d1 dw; w holds the inputs, then a force for each
    place; y holds the sensors, then deflection and rate of each place."""

    a: Array
    b: Array
    b1: Array
    c: Array
    d: Array
    d1: Array
    n_inputs: int
    n_sensors: int

    def transfer(self, f: Array) -> NDArray[np.complex128]:
        """Responses [f, y, w] at frequencies [Hz]. The last few are kept: not to be written to."""
        key = f.tobytes()
        if key not in self._kept:
            jw = 2j * np.pi * f[:, None, None]
            inner = np.linalg.solve(self._pencil(f), self.b + jw * self.b1) if len(self.a) else 0.0
            found = (self.c @ inner if len(self.a) else 0.0) + self.d + jw * self.d1
            found.flags.writeable = False
            if len(self._kept) == KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = found
        return self._kept[key]

    @cached_property
    def _kept(self) -> dict[bytes, NDArray[np.complex128]]:
        return {}

    def _pencil(self, f: Array) -> NDArray[np.complex128]:
        n = len(self.a)
        jw = 2j * np.pi * np.maximum(f, 1e-4)[:, None, None]  # a plant without a spring to ground drifts at 0 Hz
        return jw * np.eye(n) - self.a

    @cached_property
    def fastest(self) -> float:
        """The highest natural frequency [Hz], 0 without states."""
        return float(np.max(np.abs(np.linalg.eigvals(self.a)), initial=0.0) / (2.0 * np.pi))

    @cached_property
    def beside_drift(self) -> float:
        """The lowest frequency [Hz] at which a plant swings that drifts too, for nothing brings one of its motions back; 0 for others."""
        modes = np.linalg.eigvals(self.a)
        size = np.abs(modes)
        drifts = np.isclose(size, 0.0, atol=1e-6 * np.max(size, initial=0.0))  # without any damping two that are nearly zero, and complex
        swings = (np.abs(modes.imag) > np.abs(modes.real)) & ~drifts
        return float(np.min(size[swings]) / (2.0 * np.pi)) if drifts.any() and swings.any() else 0.0


def linearise(model: Model, found: Sequence[Place], x: Array, u: Array) -> Linear:
    """Mean slopes of the model along states x [n, n_x] and inputs u [n, n_u]."""
    forces = [Element(f"probe{k}", p.ends, "expression", expression=f"at{k}") for k, p in enumerate(found)]
    probed = extend(model, forces, {}, found)
    seen = [Signal(f"{q}_probe{k}", f"{q}_probe{k}", p.unit(unit)) for k, p in enumerate(found) for q, unit in (("s", "m"), ("v", "m/s"))]
    probed = replace(
        probed,
        interpolation="linear",
        inputs=(*model.inputs, *(Input(f"at{k}", p.unit("N")) for k, p in enumerate(found))),
        sensors=(*probed.sensors, *seen),
    )
    system = functions(probed)
    n_x, n_w = len(probed.states), len(probed.inputs)
    step = np.concatenate(
        [1e-4 * np.maximum(np.ptp(x, axis=0), 1e-3), 1e-4 * np.maximum(np.ptp(u, axis=0), 1e-3), np.ones(len(found)), np.ones(n_w)]
    )

    def value(point: Array) -> Array:
        parts = point[:n_x], point[n_x : n_x + n_w], point[n_x + n_w :]
        return np.concatenate([system.rates(*parts), system.sensors(*parts)])

    slopes = []
    for state, drive in zip(x, u, strict=True):
        centre = np.concatenate([state, drive, np.zeros(len(found) + n_w)])
        moves = np.diag(step)
        slopes.append(np.stack([(value(centre + m) - value(centre - m)) / (2.0 * h) for m, h in zip(moves, step, strict=True)], axis=1))
    mean = np.mean(slopes, axis=0)
    top, low = mean[:n_x], mean[n_x:]
    return Linear(
        top[:, :n_x],
        top[:, n_x : n_x + n_w],
        top[:, n_x + n_w :],
        low[:, :n_x],
        low[:, n_x : n_x + n_w],
        low[:, n_x + n_w :],
        len(model.inputs),
        len(model.sensors),
    )
