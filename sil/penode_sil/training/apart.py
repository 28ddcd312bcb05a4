# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks beside free parameters that act in the same place: the network takes only what the parameters cannot.

Where a network could do all that a parameter does (a damping, and a network of the same rate between the same ends), recordings show their
sum only. So the network is held orthogonal to the parameter's sensitivity over the visited range: sum of N(x) g(x) = 0 with g = (d f / d
parameter) / (d f / d N), f all rates and signals. The parameter is then the least-squares one of the whole force, and stays what its name
says. Parameters that a network cannot stand for (a mass, a stiffness beside a network of the rate) are left to the recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from penode_gen.algebra import expressions as ex
from penode_gen.algebra.causalise import causalise
from penode_gen.model import Model

from .curve import Curve
from .settings import SETTINGS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Apart:
    """A network (its index among the shapes) and a parameter beside it, whose `sensitivity` is a function of the network's input; `x` [n]:
    where the network has been, means of groups of samples; `g` [n]: the sum of the sensitivities of each group, over `size`."""

    shape: int
    network: str
    parameter: str
    sensitivity: Callable[[Array], Array]
    x: Array
    g: Array
    size: float

    def visited(self, x: Array) -> Apart:
        """The same over another visited range."""
        groups = np.array_split(np.sort(x), min(len(x), 5 * SETTINGS.story_across))
        g = [self.sensitivity(part) for part in groups]
        size = float(np.sqrt(sum(float(part @ part) for part in g) * len(x)))
        return replace(self, x=np.array([part.mean() for part in groups]), g=np.array([part.sum() for part in g]), size=max(size, 1e-300))

    def row(self, curve: Curve) -> Array:
        """The part of a curve along the sensitivity, as RMS force by its free values [columns]."""
        return curve.hats(self.x).T @ self.g / self.size


def find(model: Model, free: Sequence[str], networks: Sequence[str]) -> tuple[Apart, ...]:
    """All pairs of a network of one input that acts once, and a free parameter beside it."""
    causal = causalise(model)
    swap: dict[sp.Basic, sp.Basic] = {ex.derivative(q.name): v for q, v in causal.kinematics.items()}
    calls: list[tuple[str, sp.Symbol, tuple[sp.Expr, ...]]] = []
    shown = (*causal.rates, *causal.sensors, *causal.outputs)
    for step in causal.needed(shown):
        if step.network:
            value = sp.Symbol(f"N{len(calls)}", real=True)
            calls.append((step.network, value, tuple(a.xreplace(swap) for a in step.arguments)))
            swap[step.target] = value
        elif step.value is not None:
            swap[step.target] = step.value.xreplace(swap)
    rates = [r.xreplace(swap) for r in shown]
    numbers = {ex.symbol(n): p.value for n, p in model.parameters.items()}
    found = []
    for name, value, arguments in calls:
        if len(arguments) != 1 or sum(n == name for n, *_ in calls) > 1 or arguments[0].has(*(v for _, v, _ in calls)):
            continue
        by_force = [r.diff(value) for r in rates]
        for parameter in free:
            g = _ratio([r.diff(ex.symbol(parameter)) for r in rates], by_force, [v for _, v, _ in calls])
            if g is None:
                continue
            sensitivity = _along(g.xreplace(numbers), arguments[0].xreplace(numbers), [*causal.states, *causal.inputs, *causal.input_rates])
            if sensitivity is not None:
                begun = Apart(networks.index(name), name, parameter, sensitivity, np.zeros(0), np.zeros(0), 1.0)
                found.append(begun.visited(np.linspace(-1.0, 1.0, SETTINGS.story_across)))
    return tuple(found)


def _ratio(above: Sequence[sp.Expr], below: Sequence[sp.Expr], values: Sequence[sp.Symbol]) -> sp.Expr | None:
    """The factor between two vectors, where there is one that is the same in all places and knows no network."""
    if any(b == 0 and a != 0 for a, b in zip(above, below, strict=True)):
        return None
    pairs = [(a, b) for a, b in zip(above, below, strict=True) if b != 0]
    if not pairs or any(a == 0 for a, _ in pairs) or not _equal(pairs):
        return None
    ratios = [sp.simplify(a / b) for a, b in pairs]
    if any(sp.simplify(r - ratios[0]) != 0 for r in ratios[1:]):
        return None
    return None if ratios[0].has(*values) else ratios[0]


def _equal(pairs: Sequence[tuple[sp.Expr, sp.Expr]]) -> bool:
    """May the ratios of all pairs be equal? Most are not: some numbers in place of the symbols show that at a hundredth of the time of
    algebra."""
    symbols = sorted(set().union(*(v.free_symbols for pair in pairs for v in pair)), key=str)
    numbers = np.random.default_rng(0).uniform(0.5, 1.5, len(symbols))
    found = [complex(sp.N((a / b).subs(dict(zip(symbols, numbers, strict=True))))) for a, b in pairs]
    close = 1e-6  # equal ones differ by rounding only, some 1e-15; NaN, where a law has no value there, tells nothing
    return not any(abs(r - found[0]) > close * abs(found[0]) for r in found[1:])


def _along(g: sp.Expr, argument: sp.Expr, symbols: Sequence[sp.Symbol]) -> Callable[[Array], Array] | None:
    """g as a function of the argument alone; None if it is none, or if the argument is not linear in states and inputs."""
    slopes = [argument.diff(s) for s in symbols]
    if any(s.free_symbols for s in slopes):
        return None
    way = np.array([float(s) for s in slopes])
    rest = float(argument.xreplace({s: sp.Integer(0) for s in symbols}))
    if not way.any():
        return None
    evaluate = sp.lambdify(list(symbols), g, "numpy")

    def found(x: Array) -> Array:
        at = (np.asarray(x, dtype=float)[:, None] - rest) * way / (way @ way)
        return np.broadcast_to(np.asarray(evaluate(*at.T), dtype=float), len(at)).copy()

    places = np.random.default_rng(0).normal(size=(3 + 2 * len(way), len(way)))
    given = found(places @ way + rest)
    close = 1e-9  # functions that differ do so by more than rounding at random states
    same = np.allclose(
        np.broadcast_to(evaluate(*places.T), len(places)), given, rtol=close, atol=close * max(float(np.max(np.abs(given))), 1e-300)
    )
    return found if same else None
