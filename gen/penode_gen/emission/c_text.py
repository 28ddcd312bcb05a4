"""C text for numbers and expressions: shortest exact literals, every precedence explicit."""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Callable
from typing import ClassVar

import numpy as np
import numpy.typing as npt
import sympy as sp

from ..algebra import expressions as ex, functions


def literal(value: float) -> str:
    """
    The shortest C literal for `value` as pen_real_t: 0.25F where float holds it exactly, else a cast double, which the
    compiler rounds once. Raises ValueError for NaN and Inf: they have no literal.
    """
    value = float(value)
    if not math.isfinite(value):
        raise ValueError(f"{value} has no C literal")
    with np.errstate(over="ignore"):
        single = np.float32(value)
    if float(single) == value:
        return _decimal(np.format_float_scientific(single, unique=True, trim="-")) + "F"
    return f"(pen_real_t){_decimal(repr(value))}"


def literals(values: npt.ArrayLike) -> list[str]:
    """The `literal` of each number [n], some ten times as fast. Raises ValueError for NaN and Inf."""
    doubles = np.asarray(values, float)
    size = np.abs(doubles)
    with np.errstate(over="ignore", invalid="ignore"):
        singles = doubles.astype(np.float32)
        exact, plain = singles == doubles, (doubles == 0.0) | ((size >= 1e-4) & (size < 1e6))  # there, NumPy and repr write no exponent
    found = zip(doubles.tolist(), singles.astype(str).tolist(), exact.tolist(), plain.tolist(), strict=True)
    return [(f"{text}F" if held else f"(pen_real_t){value!r}") if short else literal(value) for value, text, held, short in found]


def real(value: float) -> str:
    """A literal for use inside an expression, in pen_real_t."""
    return f"(pen_real_t){_decimal(repr(float(value)))}"


def _decimal(text: str) -> str:
    """Plain notation where it is short, and always a decimal point or an exponent."""
    number = float(text)
    short = number == 0.0 or 1e-4 <= abs(number) < 1e7
    if "e" not in text:
        if short:
            return np.format_float_positional(number, unique=True, trim="0")
        digits, exponent = np.format_float_scientific(number, unique=True, trim="-").split("e")
        return f"{digits if '.' in digits else digits + '.0'}e{int(exponent)}"
    digits, exponent = text.split("e")  # those of the narrower type
    if short:
        mantissa = digits.replace(".", "").lstrip("-")
        shift = int(exponent) - (len(mantissa) - 1)
        return np.format_float_positional(float(f"{int(mantissa)}e{shift}") * (-1 if digits.startswith("-") else 1), unique=True, trim="0")
    return f"{digits if '.' in digits else digits + '.0'}e{int(exponent)}"


def fold(text: str, width: int = 120) -> str:
    """C with lines of up to `width` columns, as far as comments and expressions can be broken."""
    found: list[str] = []
    comment = False  # does the line start within one?
    for line in map(str.rstrip, text.split("\n")):
        if len(line) <= width:
            found.append(line)
        else:
            found += _fold_comment(line, width) if comment or line.lstrip().startswith("/*") else _fold_code(line, width)
        comment = line.rfind("/*") > line.rfind("*/") or (comment and "*/" not in line)
    return "\n".join(found)


def _fold_comment(line: str, width: int) -> list[str]:
    """A line of a comment, or a comment on one line, broken between words."""
    found = re.match(r"\s*(/\*\*? |\* *)?", line)
    mark = found[0] if found else ""
    indent = mark[: len(mark) - len(mark.lstrip())]
    hang = {"/** ": f"{indent} * ", "/* ": f"{indent}   ", "* ": mark}.get(mark.lstrip(), f"{mark}  ")
    words = line[len(mark) :].replace(" */", "\0*/")  # the end stays with its last word
    folded = textwrap.wrap(words, width, initial_indent=mark, subsequent_indent=hang, break_long_words=False, break_on_hyphens=False)
    return [part.replace("\0*/", " */") for part in folded]


def _fold_code(line: str, width: int) -> list[str]:
    """A statement broken where the fewest parentheses are open; a comment behind it goes above."""
    indent = line[: len(line) - len(line.lstrip())]
    if "/*" in line and (remark := re.fullmatch(r"\s*(.*\S)\s*(/\*.*\*/)", line)):
        above, code = indent + remark[2], indent + remark[1]
        return [*(_fold_comment(above, width) if len(above) > width else [above]), *_fold_code(code, width)]
    hang = indent if re.match(r"\s*(\(pen_real_t\))?-?\d", line) else f"{indent}    "  # rows of numbers, and all else
    folded: list[str] = []
    while len(line) > width and (at := _break(line, width)):
        folded.append(line[:at])
        line = hang + line[at + 1 :]
    return [*folded, line]


