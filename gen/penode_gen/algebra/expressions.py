"""Expressions of a model file as SymPy: parsed without eval, so that a model file can only ever be mathematics."""

from __future__ import annotations

import ast
import operator
import re
import unicodedata
import warnings
from collections.abc import Collection
from dataclasses import dataclass
from functools import cache, lru_cache

import sympy as sp

from . import functions

_LARGEST = 3.4e38  # what a float holds, and the least it holds with all its digits
_LEAST = 1.2e-38
_LONGEST = 2000  # characters of an expression
_HIGHEST = 8  # power
_KEPT = 4096  # parsed expressions: models that differ in one element share all the others


class ExpressionError(ValueError):
    """A text that is no expression of the model; the message states the error and its place."""


class UnknownFunction(ExpressionError):
    """A call of a name that is neither a function nor a network."""


class Softplus(sp.Function):
    """log(1 + e^x), kept whole so that the C calls pen_softplus."""

    nargs = 1
    is_extended_real = True
    is_positive = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return Sigmoid(self.args[0])

    def _eval_evalf(self, prec: int) -> sp.Expr:
        x = self.args[0]._eval_evalf(prec)
        return sp.Max(x, 0) + sp.log(1 + sp.exp(-sp.Abs(x)))._eval_evalf(prec)


class Sigmoid(sp.Function):
    """1 / (1 + e^-x), kept whole so that the C calls pen_sigmoid."""

    nargs = 1
    is_extended_real = True
    is_positive = True

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return self * (1 - self)

    def _eval_evalf(self, prec: int) -> sp.Expr:
        return (1 / (1 + sp.exp(-self.args[0])))._eval_evalf(prec)


class Sign(sp.Function):
    """-1, 0 or 1 of a real number, flat on both sides (SymPy's own knows complex numbers, which its derivatives show)."""

    nargs = 1
    is_extended_real = True

    @classmethod
    def eval(cls, x: sp.Expr) -> sp.Expr | None:
        if x.is_Number:
            return sp.sign(x)
        return -cls(-x) if x.could_extract_minus_sign() else None

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return sp.Integer(0)


class Absolute(sp.Function):
    """Size of a real number; its slope is Sign."""

    nargs = 1
    is_extended_real = True
    is_nonnegative = True

    @classmethod
    def eval(cls, x: sp.Expr) -> sp.Expr | None:
        if x.is_Number:
            return abs(x)
        return cls(-x) if x.could_extract_minus_sign() else None

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return Sign(self.args[0])


@cache
def symbol(name: str) -> sp.Symbol:
    """The one real symbol of that name."""
    return sp.Symbol(name, real=True)


def derivative(name: str) -> sp.Symbol:
    """The symbol that stands for der(name)."""
    return symbol(f"der({name})")


def network(name: str) -> sp.FunctionClass:
    """The undefined function that stands for a network's output."""
    return sp.Function(name, real=True)


FUNCTIONS = {
    "exp": (1, sp.exp),
    "tanh": (1, sp.tanh),
    "sigmoid": (1, Sigmoid),
    "softplus": (1, Softplus),
    "abs": (1, Absolute),
    "sign": (1, Sign),
    "min": (2, sp.Min),
    "max": (2, sp.Max),
} | {name: (1, function) for name, function in functions.FUNCTIONS.items()}
_OPERATIONS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}
_RELATIONS = {ast.Lt: sp.StrictLessThan, ast.LtE: sp.LessThan, ast.Gt: sp.StrictGreaterThan, ast.GtE: sp.GreaterThan}


def sides(text: str) -> list[str]:
    """The parts of `text` around each equals sign; <=, >= and == are none."""
    return re.split(r"(?<![<>=!])=(?!=)", text)


def in_range(value: float | sp.Number) -> bool:
    """Is it zero or a number that a float holds with all its digits? False for NaN."""
    try:
        size = abs(float(value))
    except OverflowError:
        return False
    return size == 0.0 or _LEAST <= size <= _LARGEST


def parse(text: str, names: Collection[str], networks: dict[str, int], moving: Collection[str] = ()) -> sp.Expr:
    """
    Parse `text`. Known: numbers, `names`, + - * / ^, der(name) of `moving` names, where(a < b, x, y), FUNCTIONS, and
    `networks` with their number of inputs. Raises ExpressionError.
    """
    words = re.findall(r"\w+", unicodedata.normalize("NFKC", text))  # as Python reads names
    known, moved = (frozenset(w for w in words if w in some) for some in (names, moving))
    return _parse(text.strip(), known, frozenset(networks.items()), moved)


