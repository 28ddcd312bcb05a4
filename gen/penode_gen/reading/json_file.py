# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks in the JSON form of the published case study: min-max scaling around dense layers."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..networks import ACTIVATIONS, FORMS, Affine, Dense, Layer, Network, NetworkError, Vector

_TOP = ("input", "output", "normalise", "layers", "denormalise", "trained_range")


def read_json(path: Path) -> Network:
    """The network in the file; `layers` is required, all other keys are optional. Raises NetworkError."""
    return _Reader(path).network()


class _Reader:
    """One file. `where` in its methods is the place inside the file, as in layers[2].bias."""

    def __init__(self, path: Path):
        self.path = path

    def network(self) -> Network:
        top = self.table(self.load(), "the file", _TOP, ("layers",))
        for where in ("input", "output"):
            for key, text in self.table(top.get(where, {}), where, ("name", "unit")).items():
                if not isinstance(text, str):
                    raise self.error(f"{where}.{key}", f"{text!r} is not a text", "put it in quotes")
        layers: list[Layer] = []
        if "normalise" in top:
            low, high = self.min_max(top["normalise"], "normalise")
            layers.append(Affine(low, 1.0 / (high - low), "centre"))
        layers.extend(self.dense_layers(top["layers"]))
        if "denormalise" in top:
            low, high = self.min_max(top["denormalise"], "denormalise")
            layers.append(Affine(low, high - low, "rescale"))
        trained: tuple[Vector, Vector] | tuple[None, None] = (None, None)
        if "trained_range" in top:
            trained = self.bounds(top["trained_range"], "trained_range", ("min", "max"))
        return self.fitting(layers, trained, "normalise" in top, "denormalise" in top)

    def load(self) -> Any:
        try:
            return json.loads(self.path.read_bytes(), object_pairs_hook=_unique, parse_constant=_refuse)
        except OSError as error:
            raise NetworkError(f"{self.path}: {error.strerror}; correct the path in the model file") from None
        except (ValueError, RecursionError) as error:
            raise NetworkError(f"{self.path}: not JSON that can be read: {error}; export the network again") from None

    def table(self, value: Any, where: str, known: tuple[str, ...], required: tuple[str, ...] = ()) -> dict[str, Any]:
        if not isinstance(value, dict):
            raise self.error(where, "must be an object", f"give it the keys {', '.join(known)}")
        for key in value:
            if key not in known:
                raise self.error(where, f"unknown key '{key}'", f"known are {', '.join(known)}")
        for key in required:
            if key not in value:
                raise self.error(where, f"'{key}' is missing", "add it")
        return value

    def bounds(self, value: Any, where: str, known: tuple[str, ...]) -> tuple[Vector, Vector]:
        """Keys `min` and `max` as two vectors of one length, each minimum below its maximum."""
        table = self.table(value, where, known, ("min", "max"))
        low, high = (self.vector(table[key], f"{where}.{key}") for key in ("min", "max"))
        if low.shape != high.shape:
            raise self.error(where, f"{low.size} minima, but {high.size} maxima", "give one of each per value")
        if not (low < high).all():
            raise self.error(where, "a minimum is not below its maximum", "correct the two numbers")
        return low, high

    def min_max(self, value: Any, where: str) -> tuple[Vector, Vector]:
        kind = self.table(value, where, ("kind", "min", "max"), ("kind",))["kind"]
        if kind != "min-max":
            raise self.error(where, f"unknown kind {kind!r}", "the only kind is min-max; use ONNX for other scalings")
        return self.bounds(value, where, ("kind", "min", "max"))

    def dense_layers(self, value: Any) -> list[Layer]:
        if not isinstance(value, list) or not value:
            raise self.error("layers", "no layers", "give a list with one object for each layer")
        scaled = [isinstance(entry, dict) and "form" in entry for entry in value]
        return [self.scale(entry, f"layers[{i}]") if scaled[i] else self.dense(entry, f"layers[{i}]") for i, entry in enumerate(value)]

    def scale(self, value: Any, where: str) -> Affine:
        """Form "centre": (x - shift) * factor; "rescale": x * factor + shift."""
        table = self.table(value, where, ("form", "shift", "factor"), ("form", "shift", "factor"))
        if table["form"] not in FORMS:
            raise self.error(f"{where}.form", f"unknown form {table['form']!r}", f"known are {', '.join(FORMS)}")
        shift, factor = (self.vector(table[key], f"{where}.{key}") for key in ("shift", "factor"))
        if shift.shape != factor.shape:
            raise self.error(where, f"{shift.size} shifts, but {factor.size} factors", "give one of each per value")
        return Affine(shift, factor, table["form"])

    def dense(self, value: Any, where: str) -> Dense:
        table = self.table(value, where, ("activation", "weights", "bias"), ("activation", "weights", "bias"))
        if table["activation"] not in ACTIVATIONS:
            known = ", ".join(ACTIVATIONS)
            what = f"unknown activation {table['activation']!r}"
            raise self.error(f"{where}.activation", what, f"known are {known}")
        rows = table["weights"]
        if not isinstance(rows, list) or not rows:
            raise self.error(f"{where}.weights", "no rows", "give one list of numbers for each output")
        vectors = [self.vector(row, f"{where}.weights[{i}]") for i, row in enumerate(rows)]
        if len({v.size for v in vectors}) > 1:
            raise self.error(f"{where}.weights", "rows of different lengths", "give every row one number an input")
        bias = self.vector(table["bias"], f"{where}.bias")
        if bias.size != len(rows):
            raise self.error(where, f"{len(rows)} rows of weights, but {bias.size} biases", "give each row one bias")
        return Dense(np.array(vectors), bias, table["activation"])

    def vector(self, value: Any, where: str) -> Vector:
        """A list of finite numbers, not empty."""
        if not isinstance(value, list) or not value:
            raise self.error(where, "not a list of numbers", "give at least one number, in [ ]")
        for i, number in enumerate(value):
            if isinstance(number, bool) or not isinstance(number, (int, float)):
                raise self.error(f"{where}[{i}]", "not a number", "write it as a plain decimal number")
            if not abs(number) <= sys.float_info.max:
                raise self.error(f"{where}[{i}]", "too large for a double", "train or export the network again")
        return np.array(value, dtype=np.float64)

    def fitting(self, layers: list[Layer], trained: tuple[Vector, Vector] | tuple[None, None], before: bool, behind: bool) -> Network:
        """The network, or an error that counts layers as the file does."""
        names = ["normalise"] * before + [f"layers[{i}]" for i in range(len(layers) - before - behind)] + ["denormalise"] * behind
        for i in range(1, len(layers)):
            if layers[i].n_in != layers[i - 1].n_out:
                what = f"takes {layers[i].n_in} values, but {names[i - 1]} gives {layers[i - 1].n_out}"
                raise self.error(names[i], what, "make the two sizes equal")
        low, high = trained
        if low is not None and low.size != layers[0].n_in:
            what = f"{low.size} ranges for a network of {layers[0].n_in} inputs"
            raise self.error("trained_range", what, "give one for each input")
        return replace(Network(tuple(layers), low, high, str(self.path)), source=self.path.name)

    def error(self, where: str, what: str, remedy: str) -> NetworkError:
        return NetworkError(f"{self.path}: {where}: {what}; {remedy}")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object of the file; ValueError if a key stands there twice."""
    table = dict(pairs)
    if len(table) < len(pairs):
        keys = [key for key, _ in pairs]
        raise ValueError(f"the key '{next(k for k in keys if keys.count(k) > 1)}' stands twice in one object")
    return table


def _refuse(word: str) -> float:
    """json would take NaN and Infinity; a network may not have them."""
    raise ValueError(f"{word} is not a number a network may have")
