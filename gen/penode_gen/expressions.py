"""Expressions of a model file as SymPy: parsed without eval, so that a model file can only ever be mathematics."""

from __future__ import annotations

import ast

import sympy as sp


class ExpressionError(ValueError):
    """A text that is no expression of the model; the message says what and where."""


class Softplus(sp.Function):
    """log(1 + e^x), kept whole so that the C calls pen_softplus."""

    nargs = 1

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return Sigmoid(self.args[0])


class Sigmoid(sp.Function):
    """1 / (1 + e^-x), kept whole so that the C calls pen_sigmoid."""

    nargs = 1

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return self * (1 - self)


def symbol(name: str) -> sp.Symbol:
    """The one real symbol of that name."""
    return sp.Symbol(name, real=True)


def derivative(name: str) -> sp.Symbol:
    """The symbol that stands for der(name)."""
    return symbol(f"der({name})")


def network(name: str) -> type[sp.Function]:
    """The undefined function that stands for a network's output."""
    return sp.Function(name, real=True)


FUNCTIONS = {
    "exp": (1, sp.exp),
    "tanh": (1, sp.tanh),
    "sigmoid": (1, Sigmoid),
    "softplus": (1, Softplus),
    "abs": (1, sp.Abs),
    "sign": (1, sp.sign),
    "min": (2, sp.Min),
    "max": (2, sp.Max),
}
_OPERATORS = {ast.Add: sp.Add, ast.Mult: sp.Mul, ast.Pow: sp.Pow}
_RELATIONS = {ast.Lt: sp.StrictLessThan, ast.LtE: sp.LessThan, ast.Gt: sp.StrictGreaterThan, ast.GtE: sp.GreaterThan}


def parse(text: str, names: set[str], networks: dict[str, int]) -> sp.Expr:
    """
    Parse `text`. Known: numbers, `names`, + - * / ^, der(name), where(a < b, x, y), FUNCTIONS, and `networks`
    with their number of inputs. Raises ExpressionError.
    """
    try:
        tree = ast.parse(text.replace("^", "**").strip(), mode="eval")
    except SyntaxError as error:
        raise ExpressionError(f"'{text}' cannot be read as an expression ({error.msg})") from error

    def walk(node: ast.AST) -> sp.Expr:
        match node:
            case ast.Constant(value=bool()):
                pass
            case ast.Constant(value=int() | float() as value):
                return sp.Integer(value) if isinstance(value, int) else sp.Float(value, 17)
            case ast.Name(id=name):
                if name not in names:
                    raise ExpressionError(f"'{text}' uses '{name}', which the model does not define")
                return symbol(name)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return -walk(operand)
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return walk(operand)
            case ast.BinOp(left=left, op=ast.Sub(), right=right):
                return walk(left) - walk(right)
            case ast.BinOp(left=left, op=ast.Div(), right=right):
                return walk(left) / walk(right)
            case ast.BinOp(left=left, op=op, right=right) if type(op) in _OPERATORS:
                return _OPERATORS[type(op)](walk(left), walk(right))
            case ast.Call(func=ast.Name(id="der"), args=[ast.Name(id=name)], keywords=[]):
                if name not in names:
                    raise ExpressionError(f"'{text}' uses der({name}), but the model does not define '{name}'")
                return derivative(name)
            case ast.Call(func=ast.Name(id="where"), args=[ast.Compare(left, [relation], [right]), yes, no], keywords=[]):
                if type(relation) in _RELATIONS:
                    condition = _RELATIONS[type(relation)](walk(left), walk(right))
                    return sp.Piecewise((walk(yes), condition), (walk(no), True))
            case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
                count, function = FUNCTIONS.get(name, (None, None))
                if name in networks:
                    count, function = networks[name], network(name)
                if function is None:
                    known = ", ".join(sorted([*FUNCTIONS, *networks, "der", "where"]))
                    raise ExpressionError(f"'{text}' calls '{name}'; known are {known}")
                if len(arguments) != count:
                    raise ExpressionError(f"'{text}': {name} takes {count} argument(s), not {len(arguments)}")
                return function(*map(walk, arguments))
        raise ExpressionError(f"'{text}' contains '{ast.unparse(node)}', which is no part of an expression")

    return walk(tree.body)
