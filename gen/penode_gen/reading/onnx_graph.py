# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The nodes and constants of an ONNX graph: operators that are supported, numbers, shapes, and errors that name the node."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import NodeProto, TensorProto, helper, numpy_helper

from ..networks import NetworkError, Vector
from .places import one_line

Shape = tuple[int, ...]
P = ParamSpec("P")
T = TypeVar("T")

ACTIVATIONS = {"Relu": "relu", "Tanh": "tanh", "Sigmoid": "sigmoid", "Softplus": "softplus"}
COMPARISONS = ("Greater", "GreaterOrEqual", "Less", "LessOrEqual")
ARITHMETIC = ("Add", "Sub", "Mul", "Div", "Neg")
_SHAPING = ("Identity", "Reshape", "Flatten", "Squeeze", "Unsqueeze", "Transpose", "Cast", "Dropout")
_SUPPORTED = {*ACTIVATIONS, *COMPARISONS, *ARITHMETIC, *_SHAPING, "Gemm", "MatMul", "Constant", "Where", "Scaler"}
REALS = (TensorProto.FLOAT, TensorProto.DOUBLE)

ANY_BATCH = 1_000_003  # stands for a batch of unknown size: a prime that no reshape of a network mentions
WIDEST = 4096  # input, or activation without a dense layer, which needs an identity matrix: beyond it a size is damage

SIMPLIFY = "simplify or rewrite the graph before the export"


