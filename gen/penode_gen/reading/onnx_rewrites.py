# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
What exporters write that is no chain of dense layers, rewritten into one before read_onnx reads it.

BatchNormalization (of inference) and Gemm of constants are folded; LeakyRelu, PRelu, Clip, Max and Min become ReLU between dense layers:
leaky(x) = relu(x) - a relu(-x), clip(x, a, b) = a + relu(x - a) - relu(x - b), max(x, c) = c + relu(x - c), min(x, c) = c - relu(c - x).
f(x) - f(0) has its constant branch computed; f(x) - f(-x), two chains side by side, becomes one of twice the width. Whatever has no rule
here stays, and the reader refuses it by name. The result follows from operators and attributes alone, not from weights.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from onnx import ModelProto, NodeProto, helper, numpy_helper, shape_inference
from onnx.reference import ReferenceEvaluator

from ..networks import Affine, Dense, Layer, Network, NetworkError
from .onnx_graph import attribute

Values = NDArray[Any]
PIECEWISE = ("LeakyRelu", "PRelu", "Clip", "Max", "Min")  # rewritten, unless reader or rule finds a plainer form
BRANCHES = ("Gemm", "MatMul", "Relu", "Tanh", "Sigmoid", "Softplus", *PIECEWISE, "BatchNormalization")  # computed where all is constant
BROADCASTS = 7  # opset from which arithmetic broadcasts as numpy does
FAR = 3.0e38  # a limit beyond float's range is none


def read(path: Path, model: ModelProto, reader: Callable[[ModelProto], Network]) -> Network:
    """The network of a model by a reader of chains. Raises what the reader raises, and NetworkError for branches that do not fit."""
    known = {n.op_type for n in model.graph.node}
    version = max((o.version for o in model.opset_import if o.domain in ("", "ai.onnx")), default=1)
    if not known & {*PIECEWISE, "BatchNormalization", "Sub"} or version < BROADCASTS:
        return reader(model)
    try:
        graph = _Graph(model)
        graph.rewrite()
        pair = graph.difference()
    except (ValueError, TypeError, LookupError, RuntimeError):  # damage: the reader says where
        return reader(model)
    if pair is None:
        network = reader(graph.model)
        return replace(network, layers=_fused(network.layers)) if graph.expanded else network
    first, second = (reader(_ending(graph.model, name)) for name in pair)
    both = [_fused(_dense(n.layers)) for n in (first, second)]
    if _form(both[0]) != _form(both[1]) or _form(both[0])[-1][0] != "identity":
        raise NetworkError(
            f"{path}: the two branches of its last Sub are not of one shape; subtract networks of equal layers, such as f(x) - f(-x)"
        )
    return replace(first, layers=_beside(*both))


def _form(layers: tuple[Layer, ...]) -> list[tuple[str, int]]:
    return [(layer.activation, layer.n_out) for layer in layers if isinstance(layer, Dense)]


def _ending(model: ModelProto, output: str) -> ModelProto:
    """The model with another output, and no node that it does not need."""
    found = ModelProto()
    found.CopyFrom(model)
    found.graph.output[0].name = output
    needed, nodes = {output}, []
    for node in reversed(found.graph.node):
        if needed & set(node.output):
            needed |= set(node.input)
            nodes.append(node)
    del found.graph.node[:]
    found.graph.node.extend(reversed(nodes))
    return found


