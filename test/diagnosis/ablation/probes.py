# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
`penode`, with every scalar constant of the diagnosis that is a literal replaced by one that notes how each comparison with it comes out.

    PROBES=FOLDER probes.py diagnose MODEL.toml --data REC... -o DIR

adds a line to FOLDER/<process>.jsonl: the model file, and for each place in the code where a threshold, or what it was multiplied into,
is compared: how often the comparison held, and how often not. A threshold whose comparisons come out the same in all cases decides
nothing there: its removal changes no answer, and need not be tried. With PROBES_OFF=FILE, {place: outcome}, these places give that
outcome whatever is compared: the threshold is switched off. Comparisons with arrays are noted by whether any, and whether not all,
of their elements hold; what an array was multiplied into is not followed further.
"""

from __future__ import annotations

import ast
import importlib.abc
import importlib.machinery
import importlib.util
import json
import operator
import os
import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

ROOM = "penode_sil.diagnosis"
NUMBERS = (ast.Constant, ast.UnaryOp, ast.BinOp, ast.operator, ast.unaryop)
SEEN: dict[str, list[int]] = defaultdict(lambda: [0, 0])  # place: how often a comparison held, how often not
OFF: dict[str, bool] = {}
COMPARED = {np.less, np.less_equal, np.greater, np.greater_equal, np.equal, np.not_equal}
BOUNDED = {np.maximum: np.greater, np.minimum: np.less, np.fmax: np.greater, np.fmin: np.less}  # which of both is taken


def place(name: str) -> str:
    """A threshold and the line of the project at which it is compared."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None and (frame.f_code.co_filename == __file__ or "penode_" not in frame.f_code.co_filename):
        frame = frame.f_back
    if frame is None:
        return f"{name} @ ?"
    return f"{name} @ {frame.f_code.co_filename.rpartition('penode_sil/')[2]}:{frame.f_lineno}"


def noted(name: str, outcome: Any) -> Any:
    """Notes an outcome, true or false or an array of them, and gives it back, or what it is to be where this threshold is off."""
    at = place(name)
    SEEN[at][0] += bool(np.any(outcome))
    SEEN[at][1] += not np.all(outcome)
    if at not in OFF:
        return outcome
    return np.full(np.shape(outcome), OFF[at]) if np.ndim(outcome) else OFF[at]


class Watched:
    """What thresholds have beside their number."""

    name = ""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **options: Any) -> Any:
        bare = [plain(i) for i in inputs]
        result = getattr(ufunc, method)(*bare, **options)
        if method == "__call__" and ufunc in COMPARED:
            return noted(self.name, result)
        if method == "__call__" and ufunc in BOUNDED:
            noted(self.name, BOUNDED[ufunc](*bare))
        return watched(self.name, result) if isinstance(result, float) else result


def plain(value: Any) -> Any:
    return value.__class__.__mro__[2](value) if isinstance(value, Watched) else value


def compare(how: Callable[[Any, Any], bool]) -> Callable[[Any, Any], Any]:
    def method(self: Any, other: Any) -> Any:
        if isinstance(other, np.ndarray | np.generic):
            return NotImplemented if isinstance(other, np.ndarray) else noted(self.name, how(plain(self), other))
        return noted(self.name, how(plain(self), plain(other))) if isinstance(other, int | float) else NotImplemented

    return method


def calculate(how: Callable[[Any, Any], Any], turned: bool = False) -> Callable[[Any, Any], Any]:
    def method(self: Any, other: Any) -> Any:
        if not isinstance(other, int | float):
            return NotImplemented
        result = how(plain(other), plain(self)) if turned else how(plain(self), plain(other))
        return watched(self.name, result)

    return method


def unary(how: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda self: watched(self.name, how(plain(self)))


METHODS = {f"__{n}__": compare(getattr(operator, n)) for n in ("lt", "le", "gt", "ge")}
for n in ("add", "sub", "mul", "truediv", "pow"):
    METHODS |= {f"__{n}__": calculate(getattr(operator, n)), f"__r{n}__": calculate(getattr(operator, n), turned=True)}
METHODS |= {"__neg__": unary(operator.neg), "__abs__": unary(abs)}
KINDS = {base: type(f"Watched_{base.__name__}", (Watched, base), METHODS) for base in (int, float)}


def watched(name: str, value: Any) -> Any:
    """A number that is watched under a name; anything else as it is."""
    if type(value) is bool or not isinstance(value, int | float):
        return value
    found = KINDS[int if isinstance(value, int) else float](value)
    found.name = name
    return found


class Watcher(importlib.machinery.SourceFileLoader):
    """Loads a module with its named numbers watched."""

    def source_to_code(self, data: Any, path: Any, *, _optimize: int = -1) -> CodeType:
        tree = ast.parse(data)
        for node in tree.body:
            named = isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id.isupper()
            if not named or not all(isinstance(p, NUMBERS) for p in ast.walk(node.value)):
                continue
            name = f"{self.name.removeprefix(ROOM + '.')}.{node.targets[0].id}"
            call = ast.parse(f"__import__('probes').watched({name!r}, 0)", mode="eval").body
            call.args[1] = node.value
            node.value = call
        return compile(ast.fix_missing_locations(tree), path, "exec", dont_inherit=True, optimize=_optimize)

    def get_code(self, fullname: str) -> CodeType:
        """From the source, never from kept byte code."""
        return self.source_to_code(self.get_data(self.path), self.path)


class Finder(importlib.abc.MetaPathFinder):
    def find_spec(self, name: str, path: Any, target: Any = None) -> Any:
        if not name.startswith(ROOM):
            return None
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        if spec is not None and spec.origin and spec.origin.endswith(".py"):
            spec.loader = Watcher(name, spec.origin)
        return spec


def main() -> None:
    sys.meta_path.insert(0, Finder())
    if "PROBES_OFF" in os.environ:
        OFF.update(json.loads(Path(os.environ["PROBES_OFF"]).read_text()))
    try:
        from penode_sil.cli import main as penode

        penode()
    finally:
        if "PROBES" in os.environ and SEEN:
            folder = Path(os.environ["PROBES"])
            folder.mkdir(parents=True, exist_ok=True)
            case = next((Path(a).resolve().parent.name for a in sys.argv if a.endswith(".toml")), "")
            with (folder / f"{os.getpid()}.jsonl").open("a") as file:
                file.write(json.dumps({"case": case, "seen": SEEN}) + "\n")


if __name__ == "__main__":
    sys.modules["probes"] = sys.modules["__main__"]
    main()