class Graph:
    """The graph of a model by names: what computes each tensor, and the constants. Its errors name file and node."""

    def __init__(self, path: Path, model: onnx.ModelProto):
        self.path = path
        self.model = model
        self.graph = model.graph
        self.opset = max((o.version for o in model.opset_import if o.domain in ("", "ai.onnx")), default=1)
        self.nodes = list(enumerate(self.graph.node, 1))
        self.producers = {name: (i, node) for i, node in self.nodes for name in node.output if name}
        self.constants: dict[str, NDArray[Any]] = {}

    # ---- errors ----

    def error(self, what: str, remedy: str) -> NetworkError:
        return NetworkError(one_line(f"{self.path}: {what}; {remedy}"))  # names in a file may have line feeds

    def node_error(self, index: int, node: NodeProto, what: str, remedy: str) -> NetworkError:
        name = f" '{node.name}'" if node.name else ""
        return self.error(f"node {index}{name} ({node.op_type}): {what}", remedy)

    def guard(self, index: int, node: NodeProto, call: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T:
        """call(*arguments, **named), with whatever numpy says about its numbers turned into an error of this node."""
        try:
            return call(*arguments, **named)
        except (ValueError, TypeError, LookupError, OverflowError, ZeroDivisionError) as error:
            raise self.node_error(index, node, line(error), "correct the node, or export the network again") from None

    # ---- what the graph holds ----

    def check_operators(self) -> None:
        for index, node in self.nodes:
            home = "ai.onnx.ml" if node.op_type == "Scaler" else ""
            if node.op_type not in _SUPPORTED or (node.domain if node.domain != "ai.onnx" else "") != home:
                domain = f" of {node.domain}" if node.domain not in ("", "ai.onnx") else ""
                remedy = f"build the network from dense layers with {', '.join(ACTIVATIONS)} and constant scaling"
                raise self.node_error(index, node, f"operator{domain} is not supported", remedy)
        if self.graph.sparse_initializer:
            raise self.error("has sparse weights", "export them dense")

    def read_constants(self) -> None:
        """Initializers, Constant nodes, and what follows from constants alone."""
        for tensor in self.graph.initializer:
            try:
                self.constants[tensor.name] = numpy_helper.to_array(tensor)
            except (ValueError, TypeError, KeyError, RuntimeError, OSError) as error:
                raise self.error(f"weights '{tensor.name}': {line(error)}", "export the network again") from None
        for index, node in self.nodes:
            if node.op_type == "Constant":
                self.constants[node.output[0]] = self.guard(index, node, self.constant_node, index, node)
            elif node.input and all(not name or name in self.constants for name in node.input):
                value = self.guard(index, node, self.folded, index, node)
                if value is not None:
                    self.constants[node.output[0]] = value

    def constant_node(self, index: int, node: NodeProto) -> NDArray[Any]:
        values = {a.name: helper.get_attribute_value(a) for a in node.attribute}
        if "value" in values:
            return numpy_helper.to_array(values["value"])
        for name, value in values.items():
            if name in ("value_float", "value_floats", "value_int", "value_ints"):
                return np.asarray(value, dtype=np.float32 if "float" in name else np.int64)
        raise self.node_error(index, node, f"holds a {', '.join(values)}", "use a tensor of float or double")

    def folded(self, index: int, node: NodeProto) -> NDArray[Any] | None:
        """Value of a node whose inputs are all constant; None if we do not compute such nodes."""
        v = [self.constants[name] for name in node.input if name]
        match node.op_type:
            case "Identity":
                return v[0]
            case "Transpose":
                return np.transpose(v[0], attribute(node, "perm", None))
            case "Reshape" | "Flatten" | "Squeeze" | "Unsqueeze":
                return v[0].reshape(self.reshaped(node, v[0].shape))
            case "Cast":
                return v[0].astype(helper.tensor_dtype_to_np_dtype(attribute(node, "to", TensorProto.FLOAT)))
            case "Neg":
                return -v[0]
            case "Add" | "Sub" | "Mul" | "Div":
                a, b = (self.numbers(index, node, name) for name in node.input[:2])
                if v[0].dtype != v[1].dtype:
                    raise self.node_error(index, node, "mixes float and double", "cast one of the two")
                compute = {"Add": np.add, "Sub": np.subtract, "Mul": np.multiply, "Div": np.divide}[node.op_type]
                with np.errstate(all="ignore"):
                    return np.asarray(compute(a.astype(v[0].dtype), b.astype(v[0].dtype)))
        return None

    def ends(self) -> tuple[onnx.ValueInfoProto, str]:
        """The input and the name of the output."""
        inputs = [i for i in self.graph.input if i.name not in self.constants]
        for kind, found in (("inputs", inputs), ("outputs", self.graph.output)):
            if len(found) != 1:
                names = ", ".join(f"'{i.name}'" for i in found) or "none"
                raise self.error(f"has {len(found)} {kind} ({names})", f"export it with one tensor for all {kind}")
        return inputs[0], self.graph.output[0].name

    def trained_range(self) -> tuple[Vector | None, Vector | None]:
        """From the metadata penode.input_min and penode.input_max: comma-separated numbers."""
        found: list[Vector | None] = []
        for key in ("penode.input_min", "penode.input_max"):
            texts = [p.value for p in self.model.metadata_props if p.key == key]
            try:
                found.append(np.array([float(t) for t in texts[0].split(",")]) if texts else None)
            except ValueError:
                raise self.error(f"metadata {key} = '{texts[0]}'", "write numbers separated by commas") from None
        return found[0], found[1]

    def producer(self, name: str, *operators: str) -> NodeProto | None:
        """The node behind a computed tensor, if it is one of these operators."""
        node = self.producers.get(name, (0, None))[1] if name not in self.constants else None
        return node if node is not None and node.op_type in operators else None

    # ---- numbers of a node ----

    def numbers(self, index: int, node: NodeProto, name: str) -> NDArray[np.float64]:
        """A constant that takes part in the arithmetic: float or double, finite; as float64."""
        value = self.constants[name]
        if value.dtype not in (np.float32, np.float64):
            raise self.node_error(index, node, f"'{name}' is {value.dtype}", "export with float32 or float64 weights")
        if not np.isfinite(value).all():
            raise self.node_error(index, node, f"NaN or Inf in '{name}'", "train or export the network again")
        return value.astype(np.float64)

    def integers(self, node: NodeProto, position: int, name: str) -> list[int] | None:
        """Shape or axes: an input in newer files, an attribute in older ones; None if absent."""
        if len(node.input) > position and node.input[position]:
            value = self.constants[node.input[position]]
            if value.dtype != np.int64:
                raise ValueError(f"'{node.input[position]}' is {value.dtype}, not int64")
            return [int(i) for i in value.ravel()]
        given: list[int] | None = attribute(node, name, None)
        return None if given is None else [int(i) for i in given]

    def reshaped(self, node: NodeProto, shape: Shape) -> Shape:
        """The shape after Reshape, Flatten, Squeeze or Unsqueeze; ValueError if it does not hold as many values."""
        rank = len(shape)
        if node.op_type == "Flatten":
            axis = attribute(node, "axis", 1)
            if not -rank <= axis <= rank:
                raise ValueError(f"axis {axis} of {rank}")
            axis += rank if axis < 0 else 0
            return math.prod(shape[:axis]), math.prod(shape[axis:])
        if node.op_type == "Squeeze":
            axes = self.integers(node, 1, "axes")
            axes = [i for i, d in enumerate(shape) if d == 1] if axes is None else positive(axes, rank)
            if any(shape[i] != 1 for i in axes):
                raise ValueError("cannot squeeze an axis that is not 1")
            return tuple(d for i, d in enumerate(shape) if i not in axes)
        if node.op_type == "Unsqueeze":
            axes = self.integers(node, 1, "axes") or []
            axes = positive(axes, rank + len(axes))
            rest = iter(shape)
            return tuple(1 if i in axes else next(rest) for i in range(rank + len(axes)))
        target = self.integers(node, 1, "shape") or []
        if not attribute(node, "allowzero", 0):
            target = [shape[i] if d == 0 else d for i, d in enumerate(target)]
        known = math.prod(d for d in target if d != -1)
        if -1 in target and known:
            target[target.index(-1)] = math.prod(shape) // known
        if min(target, default=1) < 0 or math.prod(target) != math.prod(shape):
            raise ValueError("the new shape does not hold as many values as the old one, for a batch of any size")
        return tuple(target)

    def single(self, index: int, node: NodeProto, name: str) -> float:
        """A constant of one number."""
        return float(self.numbers(index, node, name).reshape(()))


def attribute(node: NodeProto, name: str, default: T) -> T:
    """Value of an attribute, of the type that the operator's definition gives it."""
    found: T = next((helper.get_attribute_value(a) for a in node.attribute if a.name == name), default)
    return found


def positive(axes: list[int], rank: int) -> list[int]:
    """Axes counted from the front; ValueError if one does not exist or comes twice."""
    result = [a + rank if a < 0 else a for a in axes]
    if not all(0 <= a < rank for a in result) or len(set(result)) < len(result):
        raise ValueError(f"axes {axes} of {rank}")
    return result


def line(error: Exception) -> str:
    """The text of a foreign error as one short line."""
    return " ".join(str(error).split())[:200] or type(error).__name__