@dataclass(frozen=True)
class _Reader:
    """Turns the syntax tree of one text into an expression of the names, networks and moving names that the text has."""

    text: str
    names: frozenset[str]
    networks: dict[str, int]
    moving: frozenset[str]

    @property
    def shown(self) -> str:
        return self.text if len(self.text) <= 300 else f"an expression of {len(self.text)} characters"

    def refuse(self, what: str) -> ExpressionError:
        return ExpressionError(f"'{self.shown}' {what}")

    def walk(self, node: ast.AST) -> sp.Expr:
        found = self.build(node)
        if found.has(sp.nan, sp.zoo, sp.oo, -sp.oo):
            raise self.refuse(f"divides by zero in '{ast.unparse(node)}'")
        if found.is_number and not found.is_Rational:  # exp(1), tanh(2)
            found = sp.Float(found.evalf(17), 17)
        for number in found.atoms(sp.Number):
            if not in_range(number):
                raise self.refuse("holds a number that a float cannot hold")
        return found

    def build(self, node: ast.AST) -> sp.Expr:
        match node:
            case ast.Constant(value=bool()):
                pass
            case ast.Constant(value=int() | float() as value):
                if not in_range(value):
                    raise self.refuse("holds a number that a float cannot hold")
                return sp.Integer(value) if isinstance(value, int) else sp.Float(value, 17)
            case ast.Name(id=name):
                if name not in self.names:
                    raise self.refuse(f"uses '{name}', which the model does not define")
                return symbol(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -self.walk(operand)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.walk(operand)
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return self.power(left, right)
            case ast.BinOp(left=left, op=operation, right=right) if type(operation) in _OPERATIONS:
                return _OPERATIONS[type(operation)](self.walk(left), self.walk(right))
            case ast.Call(func=ast.Name(id="der"), args=arguments):
                return self.rate(arguments)
            case ast.Call(func=ast.Name(id="where"), args=arguments, keywords=keywords):
                return self.choice(arguments, bool(keywords))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                return self.call(name, arguments)
        raise self.refuse(f"contains '{ast.unparse(node)}', which is not part of an expression")

    def power(self, left: ast.AST, right: ast.AST) -> sp.Expr:
        base, exponent = self.walk(left), self.walk(right)
        if not (exponent.is_Integer and abs(exponent) <= _HIGHEST):
            raise self.refuse(f"has the power '{ast.unparse(right)}'; whole powers up to {_HIGHEST} are known, and exp")
        return base**exponent

    def rate(self, arguments: list[ast.expr]) -> sp.Expr:
        if len(arguments) != 1 or not isinstance(arguments[0], ast.Name):
            raise self.refuse("has a 'der' that is not der(name)")
        name = arguments[0].id
        if name not in self.names:
            raise self.refuse(f"uses der({name}), but the model does not define '{name}'")
        if name not in self.moving:
            raise self.refuse(f"uses der({name}), but '{name}' is neither a state nor an input")
        return derivative(name)

    def choice(self, arguments: list[ast.expr], named: bool) -> sp.Expr:
        match arguments:
            case [ast.Compare(left, [relation], [right]), yes, no] if type(relation) in _RELATIONS and not named:
                a, b = self.walk(left), self.walk(right)
                if a.has(sp.Piecewise) or b.has(sp.Piecewise):
                    raise self.refuse("compares the result of a 'where'; give that a variable of its own")
                return sp.Piecewise((self.walk(yes), _RELATIONS[type(relation)](a, b)), (self.walk(no), True))
        raise self.refuse("has a 'where' that is not where(a < b, x, y)")

    def call(self, name: str, arguments: list[ast.expr]) -> sp.Expr:
        count, function = FUNCTIONS.get(name, (None, None))
        if name in self.networks:
            count, function = self.networks[name], network(name)
        if function is None:
            known = ", ".join(sorted([*FUNCTIONS, *self.networks, "der", "where"]))
            raise UnknownFunction(f"'{self.shown}' calls '{name}'; known are {known}")
        if len(arguments) != count:
            raise self.refuse(f"has {name} with {len(arguments)} argument(s); it takes {count}")
        return function(*map(self.walk, arguments))


@lru_cache(_KEPT)
def _parse(text: str, names: frozenset[str], calls: frozenset[tuple[str, int]], moving: frozenset[str]) -> sp.Expr:
    """The same of those names that the text has."""
    reader = _Reader(text, names, dict(calls), moving)
    refuse = reader.refuse
    if len(text) > _LONGEST:
        raise refuse(f"has {len(text)} characters, which is more than {_LONGEST}; split it with variables")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Python's remarks on its own syntax
            tree = ast.parse(text.replace("^", "**"), mode="eval")
        return reader.walk(tree.body)
    except SyntaxError as error:
        raise refuse(f"cannot be read as an expression ({error.msg})") from error
    except (RecursionError, MemoryError) as error:
        raise refuse("is nested too deeply; split it with variables") from error
    except (ValueError, TypeError, OverflowError) as error:
        if isinstance(error, ExpressionError):
            raise
        raise refuse(f"is not an expression of real numbers ({error})") from error
