# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Mechanisms on one axis each: where the ends of elements are, what forces act there, and how they move the bodies.

An end is a body, an input, a state, ground, or a point: a linear combination of positions with parameters as coefficients. A force on a
point acts on each body with the body's coefficient in it (virtual work), so a lever, a gear or a pitching body needs no law of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import sympy as sp

from .. import units
from ..laws import LAWS, for_angles
from ..model import GROUND, Body, Element, Input, Model, Point, Sampled, State
from . import expressions as ex

Motion = tuple[sp.Expr, sp.Expr]  # position and rate of an end
Parse = Callable[[tuple[str, ...], str, set[str]], sp.Expr]  # where, text, names beside those of the model


@dataclass(frozen=True)
class Relation:
    """An equation of the model, and where its file says it."""

    where: tuple[str, ...]
    left: sp.Expr
    right: sp.Expr
    comment: str = ""

    @property
    def residual(self) -> sp.Expr:
        return self.left - self.right


def turns(model: Model, end: str) -> bool:
    """Is an end measured as an angle?"""
    things: tuple[Body | Point | Input | Sampled | State, ...] = (*model.bodies, *model.points, *model.drives, *model.extra_states)
    for thing in things:
        if thing.name == end:
            return thing.rotational if isinstance(thing, Body) else not units.same_dimension(thing.unit, "m")
    return False


def rotational(model: Model, ends: tuple[str, str]) -> bool:
    """Do elements between these ends turn? Then deflections are in rad and forces are torques."""
    return any(turns(model, end) for end in ends)


def unit(model: Model, ends: tuple[str, str], of_length: str) -> str:
    """A unit of elements between these ends: `of_length` as it is, or what stands for it where they turn."""
    return for_angles(of_length) if rotational(model, ends) else of_length


def state_unit(model: Model, state: str) -> str:
    """The SI unit of a state."""
    for b in model.bodies:
        if state in (b.position, b.velocity):
            return b.unit if state == b.position else f"{b.unit}/s"
    return next(units.si(s.unit) for s in model.extra_states if s.name == state)


def combination(text: str, moving: dict[str, Motion], parameters: set[str]) -> Motion:
    """Position and rate of a point. Raises ExpressionError where it is no linear combination of positions."""
    found = ex.parse(text, {*moving, *parameters}, {})
    symbols = {name: ex.symbol(name) for name in moving}
    parts = {name: sp.diff(found, s) for name, s in symbols.items() if found.has(s)}
    rest = sp.expand(found - sp.Add(*(c * symbols[name] for name, c in parts.items())))
    if not parts or rest != 0 or any(c.has(*symbols.values()) for c in parts.values()):
        raise ex.ExpressionError(f"'{text}' is not a linear combination of positions")
    return tuple(sp.Add(*(c * moving[name][k] for name, c in parts.items())) for k in (0, 1))


def motions(model: Model) -> dict[str, Motion]:
    """Position and rate of every end of a checked model."""
    names = [*(i.name for i in model.drives), *(s.name for s in model.extra_states)]
    named: dict[str, Motion] = {name: (ex.symbol(name), ex.derivative(name)) for name in names}
    named |= {b.position: (ex.symbol(b.position), ex.symbol(b.velocity)) for b in model.bodies}
    for p in model.points:
        named[p.name] = combination(p.text, named, set(model.parameters))
    ends = {b.name: named[b.position] for b in model.bodies}
    return named | ends | {GROUND: (sp.Integer(0), sp.Integer(0))}


def kinematics(model: Model) -> tuple[list[Relation], dict[str, str]]:
    """Deflection and rate of each element, and the unit of every name of the model."""
    ends = motions(model)
    found = []
    unit_of = {p.name: p.unit for p in model.parameters.values()} | {i.name: i.unit for i in model.drives}
    unit_of |= {b.position: b.unit for b in model.bodies} | {b.velocity: f"{b.unit}/s" for b in model.bodies}
    unit_of |= {s.name: s.unit for s in model.extra_states} | {v.name: v.unit for v in model.variables}
    unit_of |= {p.name: p.unit for p in model.points}
    for e in model.elements:
        (z_a, v_a), (z_b, v_b) = (ends.get(end, ends[GROUND]) for end in e.ends)
        between = f"of {e.name}" if e.ends[1] == GROUND else f"between {e.ends[0]} and {e.ends[1]}"
        found.append(Relation(("elements", e.name), ex.symbol(f"s_{e.name}"), z_a - z_b, f"deflection {between}"))
        found.append(Relation(("elements", e.name), ex.symbol(f"v_{e.name}"), v_a - v_b, f"rate {between}"))
        length, force = unit(model, e.ends, "m"), unit(model, e.ends, "N")
        unit_of |= {f"s_{e.name}": length, f"v_{e.name}": f"{length}/s", f"F_{e.name}": force}
    return found, unit_of


