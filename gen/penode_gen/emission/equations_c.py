# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The equations of a model as the bodies of C functions: names, common parts, calls of networks."""

from __future__ import annotations

from typing import TypedDict

import sympy as sp

from .. import units
from ..algebra import expressions as ex
from ..algebra.causalise import Causal, Step, causalise
from ..algebra.jacobian import Derivatives
from ..algebra.placeholder import with_input
from ..model import Model
from ..sets import packing
from .c_text import Printer
from .networks_c import network_code

# Runge-Kutta methods in which every stage builds on the one before: nodes, weights and the divisor of the weights.
RUNGE_KUTTA = {"heun": ((0.0, 1.0), (1.0, 1.0), 2.0), "rk4": ((0.0, 0.5, 0.5, 1.0), (1.0, 2.0, 2.0, 1.0), 6.0)}
# Names of the templates inside functions that also hold names of the model; the model's get a _ there.
_TAKEN = frozenset(
    "p x u y z dx fx fu yx yu zx zu kx ku cx cu status rates rates_jacobian outputs outputs_jacobian sensors curvature network "
    "inner along drive layer_by_layer before advance fold f x0 copy begin finish usable unit solve integrate node".split()
)


class Body(TypedDict):
    """Lines of a function, and what it reads: networks, tunable parameters, pieces, state, drive."""

    lines: list[str]
    calls: bool
    uses_p: bool
    uses_f: bool
    uses_x: bool
    uses_u: bool


class Curvature(Body):
    """The body of the second derivatives, and which of its two directions it reads."""

    kx: bool
    ku: bool