class _Graph:
    """A copy of a model while it is rewritten."""

    def __init__(self, model: ModelProto):
        self.model = ModelProto()
        self.model.CopyFrom(model)
        self.model.ir_version = max(model.ir_version, 4)  # from here on constants need not be inputs too
        self.expanded = False
        self.constants: dict[str, Values] = {i.name: numpy_helper.to_array(i) for i in model.graph.initializer}
        self.nodes: list[NodeProto] = []
        self.ranks: dict[str, int] = {}
        self.widths = self._widths()

    def _widths(self) -> dict[str, int]:
        """Length of the last axis of each tensor, where it follows from the file; ranks likewise."""
        try:
            whole = shape_inference.infer_shapes(self.model)
        except shape_inference.InferenceError:  # the checker of the reader says what is wrong; all else is caught where this is read
            return {}
        found = {}
        for info in (*whole.graph.value_info, *whole.graph.input, *whole.graph.output):
            dims = info.type.tensor_type.shape.dim
            self.ranks[info.name] = len(dims)
            if len(dims) and dims[-1].HasField("dim_value"):
                found[info.name] = int(dims[-1].dim_value)
        return found

    def constant(self, value: Values) -> str:
        """The name of a new constant."""
        name = f"penode_{len(self.constants)}"
        self.constants[name] = value
        self.model.graph.initializer.append(numpy_helper.from_array(value, name))
        return name

    def rewrite(self) -> None:
        """All nodes by their rules, in the order of the graph."""
        rules = {
            "BatchNormalization": self.batch_norm,
            "LeakyRelu": self.leaky,
            "PRelu": self.leaky,
            "Clip": self.clip,
            "Max": self.limit,
            "Min": self.limit,
        }
        for node in list(self.model.graph.node):
            if node.op_type == "Constant" and node.attribute and node.attribute[0].name == "value":
                self.constants[node.output[0]] = numpy_helper.to_array(node.attribute[0].t)
            if node.op_type in BRANCHES and not node.domain and all(not n or n in self.constants for n in node.input):
                self.computed(node)
                continue
            rule = rules.get(node.op_type)
            found = rule(node) if rule is not None and not node.domain else None
            self.nodes += [node] if found is None else found
        del self.model.graph.node[:]
        self.model.graph.node.extend(self.nodes)

    def computed(self, node: NodeProto) -> None:
        """A node of constants becomes one."""
        given = {n: self.constants[n] for n in node.input if n}
        inputs = [helper.make_tensor_value_info(n, helper.np_dtype_to_tensor_dtype(v.dtype), v.shape) for n, v in given.items()]
        outputs = [helper.make_tensor_value_info(node.output[0], 0, None)]
        graph = helper.make_graph([node], "constant", inputs, outputs)
        (value,) = ReferenceEvaluator(helper.make_model(graph, opset_imports=self.model.opset_import)).run(None, given)
        name = self.constant(np.asarray(value))
        self.nodes.append(helper.make_node("Identity", [name], [node.output[0]], node.name))
        self.constants[node.output[0]] = np.asarray(value)

    # ---- rules: the nodes in place of one, or None where there is no rule for it ----

    def batch_norm(self, node: NodeProto) -> list[NodeProto] | None:
        """Into the Gemm before it if only it uses that, else a scaling."""
        if (
            len(node.input) < 5
            or any(n not in self.constants for n in node.input[1:5])
            or attribute(node, "training_mode", 0)
            or self.ranks.get(node.input[0]) != 2
        ):
            return None
        scale, bias, mean, variance = (self.constants[n].astype(np.float64) for n in node.input[1:5])
        factor = scale / np.sqrt(variance + attribute(node, "epsilon", 1e-5))
        shift, kind = bias - mean * factor, self.constants[node.input[1]].dtype
        before = next((n for n in self.nodes if node.input[0] in n.output), None)
        if before is not None and self.folds(before):
            weights = self.constants[before.input[1]].astype(np.float64)
            turned = attribute(before, "transB", 0)
            weights = attribute(before, "alpha", 1.0) * (weights * factor[:, None] if turned else weights * factor)
            if len(before.input) > 2 and before.input[2]:
                shift = shift + attribute(before, "beta", 1.0) * self.constants[before.input[2]].astype(np.float64) * factor
            self.nodes.remove(before)
            names = [before.input[0], self.constant(weights.astype(kind)), self.constant(np.atleast_1d(shift).astype(kind))]
            return [helper.make_node("Gemm", names, [node.output[0]], node.name, transB=turned)]
        between = f"{node.output[0]}_scaled"
        return [
            helper.make_node("Mul", [node.input[0], self.constant(factor.astype(kind))], [between], node.name),
            helper.make_node("Add", [between, self.constant(shift.astype(kind))], [node.output[0]], node.name),
        ]

    def folds(self, before: NodeProto) -> bool:
        """Can a Gemm take what scales its result? A transposed signal is left to the reader, which refuses it."""
        plain = before.op_type == "Gemm" and not before.domain and not attribute(before, "transA", 0)
        return plain and self.users(before.output[0]) == 1 and all(n in self.constants for n in before.input[1:])

    def along(self, value: Values, source: str) -> Values | None:
        """One value for each element of a signal, where that is what broadcasting makes of a constant."""
        width, rank = self.widths.get(source), self.ranks.get(source, 0)
        if width is None or value.ndim > rank or value.size not in (1, width) or value.size != (value.shape or (1,))[-1]:
            return None
        return np.broadcast_to(np.ravel(value), width).astype(np.float64)

    def users(self, name: str) -> int:
        """How many nodes of the file take a tensor."""
        taken = [t for n in self.model.graph.node for t in n.input] + [o.name for o in self.model.graph.output]
        return taken.count(name)

    def leaky(self, node: NodeProto) -> list[NodeProto] | None:
        """relu(x) - a relu(-x)."""
        slope = self.constants.get(node.input[1]) if node.op_type == "PRelu" else np.array(attribute(node, "alpha", 0.01))
        by = None if slope is None else self.along(slope, node.input[0])
        if by is None:
            return None
        eye, none = np.eye(len(by)), np.zeros(len(by))
        return self.through(node, np.hstack([eye, -eye]), np.tile(none, 2), np.vstack([eye, -np.diag(by)]), none)

    def clip(self, node: NodeProto) -> list[NodeProto] | None:
        """ReLU as it is for limits 0 and none, else a + relu(x - a) - relu(x - b)."""
        limits: list[float | None] = []
        for position, name in ((1, "min"), (2, "max")):
            given = node.input[position] if len(node.input) > position else ""
            if given and (given not in self.constants or self.constants[given].size != 1):
                return None
            value: float | None = self.constants[given].item() if given else attribute(node, name, None)
            limits.append(None if value is None or (value <= -FAR if name == "min" else value >= FAR) else float(value))
        low, high = limits
        if high is None and low is not None:
            return self.above(node, node.input[0], np.array([low]))
        if low is None and high is not None:
            return self.below(node, node.input[0], np.array([high]))
        width = self.widths.get(node.input[0])
        if low is None or high is None:
            return [helper.make_node("Identity", [node.input[0]], [node.output[0]], node.name)]
        if width is None or low >= high:  # a constant then, by ONNX: no network
            return None
        eye = np.eye(width)
        bias = np.concatenate([np.full(width, -low), np.full(width, -high)])
        return self.through(node, np.hstack([eye, eye]), bias, np.vstack([eye, -eye]), np.full(width, low))

    def limit(self, node: NodeProto) -> list[NodeProto] | None:
        """Max or Min of one signal and one constant."""
        signals = [n for n in node.input if n not in self.constants]
        if len(node.input) != 2 or len(signals) != 1:
            return None
        (other,) = (self.constants[n] for n in node.input if n in self.constants)
        return (self.above if node.op_type == "Max" else self.below)(node, signals[0], other)

    def above(self, node: NodeProto, source: str, limit: Values) -> list[NodeProto] | None:
        """max(x, c)."""
        if limit.size == 1 and limit.ndim <= 1 and limit.item() == 0.0:
            return [helper.make_node("Relu", [source], [node.output[0]], node.name)]
        at = self.along(limit, source)
        if at is None:
            return None
        if not at.any():
            return [helper.make_node("Relu", [source], [node.output[0]], node.name)]
        eye = np.eye(len(at))
        return self.through(node, eye, -at, eye, at, source)

    def below(self, node: NodeProto, source: str, limit: Values) -> list[NodeProto] | None:
        """min(x, c)."""
        at = self.along(limit, source)
        if at is None:
            return None
        eye = np.eye(len(at))
        return self.through(node, -eye, at, -eye, at, source)

    def through(self, node: NodeProto, into: Values, bias: Values, out: Values, shift: Values, source: str = "") -> list[NodeProto]:
        """relu(x into + bias) out + shift."""
        self.expanded = True
        kind = helper.tensor_dtype_to_np_dtype(self.model.graph.input[0].type.tensor_type.elem_type)
        names = [self.constant(np.asarray(v).astype(kind)) for v in (into, bias, out, shift)]
        a, b, c, d = (f"{node.output[0]}_{k}" for k in "abcd")
        return [
            helper.make_node("MatMul", [source or node.input[0], names[0]], [a], node.name),
            helper.make_node("Add", [a, names[1]], [b], node.name),
            helper.make_node("Relu", [b], [c], node.name),
            helper.make_node("MatMul", [c, names[2]], [d], node.name),
            helper.make_node("Add", [d, names[3]], [node.output[0]], node.name),
        ]

    def difference(self) -> tuple[str, str] | None:
        """The two branches if the last node is the difference of two that both follow from the input."""
        output = self.model.graph.output[0].name if self.model.graph.output else ""
        last = next((n for n in self.model.graph.node if output in n.output), None)
        if last is None or last.op_type != "Sub" or len(last.input) != 2:
            return None
        fed = {i.name for i in self.model.graph.input} - {i.name for i in self.model.graph.initializer}
        for node in self.model.graph.node:
            if fed & set(node.input):
                fed |= set(node.output)
        first, second = last.input
        return (first, second) if first in fed and second in fed and first != second else None