_ROW = re.compile(r"\s*(?:(?:\(pen_real_t\))?-?[\d.]+(?:e-?\d+)?F?, ?)+(?:(?:\(pen_real_t\))?-?[\d.]+(?:e-?\d+)?F?,?)?")  # of numbers


def _break(line: str, width: int) -> int:
    """The last space at which a line may be broken with the fewest parentheses open, 0 if there is none."""
    if _ROW.fullmatch(line):
        return line.rfind(", ", width // 3 - 1, width + 1) + 1
    best, depth, found = 0, 0, 0
    for at, c in enumerate(line[: width + 1]):
        depth += (c in "([{") - (c in ")]}")
        may = c == " " and (line[at - 1] == "," or re.match(r" (?:[-+*/?:]|&&|\|\|) ", line[at:]))
        if may and at >= width // 3 and (not found or depth <= best):
            best, found = depth, at
    return 0 if line.startswith("#") else found


class Printer:
    """Prints SymPy expressions; `name` gives the C text of a symbol."""

    _calls: ClassVar[dict[sp.FunctionClass, str]] = {
        sp.exp: "pen_exp",
        sp.tanh: "pen_tanh",
        ex.Sigmoid: "pen_sigmoid",
        ex.Softplus: "pen_softplus",
        ex.Absolute: "pen_port_abs",
        ex.Sign: "pen_sign",
        sp.Heaviside: "pen_heaviside",
        sp.Max: "pen_max",
        sp.Min: "pen_min",
        sp.Piecewise: "pen_where",
    } | functions.CALLS

    def __init__(self, name: Callable[[sp.Symbol], str]):
        self._name = name

    def __call__(self, expr: sp.Expr) -> str:
        """C text, without outer parentheses."""
        if expr.is_Symbol:
            return self._name(expr)
        if expr.is_Rational or expr.is_Float:
            return real(float(expr))
        if expr.is_Add:
            return self._add(expr)
        if expr.is_Mul:
            return self._mul(expr)
        if expr.is_Pow:
            return self._pow(expr)
        if isinstance(expr, (sp.Max, sp.Min)):
            function = self._calls[expr.func]
            first, *rest = sorted(expr.args, key=sp.default_sort_key)
            text = self(first)
            for argument in rest:
                text = f"{function}({text}, {self(argument)})"
            return text
        if isinstance(expr, sp.Piecewise):
            (yes, condition), *rest = expr.args
            return f"{self._calls[expr.func]}({self(condition)}, {self(yes)}, {self(sp.Piecewise(*rest))})"
        if expr.func in self._calls:
            return f"{self._calls[expr.func]}({self(expr.args[0])})"
        if expr.is_Relational:
            return f"{self.inner(expr.args[0])} {expr.rel_op} {self.inner(expr.args[1])}"
        raise ValueError(f"no C for {expr.func.__name__} in {expr}")

    def inner(self, expr: sp.Expr) -> str:
        """C text that can stand as an operand."""
        text = self(expr)
        whole = expr.is_Symbol or (expr.is_number and expr >= 0) or expr.func in self._calls
        return text if whole else f"({text})"

    def _add(self, expr: sp.Add) -> str:
        terms = expr.as_ordered_terms()
        if all(t.could_extract_minus_sign() for t in terms):
            return f"-({self(-expr)})"
        terms.sort(key=lambda t: t.could_extract_minus_sign())  # a positive term first
        text = self.inner(terms[0])
        for term in terms[1:]:
            text += f" - {self.inner(-term)}" if term.could_extract_minus_sign() else f" + {self.inner(term)}"
        return text

    def _mul(self, expr: sp.Mul) -> str:
        coefficient, rest = expr.as_coeff_Mul()
        if coefficient < 0 and rest != 1:
            return f"-{self.inner(-expr)}"
        above = [f for f in expr.args if not (f.is_Pow and f.exp.is_number and f.exp < 0)]
        below = [1 / f for f in expr.args if f.is_Pow and f.exp.is_number and f.exp < 0]
        if coefficient.is_Rational and coefficient.q != 1 and coefficient.p == 1 and not coefficient.is_Integer:
            above = [f for f in above if f != coefficient] + [coefficient]
        text = " * ".join(self.inner(f) for f in above) or real(1.0)
        if not below:
            return text
        text = f"({text})" if len(above) > 1 else text
        divisor = self.inner(sp.Mul(*below))
        return f"{text} / {divisor}"

    def _pow(self, expr: sp.Pow) -> str:
        base, exponent = expr.as_base_exp()
        if not exponent.is_Integer:
            raise ValueError(f"no C for the power {expr}")
        if exponent < 0:
            return f"{real(1.0)} / {self.inner(base**-exponent)}"
        return " * ".join([self.inner(base)] * int(exponent))
