# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Modelica as text: numbers with all their digits, arrays, units, expressions, names."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import sympy as sp
from sympy.core.function import AppliedUndef
from sympy.printing.str import StrPrinter

from ... import units
from ...algebra import expressions as ex, functions
from ..interface import ExportError

_RESERVED = frozenset(
    "algorithm and annotation block break class connect connector constant constrainedby der discrete each else elseif elsewhen "
    "encapsulated end enumeration equation expandable extends external false final flow for function if import impure in initial inner "
    "input loop model not operator or outer output package parameter partial protected public pure record redeclare replaceable return "
    "stream then true type when while within time".split()
)


def real(value: float) -> str:
    """A Real literal that is read as the same double."""
    text = repr(float(value))
    return text if "." in text or "e" in text else f"{text}.0"


def array(values: np.ndarray, indent: str = "") -> str:
    """An array constructor, row by row: {{a}, {b}} for a matrix of one column."""
    values = np.asarray(values, float)
    if values.ndim == 0:
        return real(float(values))
    if values.ndim == 1:
        return "{" + ", ".join(real(v) for v in values) + "}"
    return "{" + f",\n{indent}  ".join(array(row) for row in values) + "}"


def unit(text: str) -> str:
    """A unit as Modelica writes it, N.s/m2, in SI."""
    return re.sub(r"\^(\d+)", r"\1", units.si(text)).replace("*", ".").replace("^", "") if text else "1"


def quoted(text: str) -> str:
    """A comment string."""
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", " ") + '"'


def identifier(name: str) -> str:
    """A name of the model, if Modelica can have it. Raises ExportError."""
    if name in _RESERVED or not re.fullmatch(r"[A-Za-z_]\w*", name, re.ASCII):
        raise ExportError(f"'{name}' cannot be a name in Modelica; rename it in the model file")
    return name


class Printer(StrPrinter):
    """Expressions of a model (expressions.py); calls of networks must have been replaced."""

    def _print_Float(self, e: sp.Float) -> str:
        return real(float(e))

    def _print_Integer(self, e: sp.Integer) -> str:
        return f"{int(e)}.0"

    def _print_Rational(self, e: sp.Rational) -> str:
        return f"({e.p}.0/{e.q}.0)"

    def _print_Pow(self, e: sp.Pow, rational: bool = False) -> str:
        base, exponent = e.args
        if exponent.is_Integer and exponent < 0:
            inverse = sp.Pow(base, -exponent)
            return f"(1.0/{self._atom(inverse)})"
        power = str(int(exponent)) if exponent.is_Integer else self._print(exponent)
        return f"{self._atom(base)}^{power if exponent.is_Integer else f'({power})'}"

    def _atom(self, e: sp.Expr) -> str:
        text = self._print(e)
        return text if e.is_Symbol or (e.is_Number and e >= 0) or e.is_Function else f"({text})"

    def _print_Function(self, e: sp.Function) -> str:
        a = [self._print(x) for x in e.args]
        match e:
            case ex.Absolute() | sp.Abs():
                return f"noEvent(abs({a[0]}))"
            case ex.Sign():
                return f"noEvent(if {a[0]} > 0.0 then 1.0 elseif {a[0]} < 0.0 then -1.0 else 0.0)"
            case ex.Sigmoid():
                return f"(1.0/(1.0 + exp(-({a[0]}))))"
            case ex.Softplus():
                return f"(max({a[0]}, 0.0) + log(1.0 + exp(-noEvent(abs({a[0]})))))"
            case functions.Root():
                return f"sqrt({a[0]})"
            case functions.Logarithm():
                return f"log({a[0]})"
            case AppliedUndef():
                raise TypeError(f"the network {e.func.__name__} in an expression")
        return f"{type(e).__name__.lower()}({', '.join(a)})"

    _print_Abs = _print_Function

    def _print_Max(self, e: sp.Expr) -> str:
        return self._fold("max", e)

    def _print_Min(self, e: sp.Expr) -> str:
        return self._fold("min", e)

    def _fold(self, name: str, e: sp.Expr) -> str:
        parts: list[str] = [self._print(a) for a in e.args]
        while len(parts) > 1:
            parts[:2] = [f"{name}({parts[0]}, {parts[1]})"]
        return parts[0]

    def _print_Relational(self, e: Any) -> str:
        return f"{self._print(e.lhs)} {e.rel_op} {self._print(e.rhs)}"

    def _print_Piecewise(self, e: sp.Piecewise) -> str:
        text = ""
        for value, condition in e.args:
            last = condition == sp.true
            text += f"{' else ' if text else ''}{self._print(value) if last else f'if {self._print(condition)} then {self._print(value)}'}"
        return f"noEvent({text})"


def expression(e: sp.Expr) -> str:
    """The text of an expression."""
    return str(Printer().doprint(e))