def shared_ends(model: Model) -> dict[str, str]:
    """Element -> the first element between the same ends, whose deflection and rate it shares."""
    first: dict[tuple[str, str], str] = {}
    return {e.name: first.setdefault(e.ends, e.name) for e in model.elements}


def aliases(model: Model) -> dict[sp.Symbol, sp.Symbol]:
    """Deflection and rate of an element -> those of the first between the same ends."""
    shared = shared_ends(model)
    pairs = {f"{k}_{e.name}": f"{k}_{shared[e.name]}" for e in model.elements for k in "sv"}
    return {ex.symbol(a): ex.symbol(b) for a, b in pairs.items() if a != b}


def meanings(model: Model) -> dict[sp.Symbol, sp.Expr]:
    """What names of a model file stand for: shared deflections, rates of positions, and points."""
    meant: dict[sp.Symbol, sp.Expr] = dict(aliases(model))
    meant |= {ex.derivative(b.position): ex.symbol(b.velocity) for b in model.bodies}
    ends = motions(model) if model.points else {}
    for p in model.points:
        meant |= {ex.symbol(p.name): ends[p.name][0], ex.derivative(p.name): ends[p.name][1]}
    return meant


def forces(model: Model, parse: Parse, names: set[str], problem: Callable[[tuple[str, ...], str, str], None]) -> Iterator[Relation]:
    """The force of each element, and the rates of the states that its law brings along."""
    shared = shared_ends(model)
    for e in model.elements:
        s, v = (ex.symbol(f"{k}_{shared[e.name]}") for k in "sv")
        force = ex.symbol(f"F_{e.name}")
        if e.law == "network":
            kinds = {"deflection": s, "rate": v}
            call = ex.network(e.network)(*(kinds.get(k, s) for k in e.network_inputs))
            yield Relation(("elements", e.name), force, call, f"force of {e.name}: network {e.network}")
        else:
            yield from _law(e, force, s, v, parse, names, problem)


def _law(
    e: Element,
    force: sp.Symbol,
    s: sp.Symbol,
    v: sp.Symbol,
    parse: Parse,
    names: set[str],
    problem: Callable[[tuple[str, ...], str, str], None],
) -> Iterator[Relation]:
    """Force and rates of an element with a named law or an expression."""
    where = ("elements", e.name)
    text = e.expression if e.law == "expression" else LAWS[e.law].force
    own = LAWS[e.law].states if e.law in LAWS else {}
    meant = {"s": s, "v": v} | {k: ex.symbol(p) for k, p in e.arguments.items()}
    meant |= {k: ex.symbol(e.state(k)) for k in own}
    swap = frozenset((ex.symbol(k), to) for k, to in meant.items())
    value = parse(where, text, set(meant))
    for name, state in own.items():
        rate = _renamed(parse(where, state.rate, set(meant)), swap)
        yield Relation(where, ex.derivative(e.state(name)), rate, f"{name} of {e.name}")
    if e.law == "expression":
        for name in sorted({"s", "v"} & names & {a.name for a in value.free_symbols}):
            what = f"'{name}' is the {'deflection' if name == 's' else 'rate'} of this element, and a name of the model"
            problem(where, what, f"write {name}_{e.name} for the element's, or rename the other")
    yield Relation(where, force, _renamed(value, swap), f"force of {e.name}")


@lru_cache(maxsize=1024)  # a diagnosis makes models with the same laws at the same elements again and again
def _renamed(expr: sp.Expr, names: frozenset[tuple[sp.Symbol, sp.Symbol]]) -> sp.Expr:
    """An expression with other names for its symbols."""
    return expr.xreplace(dict(names))


def balances(model: Model) -> Iterator[Relation]:
    """Newton's law of each body. A pulling force acts down on the first end and up on the second, by the body's coefficient there."""
    ends = motions(model)
    reach = {e.name: ends.get(e.ends[1], ends[GROUND])[0] - ends.get(e.ends[0], ends[GROUND])[0] for e in model.elements}
    for b in model.bodies:
        position = ex.symbol(b.position)
        pull = sp.Add(*(sp.diff(reach[e.name], position) * ex.symbol(f"F_{e.name}") for e in model.elements))
        yield Relation(("bodies", b.name), ex.derivative(b.velocity), pull / ex.symbol(b.mass), f"acceleration of {b.name}")


def place_of(point: Point, model: Model) -> set[str]:
    """The bodies that a point moves with."""
    position = motions(model)[point.name][0]
    return {b.name for b in model.bodies if position.has(ex.symbol(b.position))}
