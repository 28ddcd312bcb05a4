# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From a model to C that steps many runs at once, for the host: the same equations, one vector lane for each run."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import ClassVar

import sympy as sp

from ..algebra import functions, sampled
from ..algebra.causalise import Causal, Step
from ..model import Model
from ..networks import Affine, Dense, Layer
from ..sets import packing
from ..version import VERSION
from .c_text import Printer, fold, real
from .equations_c import RUNGE_KUTTA, Equations
from .model_c import TEMPLATES
from .networks_c import NetworkCode

# Names of batch.c.j2 that no name of a model may take.
_TAKEN = frozenset("p w f x u y z n k dx fx fu outside rates rates_jacobian outputs sensors integrate".split())


@dataclass(frozen=True)
class BatchCode:
    """C of a batch library, and the parameters it takes for each run: name, and whether it takes 1 / value instead."""

    text: str
    parameters: tuple[tuple[str, bool], ...]


def render_batch(model: Model, causal: Causal | None = None) -> BatchCode:
    """The batch C of a model: to be compiled with sil/firmware/pen_lanes.h beside the runtime. `causal`: its equations in
    order, where they are known already."""
    emitter = _LaneEmitter(model, causal)
    text = fold(TEMPLATES.get_template("batch.c.j2").render(emitter.context()))
    return BatchCode(text, tuple(emitter.taken))


class _LanePrinter(Printer):
    """Prints expressions over lanes: selections are masks, and numbers on their own are widened."""

    _calls: ClassVar[dict[sp.FunctionClass, str]] = {
        function: name.replace("pen_port_", "lanes_").replace("pen_", "lanes_") for function, name in Printer._calls.items()
    }
    _calls[sp.Piecewise] = "lanes_pick"

    def __call__(self, expr: sp.Expr) -> str:
        if expr.is_Rational or expr.is_Float:
            return f"lanes_wide({super().__call__(expr)})"
        return super().__call__(expr)

    def inner(self, expr: sp.Expr) -> str:
        if expr.is_Rational or expr.is_Float:  # beside an operator a number may stay one
            return real(float(expr)) if expr >= 0 else f"({real(float(expr))})"
        return super().inner(expr)


