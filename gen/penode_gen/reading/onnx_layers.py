# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The layers of a chain of ONNX nodes: each node adds a layer, merges into the last one, or leaves the values as they are."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from onnx import NodeProto

from ..networks import Affine, Dense, Layer, NetworkError, Vector
from .onnx_graph import ACTIVATIONS, ANY_BATCH, ARITHMETIC, REALS, SIMPLIFY, WIDEST, Graph, Shape, attribute, positive


@dataclass(frozen=True)
class Step:
    """One link of the chain: a node, or a pattern of nodes named by its last one."""

    index: int
    node: NodeProto
    source: str  # the tensor that goes in
    apply: Callable[[Chain, Step], None]


class Chain:
    """
    The layers so far, and the shape of their output: one batch axis of size `batch`, and `width` values for
    each of its rows, in order.
    """

    def __init__(self, graph: Graph, shape: Shape, batch: int):
        self.graph = graph
        self.shape = shape
        self.batch = batch
        self.layers: list[Layer] = []
        self.open = ""  # what the last layer may still take: "bias", or "shift" or "factor" of an affine layer

    @property
    def width(self) -> int:
        return math.prod(self.shape) // self.batch

    def batch_axis(self, shape: Shape) -> int:
        """Axis of the batch (-1 if there is none); ValueError if the rows of the batch do not stay apart."""
        if self.batch == 1:
            return -1
        for axis, size in enumerate(shape):
            if size == self.batch and math.prod(shape[axis + 1 :]) == self.width:
                return axis
            if size != 1:
                break
        raise ValueError("mixes the rows of a batch")

    # ---- what nodes do ----

    def plain(self, step: Step) -> None:
        node, op = step.node, step.node.op_type
        if op in ACTIVATIONS:
            self.activate(ACTIVATIONS[op])
        elif op in ("Gemm", "MatMul"):
            self.dense(step)
        elif op == "Neg":
            self.multiply(np.full(self.width, -1.0))
        elif op == "Scaler":
            self.scaler(node)
        elif op in ARITHMETIC:
            self.arithmetic(step)
        else:
            self.no_op(step)

    def arithmetic(self, step: Step) -> None:
        node = step.node
        first = node.input[0] == step.source
        c = self.vector(self.constant(step, node.input[1 if first else 0]), attribute(node, "axis", None))
        match node.op_type:
            case "Add":
                self.add(c)
            case "Mul":
                self.multiply(c)
            case "Sub" if first:
                self.add(-c)
            case "Sub":
                self.multiply(np.full(self.width, -1.0))
                self.add(c)
            case "Div" if first:
                if not (c != 0.0).all():
                    raise self.error(step, "divides by zero", "correct the scaling, a constant input has no deviation")
                self.multiply(1.0 / c)
            case _:
                raise self.error(step, "divides a constant by the signal, which is not linear", SIMPLIFY)

    def dense(self, step: Step) -> None:
        node = step.node
        if node.op_type == "Gemm":
            self.gemm(step)
        elif node.input[0] == step.source:
            w = self.constant(step, node.input[1])
            if w.ndim not in (1, 2):
                raise self.error(step, f"multiplies by {self.seen(w.shape)}", "use weights with two axes")
            self.linear(step, w.reshape(len(w), -1).T, self.shape[:-1] + w.shape[1:])
        else:
            w = self.constant(step, node.input[0])
            if len(self.shape) != 1 or w.ndim != 2:
                raise self.error(step, "the weights stand before the signal", "multiply rows of a batch from the right")
            self.linear(step, w, w.shape[:1])

    def gemm(self, step: Step) -> None:
        node = step.node
        if node.input[0] != step.source or attribute(node, "transA", 0):
            raise self.error(step, "the signal must be its first factor, not transposed", SIMPLIFY)
        w = self.constant(step, node.input[1])
        if w.ndim != 2 or len(self.shape) != 2:
            raise self.error(step, f"multiplies {self.seen(self.shape)} by {self.seen(w.shape)}", "use two matrices")
        w = w if attribute(node, "transB", 0) else w.T
        self.linear(step, w * attribute(node, "alpha", 1.0), (self.shape[0], w.shape[0]))
        if len(node.input) > 2 and node.input[2]:
            self.add(self.vector(self.constant(step, node.input[2]), None) * attribute(node, "beta", 1.0))

    def linear(self, step: Step, w: NDArray[np.float64], shape: Shape) -> None:
        """y = w x with w [n_out, n_in]; `shape` is the one of the result."""
        axes = len(self.shape)
        if w.shape[1] != self.width or self.shape[-1:] != w.shape[1:] or self.batch_axis(self.shape) == axes - 1:
            what = f"{w.shape[1]} values go in, the tensor is {self.seen(self.shape)}"
            raise self.error(step, what, "make the sizes of neighbouring layers equal")
        self.shape = shape
        self.layers.append(Dense(w, np.zeros(w.shape[0]), "identity"))
        self.open = "bias"

    def scaler(self, node: NodeProto) -> None:
        offset, scale = (np.array(attribute(node, name, []), dtype=np.float64) for name in ("offset", "scale"))
        if offset.size not in (1, self.width) or scale.size not in (1, self.width) or self.shape[-1] != self.width:
            raise ValueError(f"{offset.size} offsets and {scale.size} scales for {self.width} values")
        self.add(-np.broadcast_to(offset, (self.width,)))
        self.multiply(np.broadcast_to(scale, (self.width,)))

    def no_op(self, step: Step) -> None:
        """Nodes that leave all values and their order as they are."""
        node = step.node
        if node.op_type in ("Reshape", "Flatten", "Squeeze", "Unsqueeze"):
            if node.input[0] != step.source:
                raise self.error(step, "its shape is computed from the input", "export with constant shapes")
            shape = self.graph.reshaped(node, self.shape)
            self.batch_axis(shape)
            self.shape = shape
        elif node.op_type == "Transpose":
            order = positive(list(attribute(node, "perm", range(len(self.shape))[::-1])), len(self.shape))
            shape = tuple(self.shape[i] for i in order)
            if [i for i in order if self.shape[i] != 1] != [i for i, d in enumerate(self.shape) if d != 1]:
                raise self.error(step, "changes the order of the values", SIMPLIFY)
            self.shape = shape
        elif node.op_type == "Cast" and attribute(node, "to", 0) not in REALS:
            raise self.error(step, "casts to another type than float or double", "export in float32 or float64")
        elif node.op_type == "Dropout":
            self.dropout(step)

    def dropout(self, step: Step) -> None:
        mode = self.graph.constants.get(step.node.input[2]) if len(step.node.input) > 2 else None
        training = bool(mode.any()) if mode is not None else False
        if training or (self.graph.opset < 7 and not attribute(step.node, "is_test", 0)):
            raise self.error(step, "is in training mode", "export the network in evaluation mode")

    # ---- what patterns do ----

    def step(self, step: Step, compare: NodeProto, high: float, low: float) -> None:
        """Unit step: the comparison of the signal with a constant c, exactly (also where they are equal)."""
        if (high, low) != (1.0, 0.0):
            raise self.error(step, f"chooses between {high:g} and {low:g}", "only the unit step 1 or 0 is known")
        if step.node.op_type == "Cast" and attribute(step.node, "to", 0) not in REALS:
            raise self.error(step, "casts to another type than float or double", "export in float32 or float64")
        above = compare.op_type.startswith("Greater") == (compare.input[0] == step.source)  # x > c, not x < c
        inclusive = compare.op_type.endswith("OrEqual")
        name = compare.input[1 if compare.input[0] == step.source else 0]
        c = self.vector(self.constant(step, name), None)
        flip = np.full(self.width, -1.0)
        if c.any():
            self.add(-c)
        if above != inclusive:  # x <= c is step(c - x), and x > c is its opposite
            self.multiply(flip)
        self.activate("step")
        if not inclusive:
            self.multiply(flip)
            self.add(np.ones(self.width))

    def softplus(self, beta: float, divided: float) -> None:
        """log(1 + exp(beta x)) / beta. PyTorch writes both scalings even for beta = 1, its default: left out then."""
        ones = np.ones(self.width)
        if beta != 1.0:
            self.multiply(beta * ones)
        self.activate("softplus")
        if divided != 1.0:
            self.multiply(divided * ones)

    # ---- layers ----

    def activate(self, activation: str) -> None:
        last = self.layers[-1] if self.layers else None
        if isinstance(last, Dense) and last.activation == "identity":
            self.layers[-1] = replace(last, activation=activation)
        elif self.width > WIDEST:
            raise ValueError(f"an activation of {self.width} values without a dense layer before it")
        else:
            self.layers.append(Dense(np.eye(self.width), np.zeros(self.width), activation))
        self.open = ""

    def add(self, c: Vector) -> None:
        """y = x + c, merged with the layer before where nothing can cancel."""
        last = self.layers[-1] if self.layers else None
        if self.open == "bias" and isinstance(last, Dense):
            self.layers[-1] = replace(last, bias=c)
            self.open = ""
        elif self.open == "factor" and isinstance(last, Affine):  # (x + c1) + c2
            self.layers[-1] = replace(last, shift=last.shift - c)
        elif self.open == "shift" and isinstance(last, Affine):  # x f + c
            self.layers[-1] = replace(last, shift=last.shift + c)
        else:
            self.layers.append(Affine(-c, np.ones(self.width), "centre"))
            self.open = "factor"

    def multiply(self, c: Vector) -> None:
        """y = x c, merged with the layer before if that is a scaling too."""
        last = self.layers[-1] if self.layers else None
        if isinstance(last, Affine):
            shift = last.shift if last.form == "centre" else last.shift * c
            self.layers[-1] = replace(last, shift=shift, factor=last.factor * c)
            self.open = "" if last.form == "centre" else "shift"
        else:
            self.layers.append(Affine(np.zeros(self.width), c, "rescale"))
            self.open = "shift"

    # ---- small helpers ----

    def vector(self, c: NDArray[np.float64], axis: int | None) -> Vector:
        """A constant as it meets each row of the batch, [width]; `axis` is the alignment of old files."""
        if axis is not None:
            c = c.reshape(c.shape + (1,) * (len(self.shape) - axis - c.ndim))
        rank = max(c.ndim, len(self.shape))
        c_shape, shape = ((1,) * (rank - len(s)) + tuple(s) for s in (c.shape, self.shape))
        batch_axis = self.batch_axis(shape)
        for i, (a, b) in enumerate(zip(c_shape, shape, strict=True)):
            if a != 1 and (a != b or i == batch_axis):
                what = "differs between the rows of a batch" if i == batch_axis else "does not fit"
                raise ValueError(f"a constant {self.seen(c.shape)} for a tensor {self.seen(self.shape)} {what}")
        self.shape = shape
        row = tuple(1 if i == batch_axis else d for i, d in enumerate(shape))
        return np.broadcast_to(c.reshape(c_shape), row).reshape(self.width)

    def constant(self, step: Step, name: str) -> NDArray[np.float64]:
        return self.graph.numbers(step.index, step.node, name)

    def error(self, step: Step, what: str, remedy: str) -> NetworkError:
        return self.graph.node_error(step.index, step.node, what, remedy)

    def seen(self, shape: Shape) -> str:
        """A shape as the user knows it."""
        return "[" + ", ".join("batch" if d == ANY_BATCH else str(d) for d in shape) + "]"
