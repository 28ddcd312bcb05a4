# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
A Modelica model, flattened by rumoca, as variables and equations: Real scalars, and expressions of sympy that are 0.

rumoca runs in a process of its own: what it does with a damaged file stays there. Its target `dae-modelica` refuses models with events.
"""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import sympy

from .interface import ImportProblem

LIMIT = 120  # [s] for the compiler
_LARGEST = 4_000_000  # characters of a file
_COMPILE = """
import sys, rumoca
try:
    print(rumoca.Session(roots=sys.argv[3:] or None).load(sys.argv[1], model=sys.argv[2]).render("dae-modelica"))
except BaseException as error:
    print(" ".join(str(error).split())[:2000], file=sys.stderr)
    sys.exit(9)
"""
_TOKEN = re.compile(
    r"\s*(?:(\d+\.?\d*(?:[eE][-+]?\d+)?)|((?:[A-Za-z_]\w*|'[^'\n]+')(?:\.(?:[A-Za-z_]\w*|'[^'\n]+'))*)|([-+*/^(),=<>{}\[\]]))"
)
_DECLARED = re.compile(r'((?:\w+ )*?)(Real|Integer|Boolean|String|\w+)(\[[^\]]*\])? ([\w.\']+)(?:\((.*?)\))?(?: = (.*?))?(?: "(.*)")?;$')
_FUNCTIONS = {
    "sin": sympy.sin,
    "cos": sympy.cos,
    "atan": sympy.atan,
    "exp": sympy.exp,
    "log": sympy.log,
    "sqrt": sympy.sqrt,
    "tanh": sympy.tanh,
    "abs": sympy.Abs,
    "sign": sympy.sign,
    "max": sympy.Max,
    "min": sympy.Min,
}


@dataclass
class Variable:
    """A Real scalar. `role`: "parameter", "input", "output" or "" ."""

    role: str
    unit: str
    start: float
    description: str
    symbol: sympy.Symbol


@dataclass
class Flat:
    """What rumoca makes of a model; a derivative is the symbol `der(NAME)`."""

    variables: dict[str, Variable] = field(default_factory=dict)
    values: dict[str, sympy.Expr] = field(default_factory=dict)  # of parameters and constants
    equations: list[sympy.Expr] = field(default_factory=list)


def derivative(name: str) -> sympy.Symbol:
    """The symbol of der(NAME)."""
    return sympy.Symbol(f"der({name})", real=True)


def flat(path: Path, text: str, model: str) -> Flat:
    """The flattened model. Raises ImportProblem with one line."""
    if importlib.util.find_spec("rumoca") is None:
        raise ImportProblem(
            f"{path}: to read a model it needs the Modelica compiler rumoca, which is not installed; pip install penode[modelica]"
        )
    if len(text) > _LARGEST:
        raise ImportProblem(f"{path}: more than {_LARGEST} characters; name the file of the model alone, libraries in MODELICA_LIBS")
    roots = [root for root in os.environ.get("MODELICA_LIBS", "").split(os.pathsep) if root]
    try:
        with tempfile.TemporaryDirectory() as alone:  # rumoca reads the files beside it as well
            copy = Path(alone, "model.mo")
            copy.write_text(text, encoding="utf-8")
            done = subprocess.run(
                [sys.executable, "-c", _COMPILE, str(copy), model, *roots],
                capture_output=True,
                text=True,
                timeout=LIMIT,
                stdin=subprocess.DEVNULL,
                errors="replace",
            )
    except subprocess.TimeoutExpired:
        raise ImportProblem(f"{path}: rumoca has not compiled {model} within {LIMIT} s; import a smaller model") from None
    if done.returncode != 0:
        said = (done.stderr.replace(alone, "").strip().splitlines() or [f"it ended with code {done.returncode}"])[-1]
        if "unsupported-feature:events" in said:
            raise ImportProblem(
                f"{path}: {model} has events (when, reinit, or if without noEvent), which are not read; "
                "use the elements of a model file for stops and friction"
            )
        raise ImportProblem(
            f"{path}: rumoca cannot compile {model}: {said[:300]}; correct the model, or name its libraries in MODELICA_LIBS"
        )
    return _parsed(done.stdout, f"{path}: {model}")


def _parsed(text: str, where: str) -> Flat:
    """The lines that rumoca prints."""
    found, part = Flat(), "head"
    for line in (line.strip() for line in text.splitlines()):
        if line in ("equation", "initial equation", "algorithm", "initial algorithm") or line.startswith("end "):
            part = line
        elif not line or line.startswith(("//", "class ", "model ")):
            continue
        elif part == "head":
            _declare(found, line, where)
        elif part == "equation":
            left, equals, right = line.rstrip(";").partition(" = ")
            if not equals:
                raise ImportProblem(f"{where}: '{line[:80]}' is no equation of numbers; it is not read")
            found.equations.append(expression(right, found, where) - expression(left, found, where))
        else:
            raise ImportProblem(f"{where}: '{part}' is not read; give start values and equations instead")
    return found


def _declare(found: Flat, line: str, where: str) -> None:
    match = _DECLARED.match(line)
    if match is None:
        raise ImportProblem(f"{where}: '{line[:80]}' is not read; only Real scalars are")
    words, kind, shape, name, attributes, value, description = match.groups()
    role = next((word for word in ("parameter", "constant", "input", "output") if word in words.split()), "")
    if shape or kind not in ("Real", "Integer", "Boolean") or (kind != "Real" and role not in ("parameter", "constant")):
        changes = " that changes" if kind != "Real" and not shape else ""
        raise ImportProblem(f"{where}: {name} is {kind}{shape or ''}{changes}, which is not read; only Real scalars are")
    if kind == "Boolean":  # a choice that the compiler has made already
        return
    given = dict(re.findall(r'(\w+) = ("[^"]*"|[^,]+)', attributes or ""))
    role = "parameter" if role == "constant" else role
    symbol = sympy.Symbol(name, real=True)
    found.variables[name] = Variable(role, _unit(given.get("unit", "").strip('"')), 0.0, description or "", symbol)
    start = expression(given["start"], found, where) if "start" in given else sympy.Integer(0)
    if role == "parameter":
        found.values[name] = expression(value, found, where) if value else start
    else:
        found.variables[name].start = number(start, found, f"{where}: start of {name}")
        if value:
            found.equations.append(symbol - expression(value, found, where))


def number(expr: sympy.Expr, found: Flat, where: str) -> float:
    """The value of an expression of parameters. Raises ImportProblem."""
    for _ in range(len(found.values) + 1):
        names = {str(s) for s in expr.free_symbols}
        if not names or not names <= set(found.values):
            break
        expr = expr.subs({found.variables[name].symbol: found.values[name] for name in names})
    if expr.free_symbols or not expr.is_number or not expr.is_finite or not expr.is_real or abs(expr) > 1e300:
        raise ImportProblem(f"{where} is '{str(expr)[:60]}', which is no finite number; give it a number")
    return float(expr)


def _unit(text: str) -> str:
    """Modelica's form of a unit, N.m/rad or m/s2, as a model file has it."""
    return re.sub(r"(?<=[A-Za-z])(-?\d+)", r"^\1", text.replace(".", "*"))


