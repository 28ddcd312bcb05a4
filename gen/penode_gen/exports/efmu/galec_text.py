# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""GALEC as text (eFMI 1.0.0 Beta 1): names, numbers, arrays, expressions with every precedence explicit."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import sympy as sp

from ...algebra import expressions as ex, functions
from ..interface import ExportError

_RESERVED = frozenset(
    "block protected public record end function method algorithm signals signal input output parameter constant Boolean Integer Real "
    "if then elseif else for in loop and or not size self limit true false while do until break return enumeration String "
    "min max previous derivative INVALID_ARGUMENT OVERFLOW NAN SOLVE_LINEAR_EQUATIONS_FAILED NO_SOLUTION_FOUND UNSPECIFIED_ERROR".split()
)
# Functions of the language, also for arrays (tanh1D), and names that it keeps for such: none may be given to anything else.
_BUILT_IN = re.compile(
    r"(?:minInteger|maxInteger|minReal|maxReal|posMinReal|epsReal|nan|isNaN|minusInfinite|plusInfinite|isInfinite|isFinite|hasNaN|allNaN|real|integer|"
    r"imin|imax|min|max|euler|pi|sign|absolute|abs|fractional|sqrt|exp|ln|lg|a?(?:sin|cos|tan)h?|atan2|safe_\w+|solveLinearEquations|luFactorize|luSolve|"
    r"interpolation|firstTick|round[A-Z]\w*|division[A-Z]\w*|remainder\w*|realRemainder\w*)(?:[1-3]D)?"
)
_PART = r"[A-Za-z][A-Za-z0-9_]*"
_QUOTED = re.compile(rf"(?:previous\({_PART}(?:\.{_PART})*\)|derivative\({_PART}(?:\.{_PART})*\)|{_PART}(?:\.{_PART})*)")


def name(text: str) -> str:
    """A name as the language writes it: quoted where it has dots, or means something else. Raises ExportError."""
    if not _QUOTED.fullmatch(text):
        raise ExportError(f"'{text}' cannot be a name in GALEC; start it with a letter of ASCII in the model file")
    plain = re.fullmatch(_PART, text) and text not in _RESERVED and not _BUILT_IN.fullmatch(text)
    return text if plain else f"'{text}'"


def real(value: float) -> str:
    """A Real literal that is read as the same double: decimals, and a sign in the exponent."""
    digits, _, exponent = repr(float(value)).partition("e")
    digits += "" if "." in digits else ".0"
    return f"{digits}e{int(exponent):+d}" if exponent else digits


def array(values: np.ndarray, indent: str = "") -> str:
    """A constructor, row by row."""
    if values.ndim == 1:
        return "{" + ", ".join(real(v) for v in values) + "}"
    return "{" + f",\n{indent} ".join(array(row) for row in values) + "}"


class Printer:
    """Prints SymPy expressions in the order of operations of the C; `symbol` gives the text of a symbol."""

    def __init__(self, symbol: Callable[[sp.Symbol], str]):
        self._symbol = symbol

    def __call__(self, e: sp.Expr) -> str:
        """Text without outer parentheses."""
        if e.is_Symbol:
            return self._symbol(e)
        if e.is_Rational or e.is_Float:
            return real(float(e))
        if e.is_Add:
            return self._add(e)
        if e.is_Mul:
            return self._mul(e)
        if e.is_Pow:
            return self._pow(e)
        if e.is_Relational:
            return f"{self.inner(e.args[0])} {e.rel_op} {self.inner(e.args[1])}"
        return self._call(e)

    def inner(self, e: sp.Expr) -> str:
        """Text that can stand as an operand."""
        text = self(e)
        return (
            text if e.is_Symbol or text.startswith("(if ") or re.fullmatch(r"[\d.]+(e[+-]\d+)?", text) or self._is_call(e) else f"({text})"
        )

    @staticmethod
    def _is_call(e: sp.Expr) -> bool:
        return e.is_Function and not isinstance(e, (sp.Piecewise, ex.Sigmoid, ex.Softplus))

    def _negative(self, e: sp.Expr) -> str:
        """-e: the sign itself stands before names only."""
        return f"-{self(e)}" if e.is_Symbol else f"0.0 - {self.inner(e)}"

    def _add(self, e: sp.Add) -> str:
        terms = e.as_ordered_terms()
        if all(t.could_extract_minus_sign() for t in terms):
            return self._negative(-e)
        terms.sort(key=lambda t: t.could_extract_minus_sign())
        text = self.inner(terms[0])
        for term in terms[1:]:
            text += f" - {self.inner(-term)}" if term.could_extract_minus_sign() else f" + {self.inner(term)}"
        return text

    def _mul(self, e: sp.Mul) -> str:
        coefficient, rest = e.as_coeff_Mul()
        if coefficient < 0 and rest != 1:
            return self._negative(-e)
        above = [f for f in e.args if not (f.is_Pow and f.exp.is_number and f.exp < 0)]
        below = [1 / f for f in e.args if f.is_Pow and f.exp.is_number and f.exp < 0]
        text = " * ".join(self.inner(f) for f in above) or "1.0"
        if not below:
            return text
        return f"{f'({text})' if len(above) > 1 else text} / {self.inner(sp.Mul(*below))}"

    def _pow(self, e: sp.Pow) -> str:
        base, exponent = e.as_base_exp()
        if not exponent.is_Integer:
            raise ExportError(f"the power '{e}' has no form in GALEC; write it with exp or sqrt")
        if exponent < 0:
            return f"1.0 / {self.inner(base**-exponent)}"
        return " * ".join([self.inner(base)] * int(exponent))

    def _call(self, e: sp.Expr) -> str:
        if isinstance(e, sp.Piecewise):
            return self._choice(e)
        if isinstance(e, (sp.Max, sp.Min)):
            first, *rest = sorted(e.args, key=sp.default_sort_key)
            text = self(first)
            for argument in rest:
                text = f"{'max' if isinstance(e, sp.Max) else 'min'}({text}, {self(argument)})"
            return text
        x = self(e.args[0])
        operand = self.inner(e.args[0])
        if isinstance(e, ex.Sigmoid):
            return SIGMOID.format(operand)
        if isinstance(e, ex.Softplus):
            return SOFTPLUS.format(operand)
        called = _CALLS.get(e.func)
        if called is None:
            raise ExportError(f"the function '{e.func.__name__}' has no form in GALEC")
        return f"{called}({x})"

    def _choice(self, e: sp.Piecewise) -> str:
        text = ""
        for value, condition in e.args:
            text += f"else {self(value)}" if condition == sp.true else f"{'elseif' if text else 'if'} {self(condition)} then {self(value)} "
        return f"({text})"


_CALLS: dict[object, str] = {
    sp.exp: "exp",
    sp.tanh: "tanh",
    sp.sin: "sin",
    sp.cos: "cos",
    sp.atan: "atan",
    functions.Root: "sqrt",
    functions.Logarithm: "ln",
    ex.Absolute: "absolute",
    sp.Abs: "absolute",
    ex.Sign: "sign",
}
SIGMOID = "1.0 / (1.0 + exp(0.0 - {0}))"
SOFTPLUS = "max({0}, 0.0) + ln(1.0 + exp(0.0 - absolute({0})))"
