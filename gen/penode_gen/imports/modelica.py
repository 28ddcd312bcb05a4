# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Records of weights in Modelica: `parameter Real layer_1_weights[16, 1] = {{...}, ...};`, also with the shape before the name.

Read are records, and the activations of the layers of a block that has a record as its parameters; all else is passed over.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import numpy as np

from ..networks import Affine, Dense, Layer, Network, NetworkError
from .interface import ImportProblem, Options

_TOKEN = re.compile(
    r'\s*(?://[^\n]*|/\*.*?\*/|("(?:[^"\\]|\\.)*")|(\d+\.?\d*(?:[eE][-+]?\d+)?|\.\d+(?:[eE][-+]?\d+)?)|([A-Za-z_]\w*(?:\.[A-Za-z_]\w*)*)|(.))',
    re.S,
)
_LARGEST = 2_000_000  # values of a file
_DEEPEST = 3  # braces: a matrix has two
_LAYER = re.compile(r"layer_(\d+)_(weights|bias)")
_SCALE = re.compile(r"scale_(\d+)_(shift|factor)")
_ACTIVATIONS = {
    "relu": "relu",
    "id": "identity",
    "identity": "identity",
    "linear": "identity",
    "tanh": "tanh",
    "sigmoid": "sigmoid",
    "softplus": "softplus",
    "step": "step",
}

Value = float | list["Value"]


def networks(text: str, path: Path, options: Options) -> dict[str, Network]:
    """All records with layers, by name without "_parameters". Raises ImportProblem."""
    reader = _Reader(text, path)
    records, blocks = reader.classes()
    found = {}
    for name, arrays in records.items():
        if any(_LAYER.fullmatch(part) for part in arrays):
            short = re.sub(r"_(parameters|Parameters|Parametrization)$", "", name)
            found[short] = _network(arrays, blocks.get(name), f"{path}: record {name}", options)
    if not found:
        raise ImportProblem(f"{path}: there is no record with parameters layer_1_weights and layer_1_bias; name a file that has one")
    return found


class _Reader:
    """One file as tokens: (line, kind, text), kind one of string, number, name, or the sign itself."""

    def __init__(self, text: str, path: Path):
        self.path, self.at = path, 0
        self.tokens: list[tuple[int, str, str]] = []
        line = 1
        for match in _TOKEN.finditer(text):
            line += match[0].count("\n")
            string, number, name, sign = match.groups()
            if string or number or name or (sign and not sign.isspace()):
                kind = "string" if string else "number" if number else "name" if name else sign
                self.tokens.append((line, kind, name or match[0].strip()))
        self.tokens.append((line, "end", ""))

    def error(self, what: str, remedy: str) -> ImportProblem:
        # a string of the file may run over several lines
        return ImportProblem(f"{self.path}: line {self.tokens[min(self.at, len(self.tokens) - 1)][0]}: {' '.join(what.split())}; {remedy}")

    @property
    def kind(self) -> str:
        return self.tokens[self.at][1]

    @property
    def word(self) -> str:
        return self.tokens[self.at][2]

    def next(self) -> str:
        """The current word; moves to the next one."""
        word = self.word
        self.at += self.kind != "end"
        return word

    def expect(self, kind: str, what: str) -> str:
        if self.kind != kind:
            shown = "the file ends" if self.kind == "end" else f"'{self.word[:40]}' stands"
            raise self.error(f"{shown} where {what} is expected", "export the record again")
        return self.next()

    def classes(self) -> tuple[dict[str, dict[str, np.ndarray]], dict[str, dict[str, str]]]:
        """Records: name -> arrays; blocks: record -> activation of each layer."""
        records: dict[str, dict[str, np.ndarray]] = {}
        blocks: dict[str, dict[str, str]] = {}
        while self.kind != "end":
            word = self.next()
            if word == "record" and self.kind == "name" and self.tokens[self.at - 2][2] != "end":
                name = self.next()
                if name in records:
                    raise self.error(f"the record {name} stands twice", "remove one")
                records[name] = self.record(name)
            elif word in ("block", "model") and self.kind == "name":
                self.block(self.next(), blocks)
        return records, blocks

    def record(self, name: str) -> dict[str, np.ndarray]:
        """The Real parameters up to `end NAME`."""
        found: dict[str, np.ndarray] = {}
        while not (self.word == "end" and self.tokens[min(self.at + 1, len(self.tokens) - 1)][2] == name):
            if self.kind == "end":
                raise self.error(f"the record {name} has no end", "the file is incomplete; export it again")
            if self.next() == "parameter" and self.word == "Real":
                self.next()
                part, values = self.parameter()
                if part in found:
                    raise self.error(f"{name}.{part} stands twice", "remove one")
                found[part] = values
        return found

    def parameter(self) -> tuple[str, np.ndarray]:
        """Name and value, with the shape before or behind the name."""
        shape = self.shape()
        name = self.expect("name", "the name of a parameter")
        shape = shape or self.shape()
        if self.kind == "(":
            self.skip()
        self.expect("=", f"the value of {name}")
        value = self.value(0)
        try:
            values = np.array(value, float)
        except ValueError:
            raise self.error(f"{name} has rows of different lengths", "give every row one number a column") from None
        if shape and values.shape != shape:
            raise self.error(f"{name} is declared with {list(shape)}, but has values of the shape {list(values.shape)}", "make them equal")
        if not (np.abs(values) <= sys.float_info.max).all():
            raise self.error(f"{name} has a number too large for a double", "train or export the network again")
        return name, values

    def shape(self) -> tuple[int, ...]:
        if self.kind != "[":
            return ()
        self.next()
        sizes = []
        while self.kind != "]":
            word = self.expect("number", "the size of an array")
            if not word.isdigit() or not 0 < int(word) <= _LARGEST:
                raise self.error(f"'{word[:40]}' is no size of an array", "give a whole number from 1 on")
            sizes.append(int(word))
            if self.kind == ",":
                self.next()
        self.next()
        return tuple(sizes)

    def value(self, depth: int) -> Value:
        """A number with its sign, or values in braces."""
        if self.kind == "{":
            if depth == _DEEPEST:
                raise self.error("braces deeper than a matrix", "give a number, {a, b} or {{a, b}, {c, d}}")
            self.next()
            found = [self.value(depth + 1)]
            while self.kind == ",":
                self.next()
                found.append(self.value(depth + 1))
            self.expect("}", "a comma or }")
            return found
        sign = -1.0 if self.kind == "-" else 1.0
        if self.kind in ("-", "+"):
            self.next()
        return sign * float(self.expect("number", "a number or {"))

    def skip(self) -> None:
        """Over a modification in parentheses."""
        depth = 0
        while True:
            depth += (self.kind == "(") - (self.kind == ")")
            if self.kind == "end":
                raise self.error("a parenthesis is not closed", "the file is incomplete; export it again")
            self.next()
            if depth == 0:
                return

    def block(self, name: str, blocks: dict[str, dict[str, str]]) -> None:
        """Activations of layers, `layer_1(..., redeclare function f = ...X)`, under the record that is a parameter."""
        layer, record, found = "", "", {}
        while self.kind != "end" and not (self.word == "end" and self.tokens[self.at + 1][2] == name):
            word = self.next()
            if word == "parameter" and self.kind == "name" and self.word not in ("Real", "Integer", "Boolean"):
                record = record or self.next().rpartition(".")[2]
            elif re.fullmatch(r"layer_\d+", word) and self.kind == "(":
                layer = word
            elif word in ("f", "activationFunction") and self.kind == "=" and layer:
                self.next()
                found[layer] = self.next().rpartition(".")[2]
        blocks.setdefault(record, found)