class _LaneEmitter(Equations):
    def __init__(self, model: Model, causal: Causal | None = None):
        super().__init__(model, causal)
        self.weights_at = self.at
        self.folded = [(user, code) for code in self.networks if code.folded for user in code.users]
        self.taken: list[tuple[str, bool]] = [(p.name, False) for p in model.tunable]
        self.at = {p.name: i for i, p in enumerate(model.tunable)}  # where _body finds the tunable parameters

    def context(self) -> dict[str, object]:
        model, causal = self.model, self.causal
        rosenbrock = model.method.startswith("ros")
        nodes, weights, divisor = RUNGE_KUTTA.get(model.method, ((), (), 1.0))
        return {
            **sampled.context(self.given),
            "model": model,
            "version": VERSION,
            "source": model.path.name,
            "digest": model.digest[:16],
            "real": real,
            "rates": self._lines(causal.rates, "dx") if model.method != "ros1" else None,
            "rates_jacobian": self._lines(causal.rates, "dx", ("fx", "fu")) if rosenbrock else None,
            "outputs": self._lines(causal.outputs, "y"),
            "sensors": self._lines(causal.sensors, "z"),
            "n_x": len(model.states),
            "n_q": causal.n_mechanical,
            "n_u": len(model.inputs),
            "n_drive": len(self.drive),
            "n_y": len(model.outputs),
            "n_z": len(model.sensors),
            "uses_input_rate": self.uses_input_rate,
            "curved": self.curved,
            "cubic": self.cubic,
            "elementary": functions.used(causal),
            "nodes": [real(n) for n in nodes],
            "weights": [real(w) for w in weights],
            "divisor": divisor,
            "networks": [{"code": c, "value": self._value_lines(c), "slope": self._lane_slope_lines(c)} for c in self.networks],
            "folded": self.folded,
            "at": self.weights_at,
            "length": {user: packing.network_length(code.network) for user, code in self.folded},
            "parameters": [f"1 / {name}" if inverse else name for name, inverse in self.taken],
        }

    def _lines(self, results: tuple[sp.Expr, ...], target: str, jacobian: tuple[str, str] | None = None) -> list[str]:
        lanes = {"pen_real_t": "lanes_t", "bool": "mask_t"}
        lines = self._function(results, target, jacobian)["lines"]
        return [re.sub(r"^const (pen_real_t|bool) ", lambda found: f"const {lanes[found[1]]} ", line) for line in lines]

    def _c_name(self, s: sp.Symbol) -> str:
        parameter = self.model.parameters.get(s.name.removeprefix("1/"))
        if parameter and not parameter.tunable:
            wanted = (parameter.name, s.name.startswith("1/"))
            if wanted not in self.taken:
                self.taken.append(wanted)
            return f"p[{self.taken.index(wanted)}]"
        name = s.name.replace("der(", "der_").replace(")", "")
        return f"{name}_" if name in _TAKEN or name.startswith("lanes_") else name

    def _print(self, expr: sp.Expr) -> str:
        return _LanePrinter(self._c_name)(self._inverses(expr))

    def _call(self, step: Step, value: bool, slope: bool, second: bool, used: set[sp.Symbol]) -> list[str]:
        name, code = self._c_name(step.target), self.code_of[step.network]
        function, weights, n = code.name, f"&w[{self.weights_at[step.network]}]", len(step.arguments)
        if code.folded:
            function, weights = f"{code.name}_folded", f"{weights}, &f[{self.folded.index((step.network, code))}]"
        parts = ", ".join(self._print(a) for a in step.arguments)
        lines = [f"const lanes_t inputs_of_{name}[{n}] = {{ {parts} }};", f"lanes_t {name};"]
        if not slope:
            return [*lines, f"*outside |= {function}({weights}, inputs_of_{name}, &{name});"]
        lines += [
            f"lanes_t slopes_of_{name}[{n}];",
            f"*outside |= {function}_slope({weights}, inputs_of_{name}, &{name}, slopes_of_{name});",
        ]
        return lines + [
            f"const lanes_t {s.name} = slopes_of_{name}[{i}];" for i, s in enumerate(self.derivatives.slopes[step.target]) if s in used
        ]

    def _value_lines(self, code: NetworkCode) -> list[str]:
        """Statements that take a network from `in` to `*out`; h holds the values of a layer, g those of the next."""
        lines = [_start(code, self.model)]
        here, there, relu = "h", "g", False
        for layer, at in _layers(code):
            if isinstance(layer, Affine):
                lines.append(f"lanes_{layer.form}({layer.n_out}U, {at}, {here}, {here});")
                relu = False
                continue
            lines.append(_dense(layer, at, here, there, relu))
            here, there, relu = there, here, layer.activation == "relu"
            if layer.activation not in ("identity", "relu"):
                lines.append(f"lanes_act_{layer.activation}({layer.n_out}U, {here});")
        lines.append(f"*out = {here}[0];")
        if self.model.outside == "fade":
            lines.append(f"*out *= lanes_fade({code.n}U, w, {real(self.model.fade_width)}, in);")
        return lines

    def _lane_slope_lines(self, code: NetworkCode) -> list[str]:
        """The same with derivatives: t[i] is the change of h with input i, s[i] that of g."""
        n, fade = code.n, real(self.model.fade_width)
        one = "lanes_clamp_slope({n}U, w, in, {i}U)" if self.model.outside == "clamp" else "lanes_wide(ONE)"
        lines = [_start(code, self.model)]
        lines += [f"t[{i}][{j}] = {one.format(n=n, i=i) if i == j else 'lanes_wide(ZERO)'};" for i in range(n) for j in range(n)]
        h, g, t, s, relu = "h", "g", "t", "s", False
        for layer, at in _layers(code):
            if isinstance(layer, Affine):
                lines.append(f"lanes_{layer.form}({layer.n_out}U, {at}, {h}, {h});")
                lines += [f"lanes_{layer.form}_tangent({layer.n_out}U, {at}, {t}[{i}]);" for i in range(n)]
                relu = False
                continue
            lines.append(_dense(layer, at, h, g, relu))
            lines += [f"lanes_tangent({layer.n_out}U, {layer.n_in}U, {at}, {t}[{i}], {s}[{i}]);" for i in range(n)]
            relu = layer.activation == "relu"
            if layer.activation not in ("identity", "relu"):
                lines.append(f"lanes_act_{layer.activation}({layer.n_out}U, {g});")
            if layer.activation != "identity":
                lines += [f"lanes_slope_{layer.activation}({layer.n_out}U, {g}, {s}[{i}]);" for i in range(n)]
            h, g, t, s = g, h, s, t
        lines += [f"slope[{i}] = {t}[{i}][0];" for i in range(n)] + [f"*out = {h}[0];"]
        if self.model.outside == "fade":
            lines.append(f"const lanes_t trust = lanes_fade({n}U, w, {fade}, in);")
            lines += [f"slope[{i}] = (trust * slope[{i}]) + (*out * lanes_fade_slope({n}U, w, {fade}, in, {i}U));" for i in range(n)]
            lines.append("*out *= trust;")
        return lines


def _layers(code: NetworkCode) -> list[tuple[Layer, str]]:
    """Each layer with the C text of where its weights begin."""
    return [
        (layer, f"&w[{piece.offset}]") for layer, piece in zip(code.network.layers, packing.network_pieces(code.network)[1:], strict=True)
    ]


def _start(code: NetworkCode, model: Model) -> str:
    if model.outside == "clamp":
        return f"lanes_clamp({code.n}U, w, in, h);"
    return " ".join(f"h[{i}] = in[{i}];" for i in range(code.n))


def _dense(layer: Dense, at: str, x: str, y: str, after_relu: bool) -> str:
    flags = ", ".join(str(flag).lower() for flag in (after_relu, layer.activation == "relu"))
    return f"lanes_dense({layer.n_out}U, {layer.n_in}U, {at}, {x}, {y}, {flags});"