def expression(text: str, found: Flat, where: str) -> sympy.Expr:
    """An expression of numbers, known names and functions. Raises ImportProblem."""
    if len(text) > 20_000:
        raise ImportProblem(f"{where}: an expression of {len(text)} characters is not read; divide it")
    words, at = [], 0
    while text[at:].strip():
        match = _TOKEN.match(text, at)
        if match is None:
            raise ImportProblem(f"{where}: '{text[at : at + 40].strip()}' is not read in an expression; use numbers, names and functions")
        words.append((match.lastindex, match[match.lastindex or 0]))
        at = match.end()
    parser = _Parser([*words, (0, "")], found, where)
    try:
        made = parser.sum()
    except RecursionError:
        raise ImportProblem(f"{where}: an expression is nested too deep; simplify it") from None
    if parser.words[parser.at][0] != 0:
        raise parser.error()
    return made


@dataclass
class _Parser:
    words: list[tuple[int | None, str]]
    found: Flat
    where: str
    at: int = 0

    def error(self) -> ImportProblem:
        word = self.words[self.at][1]
        return ImportProblem(
            f"{self.where}: '{word or 'the end'}' is not read in an expression; only + - * / ^, der and {', '.join(_FUNCTIONS)} are"
        )

    def take(self, *signs: str) -> str:
        """The sign here, if it is one of these."""
        kind, word = self.words[self.at]
        if kind == 3 and word in signs:
            self.at += 1
            return word
        return ""

    def need(self, sign: str) -> None:
        if not self.take(sign):
            raise self.error()

    def sum(self) -> sympy.Expr:
        value = -self.product() if self.take("-") else self.product()
        while sign := self.take("+", "-"):
            value = value + self.product() if sign == "+" else value - self.product()
        return value

    def product(self) -> sympy.Expr:
        value = self.power()
        while sign := self.take("*", "/"):
            value = value * self.power() if sign == "*" else value / self.power()
        return value

    def power(self) -> sympy.Expr:
        base = self.atom()
        if not self.take("^"):
            return base
        exponent = self.atom()
        if not exponent.is_Rational or abs(exponent) > 8:
            raise ImportProblem(f"{self.where}: the exponent '{str(exponent)[:40]}' is not read; use a number from -8 to 8")
        return base**exponent

    def atom(self) -> sympy.Expr:
        kind, word = self.words[self.at]
        if kind == 1:
            self.at += 1
            return sympy.Rational(word) if abs(float(word)) < 1e15 and (float(word) == 0 or abs(float(word)) > 1e-15) else sympy.Float(word)
        if self.take("("):
            value = self.sum()
            self.need(")")
            return value
        if kind != 2:
            raise self.error()
        self.at += 1
        if self.take("("):
            return self.call(word)
        if word == "time":
            raise ImportProblem(f"{self.where}: it depends on time; make what changes with time an input")
        if word not in self.found.variables:
            self.at -= 1
            raise self.error()
        return self.found.variables[word].symbol

    def call(self, name: str) -> sympy.Expr:
        values = [self.sum()]
        while self.take(","):
            values.append(self.sum())
        self.need(")")
        if name == "noEvent" and len(values) == 1:
            return values[0]
        if name == "der" and len(values) == 1:
            return differentiated(values[0])
        if name not in _FUNCTIONS or len(values) != (2 if name in ("max", "min") else 1):
            self.at -= 1
            raise ImportProblem(
                f"{self.where}: the function '{name}' with {len(values)} arguments is not supported; use der, {', '.join(_FUNCTIONS)}"
            )
        return _FUNCTIONS[name](*values)


def differentiated(expr: sympy.Expr, constant: frozenset[str] = frozenset()) -> sympy.Expr:
    """By time; of names in `constant` it is 0."""
    return sum((expr.diff(s) * derivative(str(s)) for s in expr.free_symbols if str(s) not in constant), sympy.Integer(0))
