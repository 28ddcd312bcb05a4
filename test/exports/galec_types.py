# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Grammar and types of GALEC, as far as an exported block needs them; what is not here is refused."""

from __future__ import annotations

from dataclasses import dataclass

GRAMMAR = r"""
block: "block" name entity* "protected" entity* function* "public" method* "end" name ";"
entity: (KIND | FLOW)? TYPE name dims? ";"
dims: "[" INTEGER ("," INTEGER)* "]"
function: "function" name signals? parameter* local_part "algorithm" statement* "end" name ";"
method: "method" name signals? local_part "algorithm" statement* "end" name ";"
signals: "signals" NAME ("," NAME)* ";"
parameter: FLOW TYPE name dims? ";"
local_part: ["protected" local*]
local: TYPE name dims? ";"

?statement: assign | if_statement | for_loop | raise_signal
assign: reference ":=" expression ";"
if_statement: "if" expression "then" body ("elseif" expression "then" body)* ["else" body] "end" "if" ";"
for_loop: "for" name "in" INTEGER ":" INTEGER "loop" body "end" "for" ";"
raise_signal: "signal" NAME ";"
body: statement*

?expression: operand | or_ | and_ | relation | sum_ | product | neg | not_
or_: operand ("or" operand)+
and_: operand ("and" operand)+
relation: operand REL operand
sum_: operand (ADD operand)+
product: operand (MUL operand)+
neg: "-" reference
not_: "not" "(" expression ")"
?operand: REAL -> real | INTEGER -> integer | TRUTH -> truth | reference | call | "(" expression ")" | choice | constructor
choice: "(" "if" expression "then" expression ("elseif" expression "then" expression)* "else" expression ")"
constructor: "{" expression ("," expression)* "}"
call: name "(" expression ("," expression)* ")"
reference: own | name subscripts?
own: "self" "." name subscripts?
subscripts: "[" expression ("," expression)* "]"
name: NAME | QUOTED

KIND.2: /(parameter|constant)\b/
FLOW.2: /(input|output)\b/
TYPE.2: /(Boolean|Integer|Real)\b/
TRUTH.2: /(true|false)\b/
REL: "<=" | ">=" | "<>" | "==" | "<" | ">"
ADD: "+" | "-"
MUL: "*" | "/"
REAL.3: /-?(0|[1-9][0-9]*)\.[0-9]+(e[+-][0-9]+)?/
INTEGER.2: /0|[1-9][0-9]*/
NAME: /[A-Za-z][A-Za-z0-9_]*/
QUOTED: /'[A-Za-z][A-Za-z0-9_.(),\[\]]*'/
COMMENT: /\/\*.*?\*\//s
%ignore COMMENT
%ignore /\s+/
"""
SIGNALS = frozenset({"INVALID_ARGUMENT", "OVERFLOW", "NAN", "SOLVE_LINEAR_EQUATIONS_FAILED", "NO_SOLUTION_FOUND", "UNSPECIFIED_ERROR"})


class GalecError(Exception):
    """Text that is no block, or breaks a rule of the language."""


@dataclass(frozen=True)
class Of:
    """Type and shape; of an Integer that is known when the text is read, the range of its values."""

    kind: str
    shape: tuple[int, ...] = ()
    span: tuple[int, int] | None = None


REAL, BOOLEAN, INTEGER = Of("Real"), Of("Boolean"), Of("Integer")
# Built-in functions: types of the arguments, and of the result. A shape of -1 stands for any length.
_ANY = {1: Of("Real", (-1,)), 2: Of("Real", (-1, -1))}
BUILT_IN: dict[str, tuple[tuple[Of, ...], Of]] = {
    **dict.fromkeys(("absolute", "sign", "sqrt", "exp", "ln", "sin", "cos", "atan", "tanh"), ((REAL,), REAL)),
    "min": ((REAL, REAL), REAL),
    "max": ((REAL, REAL), REAL),
    "isNaN": ((REAL,), BOOLEAN),
    "real": ((INTEGER,), REAL),
    "hasNaN1D": ((_ANY[1],), BOOLEAN),
    "hasNaN2D": ((_ANY[2],), BOOLEAN),
}


def fits(given: Of, wanted: Of) -> bool:
    """May a value of one type be where another is wanted? Nothing is converted."""
    alike = len(given.shape) == len(wanted.shape) and all(w in (-1, g) for g, w in zip(given.shape, wanted.shape, strict=True))
    return given.kind == wanted.kind and alike


def product(a: Of, b: Of) -> Of | None:
    """The type of a * b: numbers, number and array, matrix and vector, matrices."""
    if a.kind != b.kind or a.kind == "Boolean":
        return None
    if not a.shape or not b.shape:
        return Of(a.kind, a.shape or b.shape)
    if len(a.shape) == 2 and a.shape[1] == b.shape[0]:
        return Of(a.kind, (a.shape[0], *b.shape[1:]))
    return None