def _network(arrays: dict[str, np.ndarray], activations: dict[str, str] | None, where: str, options: Options) -> Network:
    """Layers in the order of their numbers, scalings around them: the first before, the others behind."""
    layers: list[Layer] = []
    numbers = sorted({int(m[1]) for part in arrays if (m := _LAYER.fullmatch(part))})
    if numbers != list(range(1, len(numbers) + 1)):
        raise ImportProblem(f"{where}: the layers are numbered {', '.join(map(str, numbers))}; number them 1, 2, 3 ... without a gap")
    for k in numbers:
        weights, bias = (_part(arrays, f"layer_{k}_{part}", where) for part in ("weights", "bias"))
        if weights.ndim != 2 or bias.shape != weights.shape[:1]:
            raise ImportProblem(
                f"{where}: layer_{k}: weights {list(weights.shape)} and bias {list(bias.shape)} do not fit; they must be [n, m] and [n]"
            )
        named = (activations or {}).get(f"layer_{k}")
        kind = _ACTIVATIONS.get(named.lower()) if named else "identity" if k == numbers[-1] else options.activation
        if kind is None:
            raise ImportProblem(
                f"{where}: layer_{k}: the activation '{named}' is not known; known are {', '.join(sorted(set(_ACTIVATIONS.values())))}"
            )
        layers.append(Dense(weights, bias, kind))
    scales = sorted({int(m[1]) for part in arrays if (m := _SCALE.fullmatch(part))})
    for k in scales:
        shift, factor = (np.atleast_1d(_part(arrays, f"scale_{k}_{part}", where)) for part in ("shift", "factor"))
        before = k == 1 and (len(scales) > 1 or shift.size == layers[0].n_in)
        scale = Affine(shift, factor, "centre" if before else "rescale")
        layers = [scale, *layers] if before else [*layers, scale]
    low, high = (np.atleast_1d(arrays[name]) if name in arrays else None for name in ("input_min", "input_max"))
    try:
        return Network(tuple(layers), low, high, where)
    except NetworkError as error:
        raise ImportProblem(str(error)) from None


def _part(arrays: dict[str, np.ndarray], name: str, where: str) -> np.ndarray:
    if name not in arrays:
        raise ImportProblem(f"{where}: {name} is missing; add it")
    return arrays[name]
