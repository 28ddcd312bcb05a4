# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Statements of the generated C to Python, operation by operation: the order of evaluation is that of the printed text.

Only what the generator prints is known; everything else raises Untranslated. Numbers are NumPy's of the C type: a plain literal
is a double, with F a float, a cast to pen_real_t the model's real type, an integer stays one. NumPy promotes and rounds these
as C does, and every declaration converts to its type.
"""

from __future__ import annotations

import re
from typing import Any

import numpy as np

from ..sets.packing import RealType

_TOKEN = re.compile(
    r"\s*(?:(?P<float>(?:\d+\.\d*(?:[eE][-+]?\d+)?|\d+[eE][-+]?\d+)F?)|(?P<int>\d+)U?|(?P<name>[A-Za-z_]\w*)|(?P<op>->|[-+*/|]=|[<>=!]=|\+\+|[-+*/<>=?:&,;()\[\]{}.]))"
)
_BINARY = (("==", "!="), ("<", ">", "<=", ">="), ("+", "-"), ("*", "/"))  # loosest first
_ASSIGN = ("=", "+=", "-=", "*=", "/=")


class Untranslated(Exception):
    """A line of C that the evaluator does not know: the generator prints what its evaluator does not support."""


def function(name: str, parameters: list[str], lines: list[str], environment: dict[str, Any], real: RealType) -> Any:
    """The lines of a C function's body as a Python function; `environment` has all that they call and name."""
    body = _Body(real, environment)
    text = [f"def {name}({', '.join(parameters)}):", *body.lines(lines), "    return None"]
    scope = environment | body.literals | {"_real": real, "_zeros": lambda *n: np.zeros(n, real), "_row": lambda *v: np.array(v, real)}
    exec(compile("\n".join(text), f"<{name}>", "exec"), scope)  # text of our own making: only what _Body knows
    return scope[name]


def expression(text: str, environment: dict[str, Any], real: RealType) -> Any:
    """The value of one expression, such as a macro's text."""
    return function("value", [], [f"return {text};"], environment, real)()


class _Body:
    def __init__(self, real: RealType, environment: dict[str, Any]):
        self.real, self.environment = real, environment
        self.literals: dict[str, Any] = {}

    def lines(self, lines: list[str]) -> list[str]:
        out: list[str] = []
        depth = 1
        for line in lines:
            code = re.sub(r"/\*.*?\*/", "", line).strip()
            if code == "}":
                depth -= 1
            elif loop := re.fullmatch(r"for \(size_t (\w+) = 0U; \1 < (\d+)U; \1\+\+\) \{", code):
                out.append("    " * depth + f"for {_own(loop[1])} in range({loop[2]}):")
                depth += 1
            elif code:
                out.append("    " * depth + self._statement(code))
        return out

    def _statement(self, code: str) -> str:
        self.code, self.tokens, end = code, [], 0
        while end < len(code):
            found = _TOKEN.match(code, end)
            if not found:
                raise self._unknown()
            kind = found.lastgroup or ""
            self.tokens.append((kind, found[kind]))
            end = found.end()
        self.at = 0
        text = self._declaration() or self._action()
        if not (self._accept(";") and self.at == len(self.tokens)):
            raise self._unknown()
        return text

    def _unknown(self) -> Untranslated:
        return Untranslated(f"no evaluation for the generated line '{self.code}'")

    def _accept(self, *texts: str) -> str:
        """The next tokens, if they are these."""
        if [t for _, t in self.tokens[self.at : self.at + len(texts)]] != list(texts):
            return ""
        self.at += len(texts)
        return texts[0]

    def _expect(self, *texts: str) -> None:
        if not self._accept(*texts):
            raise self._unknown()

    def _name(self) -> str:
        kind, text = self.tokens[self.at] if self.at < len(self.tokens) else ("", "")
        if kind != "name":
            raise self._unknown()
        self.at += 1
        return text

    # -- statements -----------------------------------------------------------------------------------------------

    def _declaration(self) -> str:
        """Empty if it is none."""
        start = self.at
        constant = bool(self._accept("const"))
        if constant and self._accept("pen_piece_t", "*", "const"):
            name = self._name()
            self._expect("=")
            return f"{_own(name)} = {self._expression()}"
        kind = self._accept("pen_real_t") or self._accept("bool")
        if not kind:
            self.at = start
            return ""
        name = self._name()
        sizes = []
        while self._accept("["):
            sizes.append(self._expression())
            self._expect("]")
        if self._accept("="):
            if sizes:
                self._expect("{")
                values = [self._expression()]
                while self._accept(","):
                    values.append(self._expression())
                self._expect("}")
                return f"{_own(name)} = _row({', '.join(values)})"
            value = self._expression()
            return f"{_own(name)} = {f'_real({value})' if kind == 'pen_real_t' else value}"
        return f"{_own(name)} = _zeros({', '.join(sizes)})"

    def _action(self) -> str:
        if self._accept("return"):
            return f"return _real({self._expression()})"
        self._accept("(", "void", ")")
        left = self._expression()
        if self._accept("|="):
            self._expression()  # flags are no part of the answer
            return "pass"
        for sign in _ASSIGN:
            if self._accept(sign):
                return f"{left} {sign} {self._expression()}"
        return left

    # -- expressions ----------------------------------------------------------------------------------------------

    def _expression(self) -> str:
        condition = self._binary(0)
        if not self._accept("?"):
            return condition
        yes = self._expression()
        self._expect(":")
        return f"({yes} if {condition} else {self._expression()})"

    def _binary(self, level: int) -> str:
        if level == len(_BINARY):
            return self._unary()
        text = self._binary(level + 1)
        while operator := next((o for o in _BINARY[level] if self._accept(o)), ""):
            text = f"({text} {operator} {self._binary(level + 1)})"
        return text

    def _unary(self) -> str:
        if self._accept("-"):
            return f"(-{self._unary()})"
        if self._accept("(", "pen_real_t", ")"):
            return f"_real({self._unary()})"
        if self._accept("&"):
            text = self._postfix()
            if text.endswith("]"):  # &p[3]: the array from there on
                return f"{text[:-1]}:]"
            return text if text == _own("status") else f"_row({text})"  # &in: an array of one
        return self._postfix()

    def _postfix(self) -> str:
        text = self._primary()
        while True:
            if self._accept("["):
                text = f"{text}[{self._expression()}]"
                self._expect("]")
            elif self._accept("->"):
                text = f"{text}.{self._name()}"
            else:
                return text

    def _primary(self) -> str:
        if self._accept("("):
            text = self._expression()
            self._expect(")")
            return f"({text})"
        kind, word = self.tokens[self.at] if self.at < len(self.tokens) else ("", "")
        if kind == "float":
            self.at += 1
            key = f"_literal{len(self.literals)}"
            self.literals[key] = np.float32(word[:-1]) if word.endswith("F") else np.float64(word)
            return key
        if kind == "int":
            self.at += 1
            return word
        name = self._name()
        if not self._accept("("):
            return _own(name)
        arguments = [] if self._accept(")") else [self._expression()]
        while arguments and self._accept(","):
            arguments.append(self._expression())
        if arguments:
            self._expect(")")
        if name not in self.environment:
            raise self._unknown()
        return f"{name}({', '.join(arguments)})"


def _own(name: str) -> str:
    """A C variable's name in Python, where some are taken (`in`, `lambda`)."""
    return f"v_{name}"