def _dense(layers: tuple[Layer, ...]) -> tuple[Layer, ...]:
    """Scalings as dense layers too."""
    found: list[Layer] = []
    for layer in layers:
        if isinstance(layer, Affine):
            bias = -layer.shift * layer.factor if layer.form == "centre" else layer.shift
            layer = Dense(np.diag(layer.factor), bias, "identity")
        found.append(layer)
    return tuple(found)


def _fused(layers: tuple[Layer, ...]) -> tuple[Layer, ...]:
    """Dense layers without activation multiplied into the next."""
    found: list[Layer] = []
    for layer in layers:
        last = found[-1] if found else None
        if isinstance(layer, Dense) and isinstance(last, Dense) and last.activation == "identity":
            found[-1] = Dense(layer.weights @ last.weights, layer.weights @ last.bias + layer.bias, layer.activation)
        else:
            found.append(layer)
    return tuple(found)


def _beside(first: tuple[Layer, ...], second: tuple[Layer, ...]) -> tuple[Layer, ...]:
    """Two chains as one whose output is their difference; units stand in pairs, so that equal ones cancel exactly in any sum."""
    found: list[Layer] = []
    for n, (a, b) in enumerate(zip(first, second, strict=True)):
        assert isinstance(a, Dense) and isinstance(b, Dense)
        start, end = n == 0, n == len(first) - 1
        rows = np.zeros((2 * a.n_out, a.n_in if start else 2 * a.n_in))
        for half, layer in enumerate((a, b)):
            rows[half::2, slice(None) if start else slice(half, None, 2)] = layer.weights
        bias = np.stack([a.bias, b.bias], axis=1).ravel()
        found.append(Dense(rows[0::2] - rows[1::2], a.bias - b.bias, "identity") if end else Dense(rows, bias, a.activation))
    return tuple(found)
