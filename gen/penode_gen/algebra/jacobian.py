"""Exact derivatives of straight-line code by the chain rule, through networks whose slopes are symbols of their own."""

from __future__ import annotations

from functools import cached_property, lru_cache

import sympy as sp

from . import expressions as ex
from .causalise import Causal, Step


class Derivatives:
    """
    Derivatives of expressions of a causal model. `slopes` maps a network call's target to one symbol per input, `seconds`
    to one symbol per pair of inputs: its second derivatives. Networks in `straight` have none.
    """

    def __init__(self, causal: Causal, straight: frozenset[str] = frozenset()):
        self._causal = causal
        self._kinematics = {ex.derivative(q.name): v for q, v in causal.kinematics.items()}
        self.slopes: dict[sp.Symbol, tuple[sp.Symbol, ...]] = {
            step.target: tuple(ex.symbol(f"slope_{i + 1}_{step.target.name}") for i in range(len(step.arguments)))
            for step in causal.steps
            if step.network
        }
        self.slopes = {t: (ex.symbol(f"slope_{t.name}"),) if len(s) == 1 else s for t, s in self.slopes.items()}
        self.seconds: dict[sp.Symbol, list[list[sp.Symbol]]] = {
            t: [[ex.symbol(f"second_{min(i, j) + 1}{max(i, j) + 1}_{t.name}") for j in range(len(s))] for i in range(len(s))]
            for t, s in self.slopes.items()
            if self._steps[t].network not in straight
        }
        self._slope_of = {s: (t, i) for t, group in self.slopes.items() for i, s in enumerate(group)}

    def of(self, results: tuple[sp.Expr, ...], variables: tuple[sp.Symbol, ...]) -> list[list[sp.Expr]]:
        """Jacobian [results][variables], in terms of states, inputs, step targets and slopes."""
        return [[self.total(r, v) for v in variables] for r in results]

    def total(self, expr: sp.Expr, variable: sp.Symbol) -> sp.Expr:
        """d expr / d variable, through all steps."""
        expr = expr.subs(self._kinematics)
        found = _tidy(expr.diff(variable))
        for symbol in sorted(expr.free_symbols & set(self._steps), key=lambda s: s.name):
            found += _tidy(expr.diff(symbol)) * self._step(symbol, variable)
        for symbol in sorted(expr.free_symbols & set(self._slope_of), key=lambda s: s.name):
            target, i = self._slope_of[symbol]
            if target not in self.seconds:  # the slope of a straight network does not change
                continue
            for second, argument in zip(self.seconds[target][i], self._steps[target].arguments, strict=True):
                found += expr.diff(symbol) * second * self.total(argument, variable)
        return _factored(found) if found.is_Add else found

    def curvature(
        self, results: tuple[sp.Expr, ...], states: tuple[sp.Symbol, ...], drive: tuple[sp.Symbol, ...]
    ) -> tuple[list[list[sp.Expr]], list[list[sp.Expr]]]:
        """
        Derivatives along states and drive of (d results / d states) kx + (d results / d drive) ku, with the vectors
        kx, ku given as symbols kx[i], ku[i]. Zero where everything is piecewise linear.
        """
        kx = [ex.symbol(f"kx[{i}]") for i in range(len(states))]
        ku = [ex.symbol(f"ku[{i}]") for i in range(len(drive))]
        along = [
            sum((a * k for a, k in zip(row_x + row_u, kx + ku, strict=True)), sp.Integer(0))
            for row_x, row_u in zip(self.of(results, states), self.of(results, drive), strict=True)
        ]
        return [[self.total(g, v) for v in states] for g in along], [[self.total(g, v) for v in drive] for g in along]

    @cached_property
    def _steps(self) -> dict[sp.Symbol, Step]:
        return {step.target: step for step in self._causal.steps}

    @cached_property
    def _known(self) -> dict[tuple[sp.Symbol, sp.Symbol], sp.Expr]:
        return {}

    def _step(self, target: sp.Symbol, variable: sp.Symbol) -> sp.Expr:
        key = (target, variable)
        if key not in self._known:
            step = self._steps[target]
            if step.network:
                parts = [s * self.total(a, variable) for s, a in zip(self.slopes[target], step.arguments, strict=True)]
                self._known[key] = sp.Add(*parts)
            else:
                self._known[key] = self.total(step.value, variable)
        return self._known[key]


@lru_cache(maxsize=4096)  # a half-car has 700 such sums
def _factored(expr: sp.Expr) -> sp.Expr:
    """Factors out what the terms of a sum share. Kept, because models that differ in an option or one law have most sums in common."""
    return sp.factor_terms(expr)


def _tidy(expr: sp.Expr) -> sp.Expr:
    """Derivatives of kinks are kinks: no Dirac pulses."""
    return expr.replace(sp.DiracDelta, lambda *a: sp.Integer(0))
