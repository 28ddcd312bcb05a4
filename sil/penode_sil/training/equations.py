# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model's rates and sensors as C with their derivatives, for the sensitivities that training needs.

Networks are numbers here, N[call]: how such a number changes with states and weights is the business of engine.c. So this part knows
the physics only, and is the same for every network that stands in a place.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import sympy as sp
from sympy.printing.c import C99CodePrinter

from penode_gen.algebra import expressions as ex
from penode_gen.algebra.causalise import causalise
from penode_gen.model import Model


@dataclass(frozen=True)
class Equations:
    """C of the physics, the network that each call goes to, and its number of inputs."""

    text: str
    calls: tuple[tuple[str, int], ...]


class _Printer(C99CodePrinter):  # type: ignore[misc]  # SymPy has no types
    """C of double, also for the functions that the project keeps whole."""

    def emptyPrinter(self, expr: sp.Basic) -> str:
        raise ValueError(f"no C for {expr.func.__name__} in {expr}")


def _call(name: str) -> Callable[[C99CodePrinter, sp.Expr], str]:
    return lambda self, expr: f"{name}({self._print(expr.args[0])})"


for _kind, _name in {
    "Root": "sqrt",
    "Logarithm": "log",
    "Softplus": "t_softplus",
    "Sigmoid": "t_sigmoid",
    "Sign": "t_sign",
    "Absolute": "fabs",
    "Heaviside": "t_step",
}.items():
    setattr(_Printer, f"_print_{_kind}", _call(_name))


def equations(model: Model, free: Sequence[str]) -> Equations:
    """Rates, sensors and network arguments of a model in C, with derivatives by states, `free` parameters and network outputs."""
    causal = causalise(model)
    signals = (*causal.sensors, *causal.outputs)
    swap: dict[sp.Basic, sp.Basic] = {ex.derivative(q.name): v for q, v in causal.kinematics.items()}
    calls: list[tuple[str, tuple[sp.Expr, ...]]] = []
    for step in causal.needed((*causal.rates, *signals)):
        if step.network:
            calls.append((step.network, tuple(a.xreplace(swap) for a in step.arguments)))
            swap[step.target] = _at("N", len(calls) - 1)
        elif step.value is not None:
            swap[step.target] = step.value.xreplace(swap)
    names = {s: _at("x", i) for i, s in enumerate(causal.states)}
    names |= {s: _at("u", i) for i, s in enumerate(causal.inputs)} | {s: _at("ud", i) for i, s in enumerate(causal.input_rates)}
    names |= {ex.symbol(n): _at("p", i) for i, n in enumerate(model.parameters)}
    x, n = [names[s] for s in causal.states], [_at("N", i) for i in range(len(calls))]
    p = [names[ex.symbol(name)] for name in free]
    flat = {"rates": causal.rates, "sensors": signals} | {f"arguments_{i}": a for i, (_, a) in enumerate(calls)}
    sizes = {"N_X": len(x), "N_F": len(p), "N_N": len(calls), "N_P": len(model.parameters), "N_U": len(causal.inputs), "N_Z": len(signals)}
    parts = [f"#define {name} {size}" for name, size in sizes.items()]
    for name, results in flat.items():
        parts.append(_function(name, [r.xreplace(swap).xreplace(names) for r in results], x, p, n))
    cases = "".join(f"    case {i}: arguments_{i}(x, u, ud, p, N, y, fx, fp, fn); break;\n" for i in range(len(calls)))
    parts.append(
        f"static inline void arguments(int call, {_GIVEN}, {_FOUND})\n{{\n    switch (call) {{\n{cases}    default: break;\n    }}\n}}"
    )
    return Equations("\n\n".join(parts) + "\n", tuple((name, len(a)) for name, a in calls))


_GIVEN = "const double *x, const double *u, const double *ud, const double *p, const double *N"
_FOUND = "double *y, double *fx, double *fp, double *fn"


def _at(name: str, index: int) -> sp.Symbol:
    return sp.Symbol(f"{name}[{index}]", real=True)


def _function(name: str, results: list[sp.Expr], x: list[sp.Symbol], p: list[sp.Symbol], n: list[sp.Symbol]) -> str:
    """A C function that gives results [rows], and their derivatives [rows][.] where fx is not NULL."""
    values = "\n".join(_lines("y", results))
    slopes: list[str] = []
    for target, variables in (("fx", x), ("fp", p), ("fn", n)):
        flat = [_tidy(r.diff(v)) for r in results for v in variables]
        slopes += ["{", *_lines(target, flat), "}"]
    body = f"{values}\n    if (fx != NULL) {{\n" + "\n".join(slopes) + "\n    }"
    unused = " ".join(f"(void){v};" for v in ("x", "u", "ud", "p", "N", "y", "fx", "fp", "fn"))
    return f"static inline void {name}({_GIVEN}, {_FOUND})\n{{\n    {unused}\n{body}\n}}"


def _lines(target: str, results: list[sp.Expr]) -> list[str]:
    printer = _Printer()
    shared, rest = sp.cse(results, symbols=sp.numbered_symbols(f"{target}_"))
    lines = [f"    const double {s} = {printer.doprint(e)};" for s, e in shared]
    return lines + [f"    {target}[{i}] = {printer.doprint(e)};" for i, e in enumerate(rest)]


def _tidy(expr: sp.Expr) -> sp.Expr:
    """Derivatives of kinks are kinks: no Dirac pulses."""
    return expr.replace(sp.DiracDelta, lambda *a: sp.Integer(0))
