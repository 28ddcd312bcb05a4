# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
An interpreter of GALEC: a block as text becomes Python that NumPy runs in the number type asked for, operation by operation.

Types, shapes, subscripts, signals and what Startup has to set are checked when the text is read. Sums of a matrix product
go from the first column to the last. It shares nothing with the exporter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import lark
import numpy as np
from galec_types import BOOLEAN, BUILT_IN, GRAMMAR, INTEGER, REAL, SIGNALS, GalecError, Of, fits, product

METHODS = ("Startup", "Recalibrate", "DoStep")


@cache
def _parser() -> lark.Lark:
    return lark.Lark(GRAMMAR, start="block", parser="lalr", propagate_positions=True)


def _label(tree: Any) -> str:
    return str(tree.children[0])


@dataclass
class _Scope:
    """What a function or method may name, what it signals, and its lines of Python."""

    names: dict[str, Of] = field(default_factory=dict)
    python: dict[str, str] = field(default_factory=dict)
    own: bool = False  # may it read self?
    signals: set[str] = field(default_factory=set)
    assigned: set[str] = field(default_factory=set)
    lines: list[str] = field(default_factory=list)


class Block:
    """A block in a number type. `values`: its variables by name as the text has it, arrays as arrays; `run` calls a method."""

    def __init__(self, text: str, real: type):
        self.real = real
        try:
            tree = _parser().parse(text)
        except lark.exceptions.LarkError as error:
            raise GalecError(str(error).splitlines()[0]) from error
        self.variables: dict[str, Of] = {}
        self.kinds: dict[str, str] = {}
        self.clauses: dict[str, set[str]] = {}
        self._functions: dict[str, tuple[list[Of], Of]] = {}
        self._called: set[str] = set()
        self._raised: set[str] = set()
        self._scope_of_python: dict[str, Any] = {
            "R": real,
            "np": np,
            "mv": _product,
            "compare": self._compare,
            "raised": self._raised,
            **_FUNCTIONS,
        }
        self.values: dict[str, Any] = {}
        self._scope_of_python["S"] = self.values
        self._read(tree)

    def _read(self, tree: lark.Tree[Any]) -> None:
        first, last = [_label(t) for t in tree.children if t.data == "name"]
        self._want(first == last, tree, f"the block {first} ends as {last}")
        for t in tree.find_data("entity"):
            self._entity(t)
        methods = {_label(t.children[0]): t for t in tree.find_data("method")}
        self._want(set(methods) == set(METHODS), tree, f"the methods are {', '.join(methods)}; a block has {', '.join(METHODS)}")
        for t in tree.find_data("function"):
            self._function(t)
        assigned = {name: self._method(methods[name], name) for name in METHODS}
        missing = set(self.variables) - assigned["Startup"]
        self._want(not missing, tree, f"Startup does not set {', '.join(sorted(missing))}")
        unused = set(self._functions) - self._called
        self._want(not unused, tree, f"nothing calls {', '.join(sorted(unused))}")

    def run(self, method: str) -> set[str]:
        """Call a method; its error signals."""
        self._raised.clear()
        with np.errstate(all="ignore"):
            self._scope_of_python[f"method_{method}"]()
        return set(self._raised)

    def _compare(self, answer: Any, a: Any, b: Any) -> bool:
        """A comparison with NaN is false, and signals."""
        if np.isnan(a) or np.isnan(b):
            self._raised.add("NAN")
            return False
        return bool(answer)

    # -- declarations ---------------------------------------------------------------------------------------------

    @staticmethod
    def _want(condition: bool, tree: Any, text: str) -> None:
        if not condition:
            raise GalecError(f"line {getattr(tree.meta, 'line', '?')}: {text}")

    @staticmethod
    def _declared(tree: lark.Tree[Any]) -> tuple[str, str, Of]:
        """Kind, name and type of a declaration."""
        kind, of, name, shape = "", "", "", ()
        for part in tree.children:
            if isinstance(part, lark.Token):
                kind, of = (str(part), of) if part.type in ("KIND", "FLOW") else (kind, str(part))
            elif part.data == "name":
                name = _label(part)
            else:
                shape = tuple(int(n) for n in part.children)
        return kind, name, Of(of, shape)

    def _entity(self, tree: lark.Tree[Any]) -> None:
        kind, name, of = self._declared(tree)
        self._want(name not in self.variables, tree, f"{name} is declared twice")
        self.variables[name], self.kinds[name] = of, kind

    def _function(self, tree: lark.Tree[Any]) -> None:
        name, scope = _label(tree.children[0]), _Scope()
        inputs: list[str] = []
        result = ""
        for t in tree.find_data("parameter"):
            kind, label, _ = self._declared(t)
            self._local(scope, t)
            inputs += [label] if kind == "input" else []
            result = label if kind == "output" else result
        self._want(bool(result) and name not in BUILT_IN, tree, f"{name} has no result, or a name that is taken")
        self._body(tree, name, scope)
        header = f"def function_{len(self._functions)}({', '.join(scope.python[n] for n in inputs)}):"
        self._compile([header, *scope.lines, f" return {scope.python[result]}"])
        self._functions[name] = ([scope.names[n] for n in inputs], scope.names[result])

    def _method(self, tree: lark.Tree[Any], name: str) -> set[str]:
        scope = _Scope(own=True)
        self._body(tree, name, scope)
        self._compile([f"def method_{name}():", *scope.lines, " return None"])
        return scope.assigned

    def _body(self, tree: lark.Tree[Any], name: str, scope: _Scope) -> None:
        names = [_label(t) for t in tree.children if isinstance(t, lark.Tree) and t.data == "name"]
        self._want(names[0] == names[-1], tree, f"{names[0]} ends as {names[-1]}")
        clause = {str(s) for t in tree.children if isinstance(t, lark.Tree) and t.data == "signals" for s in t.children}
        for t in tree.find_data("local"):
            self._local(scope, t)
        plain = ("name", "signals", "parameter", "local_part")
        for t in tree.children:
            if isinstance(t, lark.Tree) and t.data not in plain:
                self._statement(t, scope, 1)
        self._want(clause == scope.signals, tree, f"{name} declares the signals {sorted(clause)}, but has {sorted(scope.signals)}")
        self.clauses[name] = clause

    def _local(self, scope: _Scope, tree: lark.Tree[Any]) -> None:
        _, label, of = self._declared(tree)
        self._want(label not in scope.names, tree, f"{label} is declared twice")
        scope.names[label], scope.python[label] = of, f"v{len(scope.python)}"
        if of.shape and tree.data == "local":
            scope.lines.append(f" {scope.python[label]} = np.full({of.shape}, np.nan, R)")

    def _compile(self, lines: list[str]) -> None:
        exec(compile("\n".join(lines), "<GALEC>", "exec"), self._scope_of_python)  # text of our own making

    # -- statements -----------------------------------------------------------------------------------------------

    def _statement(self, tree: lark.Tree[Any], scope: _Scope, depth: int) -> None:
        getattr(self, f"_{tree.data}")(tree, scope, depth)

    def _assign(self, tree: lark.Tree[Any], scope: _Scope, depth: int) -> None:
        target, given = tree.children
        left, wanted = self._expression(target, scope)
        right, of = self._expression(given, scope)
        self._want(fits(of, wanted), tree, f"{of.kind}{list(of.shape)} is assigned to {wanted.kind}{list(wanted.shape)}")
        if target.children[0].data == "own":
            self._want(scope.own, tree, "a function sets a variable of the block")
            scope.assigned.add(_label(target.children[0].children[0]))
        scope.lines.append(f"{' ' * depth}{left} = {f'{right}.copy()' if wanted.shape else right}")

    def _if_statement(self, tree: lark.Tree[Any], scope: _Scope, depth: int) -> None:
        parts, word = [p for p in tree.children if p is not None], "if"
        while parts:
            if parts[0].data == "body":
                scope.lines.append(f"{' ' * depth}else:")
            else:
                text, of = self._expression(parts.pop(0), scope)
                self._want(of.kind == "Boolean" and not of.shape, tree, "the condition is no Boolean")
                scope.lines.append(f"{' ' * depth}{word} {text}:")
            self._lines(parts.pop(0), scope, depth)
            word = "elif"

    def _for_loop(self, tree: lark.Tree[Any], scope: _Scope, depth: int) -> None:
        label, first, last, body = _label(tree.children[0]), int(tree.children[1]), int(tree.children[2]), tree.children[3]
        self._want(label not in scope.names, tree, f"{label} is declared twice")
        scope.names[label], scope.python[label] = Of("Integer", (), (first, last)), f"i{depth}"
        scope.lines.append(f"{' ' * depth}for i{depth} in range({first}, {last + 1}):")
        self._lines(body, scope, depth)
        del scope.names[label]

    def _raise_signal(self, tree: lark.Tree[Any], scope: _Scope, depth: int) -> None:
        signal = str(tree.children[0])
        self._want(signal in SIGNALS, tree, f"there is no signal {signal}")
        scope.signals.add(signal)
        scope.lines.append(f"{' ' * depth}raised.add({signal!r})")

    def _lines(self, body: lark.Tree[Any], scope: _Scope, depth: int) -> None:
        scope.lines.append(f"{' ' * (depth + 1)}pass")
        for t in body.children:
            self._statement(t, scope, depth + 1)

    # -- expressions: the text in Python, and the type ------------------------------------------------------------

    def _expression(self, tree: Any, scope: _Scope) -> tuple[str, Of]:
        found: tuple[str, Of] = getattr(self, f"_{tree.data.rstrip('_')}")(tree, scope)
        return found

    def _many(self, trees: Any, scope: _Scope) -> Iterator[tuple[str, Of]]:
        return (self._expression(t, scope) for t in trees)

    def _real(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        key = f"c{len(self._scope_of_python)}"
        self._scope_of_python[key] = self.real(float(tree.children[0]))
        return key, REAL

    def _integer(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        n = int(tree.children[0])
        return str(n), Of("Integer", (), (n, n))

    def _truth(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        return str(tree.children[0]).capitalize(), BOOLEAN

    def _reference(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        own = tree.children[0].data == "own"
        parts = tree.children[0].children if own else tree.children
        label = _label(parts[0])
        known = self.variables if own else scope.names
        self._want(label in known and (scope.own or not own), tree, f"{label} is not declared here")
        of, text = known[label], f"S[{label!r}]" if own else scope.python[label]
        if len(parts) == 1 or parts[1] is None:
            return text, of
        subscripts = list(self._many(parts[1].children, scope))
        self._want(len(subscripts) == len(of.shape), tree, f"{label} has {len(of.shape)} dimensions")
        for (_, at), size in zip(subscripts, of.shape, strict=True):
            inside = at.span is not None and at.span[0] >= 1 and at.span[1] <= size
            self._want(inside, tree, f"a subscript of {label} is not known to lie in 1 .. {size}")
        return f"{text}[{', '.join(f'{i} - 1' for i, _ in subscripts)}]", Of(of.kind)

    def _logical(self, tree: lark.Tree[Any], scope: _Scope, word: str) -> tuple[str, Of]:
        found = list(self._many(tree.children, scope))
        self._want(all(fits(of, BOOLEAN) for _, of in found), tree, f"'{word}' needs Booleans")
        return f"({f' {word} '.join(text for text, _ in found)})", BOOLEAN

    def _or(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        return self._logical(tree, scope, "or")

    def _and(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        return self._logical(tree, scope, "and")

    def _not(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        return self._logical(tree, scope, "not")[0].replace("(", "(not ", 1), BOOLEAN

    def _relation(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        (a, left), (b, right) = self._many((tree.children[0], tree.children[2]), scope)
        operator = {"<>": "!="}.get(str(tree.children[1]), str(tree.children[1]))
        self._want(fits(left, right) and left.kind == "Real" and not left.shape, tree, "only Reals are compared here")
        scope.signals.add("NAN")
        return f"compare({a} {operator} {b}, {a}, {b})", BOOLEAN

    def _sum(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        text, of = self._expression(tree.children[0], scope)
        for sign, part in zip(tree.children[1::2], tree.children[2::2], strict=True):
            other, right = self._expression(part, scope)
            self._want(
                of.kind != "Boolean" and fits(right, Of(of.kind, of.shape)),
                tree,
                f"{of.kind}{list(of.shape)} {sign} {right.kind}{list(right.shape)}",
            )
            text, of = f"({text} {sign} {other})", Of(of.kind, of.shape)
        return text, of

    def _product(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        text, of = self._expression(tree.children[0], scope)
        for sign, part in zip(tree.children[1::2], tree.children[2::2], strict=True):
            other, right = self._expression(part, scope)
            found = product(of, right) if sign == "*" else of if of.kind == "Real" and right == REAL else None
            self._want(found is not None, tree, f"{of.kind}{list(of.shape)} {sign} {right.kind}{list(right.shape)}")
            text = f"mv({text}, {other})" if of.shape and right.shape else f"({text} {sign} {other})"
            of = found
        return text, of

    def _neg(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        text, of = self._expression(tree.children[0], scope)
        return f"(-{text})", of

    def _choice(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        found = list(self._many(tree.children, scope))
        text, of = found.pop()
        while found:
            (condition, truth), (value, other) = found[-2:]
            self._want(truth == BOOLEAN and fits(other, of), tree, "the branches differ, or the condition is no Boolean")
            text, found = f"({value} if {condition} else {text})", found[:-2]
        return text, of

    def _constructor(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        found = list(self._many(tree.children, scope))
        self._want(all(fits(of, found[0][1]) for _, of in found), tree, "the elements differ in type or shape")
        of = Of(found[0][1].kind, (len(found), *found[0][1].shape))
        return f"np.array([{', '.join(text for text, _ in found)}], R)", of

    def _call(self, tree: lark.Tree[Any], scope: _Scope) -> tuple[str, Of]:
        label = _label(tree.children[0])
        found = list(self._many(tree.children[1:], scope))
        wanted, result = BUILT_IN.get(label) or self._functions.get(label) or (None, REAL)
        self._want(wanted is not None, tree, f"there is no function {label}")
        alike = len(found) == len(wanted or ()) and all(fits(of, w) for (_, of), w in zip(found, wanted or (), strict=True))
        self._want(alike, tree, f"{label} takes other arguments")
        if label in self._functions:
            self._called.add(label)
            scope.signals |= self.clauses[label]
        name = f"f_{label}" if label in BUILT_IN else f"function_{list(self._functions).index(label)}"
        return f"{name}({', '.join(text for text, _ in found)})", result


def _product(a: Any, b: Any) -> Any:
    """Matrix times vector or matrix, summed from the first column on."""
    return np.add.accumulate(a * b, axis=1)[:, -1] if b.ndim == 1 else np.add.accumulate(a[:, :, None] * b[None], axis=1)[:, -1]


_FUNCTIONS: dict[str, Any] = {
    "f_absolute": np.abs,
    "f_sign": np.sign,
    "f_sqrt": np.sqrt,
    "f_exp": np.exp,
    "f_ln": np.log,
    "f_sin": np.sin,
    "f_cos": np.cos,
    "f_atan": np.arctan,
    "f_tanh": np.tanh,
    "f_min": np.fmin,
    "f_max": np.fmax,
    "f_isNaN": np.isnan,
    "f_hasNaN1D": lambda x: bool(np.isnan(x).any()),
    "f_hasNaN2D": lambda x: bool(np.isnan(x).any()),
    "f_real": float,
}
_ = INTEGER