class Equations:
    """What the C of a model and that of a batch share: the order of the equations, and how they are printed."""

    def __init__(self, model: Model, causal: Causal | None = None):
        self.given = model
        self.model, self.causal = model, causal = with_input(model, causal or causalise(model))
        first = model.sets.get("default")
        straight = [n for n, net in (first.networks if first else {}).items() if net.is_piecewise_linear and model.outside != "fade"]
        self.derivatives = Derivatives(self.causal, frozenset(straight))
        self.prefix = model.name.upper()
        self.at = packing.offsets(model)
        everything = [*self.causal.rates, *self.causal.outputs, *self.causal.sensors]
        self.uses_input_rate = self.causal.uses(everything, self.causal.input_rates)
        self.curved = model.interpolation in ("parabola", "cubic") and bool(model.states or self.uses_input_rate)
        self.cubic = self.curved and model.interpolation == "cubic"
        self.drive = self.causal.inputs + (self.causal.input_rates if self.uses_input_rate else ())
        self.kept = len(self.drive) + (2 * self.curved + self.cubic) * len(model.inputs)  # and differences of the inputs
        self.networks = network_code(model)
        self.code_of = {user: code for code in self.networks for user in code.users}
        self.constants: dict[str, sp.Symbol] = {}

    def _c_name(self, s: sp.Symbol) -> str:
        parameter = self.model.parameters.get(s.name)
        if parameter and not parameter.tunable:
            self.constants[s.name] = s
            return f"{self.prefix}_{s.name.upper()}"
        if s.name.startswith("1/"):
            self.constants[s.name] = s
            return f"{self.prefix}_{s.name[2:].upper()}_INVERSE"
        name = s.name.replace("der(", "der_").replace(")", "")
        return f"{name}_" if name in _TAKEN else name

    def _inverses(self, expr: sp.Expr) -> sp.Expr:
        """Divisions by constants become multiplications with constants of their own."""
        constants = {ex.symbol(p.name) for p in self.model.parameters.values() if not p.tunable}
        return expr.replace(
            lambda e: e.is_Pow and e.base in constants and e.exp.is_Integer and e.exp < 0, lambda e: ex.symbol(f"1/{e.base.name}") ** -e.exp
        )

    def _print(self, expr: sp.Expr) -> str:
        return Printer(self._c_name)(self._inverses(expr))

    def _function(self, results: tuple[sp.Expr, ...], target: str, jacobian: tuple[str, str] | None = None, values: bool = True) -> Body:
        """Body of a function that computes `results`, and with `jacobian` their derivatives, as lines of C."""
        kinematics = {ex.derivative(q.name): v for q, v in self.causal.kinematics.items()}
        results = tuple(r.subs(kinematics) for r in results)
        wanted: list[tuple[str, sp.Expr]] = [(f"{target}[{i}]", r) for i, r in enumerate(results)] if values else []
        if jacobian:
            for name, variables in zip(jacobian, (self.causal.states, self.drive), strict=True):
                for i, row in enumerate(self.derivatives.of(results, variables)):
                    wanted += [(f"{name}[{i}][{j}]", entry) for j, entry in enumerate(row)]
        return self._body(wanted)

    def _curvature(self) -> Curvature | None:
        """Derivatives of fx * kx + fu * ku along states and drive; None where they vanish (and no code is needed)."""
        entries = self.derivatives.curvature(self.causal.rates, self.causal.states, self.drive)
        if all(e == 0 for rows in entries for row in rows for e in row):
            return None
        wanted = [
            (f"{name}[{i}][{j}]", entry)
            for name, rows in zip(("cx", "cu"), entries, strict=True)
            for i, row in enumerate(rows)
            for j, entry in enumerate(row)
        ]
        body = self._body(wanted)
        kx, ku = (any(f"{k}[" in line for line in body["lines"]) for k in ("kx", "ku"))
        return {**body, "kx": kx, "ku": ku}

    def _body(self, wanted: list[tuple[str, sp.Expr]]) -> Body:
        model, causal = self.model, self.causal
        # common parts of derivatives get names of their own; values stay as they are, so that they keep their rounding
        plain = [(name, e) for name, e in wanted if "][" not in name]
        derived = [(name, e) for name, e in wanted if "][" in name]
        derived = [(name, self._inverses(e)) for name, e in derived]
        known = {s.name for s in (*causal.states, *self.drive, *(step.target for step in causal.steps))} | set(model.parameters)
        numbered = (ex.symbol(f"t{i}") for i in range(1, 10000) if f"t{i}" not in known)
        temporaries, reduced = sp.cse([e for _, e in derived], symbols=numbered, order="canonical") if derived else ([], [])
        wanted = plain + [(name, e) for (name, _), e in zip(derived, reduced, strict=True)]
        used = set().union(*(e.free_symbols for _, e in wanted), *(e.free_symbols for _, e in temporaries))
        needs_slope = {t for t, group in self.derivatives.slopes.items() if used & set(group)}
        needs_second = {t for t, rows in self.derivatives.seconds.items() if used & set().union(*rows)}
        steps = causal.needed([*(e for _, e in wanted), *(e for _, e in temporaries), *needs_slope, *needs_second])
        used |= set().union(*(s.reads for s in steps)) if steps else set()
        lines: list[str] = []
        for i, s in enumerate(causal.states):
            if s in used:
                lines.append(f"const pen_real_t {self._c_name(s)} = x[{i}];")
        for i, s in enumerate(self.drive):
            if s in used:
                lines.append(f"const pen_real_t {self._c_name(s)} = u[{i}];")
        read = [p for p in model.tunable if ex.symbol(p.name) in used - set(self.drive)]
        for p in read:
            lines.append(f"const pen_real_t {self._c_name(ex.symbol(p.name))} = p[{self.at[p.name]}]; /* {units.si(p.unit)} */")
        if lines and steps:
            lines.append("")
        calls = uses_p = uses_f = False
        for step in steps:
            if step.network:
                second = step.target in needs_second
                slope = step.target in needs_slope
                value = slope or step.target in used or not second
                lines += self._call(step, value, slope, second, used)
                calls = calls or value
                folded = self.code_of[step.network].folded
                uses_f |= folded
                uses_p |= not folded or model.more_pieces == "layers"
            else:
                lines += _remarked(f"const pen_real_t {self._c_name(step.target)} = {self._print(step.value)};", step)
        lines += [f"const {'bool' if e.is_Relational else 'pen_real_t'} {t.name} = {self._print(e)};" for t, e in temporaries]
        if lines and wanted:
            lines.append("")
        lines += [f"{name} = {self._print(e)};" for name, e in wanted]
        return {
            "lines": lines,
            "calls": calls,
            "uses_p": uses_p or bool(read),
            "uses_f": uses_f,
            "uses_x": any(s in used for s in causal.states),
            "uses_u": any(s in used for s in self.drive),
        }

    def _call(self, step: Step, value: bool, slope: bool, second: bool, used: set[sp.Symbol]) -> list[str]:
        name = self._c_name(step.target)
        code = self.code_of[step.network]
        function, values = code.name, f"&p[{self.prefix}_AT_{step.network.upper()}]"
        lines = []
        if len(step.arguments) == 1:
            argument = self._print(step.arguments[0])
        else:
            argument = f"inputs_of_{name}"
            parts = ", ".join(self._print(a) for a in step.arguments)
            lines.append(f"const pen_real_t {argument}[{len(step.arguments)}] = {{ {parts} }};")
        if code.folded and self.model.more_pieces == "layers":
            function, values = f"{code.name}_or_pieces", f"{values}, &f[{self._folded_at(step.network)}]"
        elif code.folded:
            return [*lines, *self._lookup(step, name, argument, slope, used)]
        if slope:
            lines.append(f"pen_real_t slopes_of_{name}[{len(step.arguments)}];")
            result = f"const pen_real_t {name} = " if step.target in used else "(void)"
            lines += _remarked(f"{result}{function}_slope({values}, {argument}, slopes_of_{name}, &status);", step)
            for i, s in enumerate(self.derivatives.slopes[step.target]):
                lines += [f"const pen_real_t {s.name} = slopes_of_{name}[{i}];"] if s in used else []
        elif value:
            lines += _remarked(f"const pen_real_t {name} = {function}({values}, {argument}, &status);", step)
        if second:
            n = len(step.arguments)
            lines.append(f"pen_real_t seconds_of_{name}[{n}][{n}];")
            lines.append(f"{function}_second({values}, {argument}, seconds_of_{name});")
            for i, row in enumerate(self.derivatives.seconds[step.target]):
                lines += [f"const pen_real_t {s.name} = seconds_of_{name}[{i}][{j}];" for j, s in enumerate(row) if j >= i and s in used]
        return lines

    def _folded_at(self, network: str) -> str:
        """Where the pieces of a folded network begin among those of a slot."""
        at = [name for code in self.networks if code.folded for name in code.users].index(network)
        return f"{at}U * {self.prefix}_PIECES" if at else "0U"

    def _lookup(self, step: Step, name: str, argument: str, slope: bool, used: set[sp.Symbol]) -> list[str]:
        """A folded network: find the piece, then a line."""
        pieces, lines = f"&f[{self._folded_at(step.network)}]", []
        if not argument.isidentifier():
            lines.append(f"const pen_real_t inputs_of_{name} = {argument};")
            argument = f"inputs_of_{name}"
        lines.append(f"const pen_piece_t *const piece_of_{name} = pen_fold_find({self.prefix}_PIECES, {pieces}, {argument});")
        if step.target in used:
            lines += _remarked(f"const pen_real_t {name} = pen_fold_value({pieces}, piece_of_{name}, {argument}, &status);", step)
        else:
            lines.append(f"status |= piece_of_{name}->status;")
        if slope and self.derivatives.slopes[step.target][0] in used:
            lines.append(f"const pen_real_t {self.derivatives.slopes[step.target][0].name} = piece_of_{name}->slope;")
        return lines


def _remarked(line: str, step: Step) -> list[str]:
    """The line with its comment behind it, or above it where it is long."""
    comment = f"/* {step.comment} */"
    if not step.comment:
        return [line]
    return [f"{line} {comment}"] if len(line) + len(comment) < 112 else [comment, line]
