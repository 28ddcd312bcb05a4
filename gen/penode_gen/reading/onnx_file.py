# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks from ONNX files, as training tools write them.

The graph must be one chain from its only input [batch, n] or [n] to its only output. Dense layers come as Gemm or as MatMul and Add,
scaling as Sub, Div, Mul, Add, Neg with constants or as Scaler; operators that only rename, reshape or convert are checked and dropped;
onnx_rewrites turns others into such. Two patterns that are no chain are known: the Softplus of PyTorch (Where(Greater(x, 20), x,
Softplus(x))) and the unit step (a comparison, then Cast or Where(., 1, 0)). The layers follow from the operators alone, not from the
numbers, so sets trained on one architecture stay exchangeable.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from google.protobuf.message import DecodeError
from numpy.typing import NDArray
from onnx import NodeProto, TensorProto, helper, numpy_helper

from ..networks import Affine, Dense, Layer, Network, NetworkError, Vector
from . import onnx_rewrites

Shape = tuple[int, ...]

_ACTIVATIONS = {"Relu": "relu", "Tanh": "tanh", "Sigmoid": "sigmoid", "Softplus": "softplus"}
_COMPARISONS = ("Greater", "GreaterOrEqual", "Less", "LessOrEqual")
_ARITHMETIC = ("Add", "Sub", "Mul", "Div", "Neg")
_SHAPING = ("Identity", "Reshape", "Flatten", "Squeeze", "Unsqueeze", "Transpose", "Cast", "Dropout")
_SUPPORTED = {*_ACTIVATIONS, *_COMPARISONS, *_ARITHMETIC, *_SHAPING, "Gemm", "MatMul", "Constant", "Where", "Scaler"}
_REALS = (TensorProto.FLOAT, TensorProto.DOUBLE)

_ANY_BATCH = 1_000_003  # stands for a batch of unknown size: a prime that no reshape of a network mentions
_SOFTPLUS_EXACT = 15.0  # from here on x and softplus(x) are the same float: log(1 + e^-15) is below half an ulp of 15
_WIDEST = 4096  # input, or activation without a dense layer, which needs an identity matrix: beyond it a size is damage

_SIMPLIFY = "simplify or rewrite the graph before the export"


def read_onnx(path: Path) -> Network:
    """The network in the file; weights may lie in a second file beside it. Raises NetworkError."""
    return onnx_rewrites.read(path, _load(path), lambda model: _Reader(path, model).network())


def _load(path: Path) -> onnx.ModelProto:
    try:
        model = onnx.load(path)
    except DecodeError:
        raise NetworkError(f"{path}: not an ONNX file, or cut off; export the network again") from None
    except (onnx.checker.ValidationError, OSError) as error:
        if not path.is_file():
            raise NetworkError(f"{path}: no such file; mend the path in the model file") from None
        remedy = "keep the weight data (.data) file of the export beside it"
        raise NetworkError(f"{path}: weights in another file cannot be read: {_line(error)}; {remedy}") from None
    except (ValueError, RuntimeError, TypeError) as error:
        raise NetworkError(f"{path}: cannot be read: {_line(error)}; export the network again") from None
    if not model.graph.node:
        raise NetworkError(f"{path}: holds no network (its graph has no nodes); export the trained network again")
    return model


def _line(error: Exception) -> str:
    """The text of a foreign error as one short line."""
    return " ".join(str(error).split())[:200] or type(error).__name__


@dataclass(frozen=True)
class _Step:
    """One link of the chain: a node, or a pattern of nodes named by its last one."""

    index: int
    node: NodeProto
    source: str  # the tensor that goes in
    apply: Callable[[_Chain, _Step], None]


class _Reader:
    """Finds the chain in a graph and walks it."""

    def __init__(self, path: Path, model: onnx.ModelProto):
        self.path = path
        self.model = model
        self.graph = model.graph
        self.opset = max((o.version for o in model.opset_import if o.domain in ("", "ai.onnx")), default=1)
        self.nodes = list(enumerate(self.graph.node, 1))
        self.producers = {name: (i, node) for i, node in self.nodes for name in node.output if name}
        self.constants: dict[str, NDArray[Any]] = {}

    def network(self) -> Network:
        self.check_operators()
        try:
            onnx.checker.check_model(self.model)
        except (onnx.checker.ValidationError, ValueError, RuntimeError) as error:
            raise self.error(f"not a valid model: {_line(error)}", "export the network again") from None
        self.read_constants()
        given, result = self.ends()
        steps = self.chain(given.name, result)
        chain = _Chain(self, *self.input_shape(given, steps))
        with np.errstate(all="ignore"):  # the network refuses what is not finite
            for step in steps:
                self.guard(step.index, step.node, step.apply, chain, step)
        if not chain.layers:
            raise self.error("no layer between input and output", "export the trained network again")
        net = Network(tuple(chain.layers), *self.trained_range(), str(self.path))
        return replace(net, source=self.path.name)

    # ---- errors ----

    def error(self, what: str, remedy: str) -> NetworkError:
        return NetworkError(f"{self.path}: {what}; {remedy}")

    def node_error(self, index: int, node: NodeProto, what: str, remedy: str) -> NetworkError:
        name = f" '{node.name}'" if node.name else ""
        return self.error(f"node {index}{name} ({node.op_type}): {what}", remedy)

    def guard(self, index: int, node: NodeProto, call: Callable[..., Any], *arguments: Any) -> Any:
        """call(*arguments), with whatever numpy says about its numbers turned into an error of this node."""
        try:
            return call(*arguments)
        except (ValueError, TypeError, LookupError, OverflowError, ZeroDivisionError) as error:
            raise self.node_error(index, node, _line(error), "mend the node, or export the network again") from None

    # ---- what the graph holds ----

    def check_operators(self) -> None:
        for index, node in self.nodes:
            home = "ai.onnx.ml" if node.op_type == "Scaler" else ""
            if node.op_type not in _SUPPORTED or (node.domain if node.domain != "ai.onnx" else "") != home:
                domain = f" of {node.domain}" if node.domain not in ("", "ai.onnx") else ""
                remedy = f"build the network from dense layers with {', '.join(_ACTIVATIONS)} and constant scaling"
                raise self.node_error(index, node, f"operator{domain} is not supported", remedy)
        if self.graph.sparse_initializer:
            raise self.error("has sparse weights", "export them dense")

    def read_constants(self) -> None:
        """Initializers, Constant nodes, and what follows from constants alone."""
        for tensor in self.graph.initializer:
            try:
                self.constants[tensor.name] = numpy_helper.to_array(tensor)
            except (ValueError, TypeError, KeyError, RuntimeError, OSError) as error:
                raise self.error(f"weights '{tensor.name}': {_line(error)}", "export the network again") from None
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
        value = attribute(node, name, None)
        return None if value is None else [int(i) for i in value]

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
            axes = [i for i, d in enumerate(shape) if d == 1] if axes is None else _positive(axes, rank)
            if any(shape[i] != 1 for i in axes):
                raise ValueError("cannot squeeze an axis that is not 1")
            return tuple(d for i, d in enumerate(shape) if i not in axes)
        if node.op_type == "Unsqueeze":
            axes = self.integers(node, 1, "axes") or []
            axes = _positive(axes, rank + len(axes))
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

    # ---- the chain ----

    def chain(self, first: str, last: str) -> list[_Step]:
        """The steps from the input tensor to the output tensor, in order of evaluation."""
        steps: list[_Step] = []
        name = last
        while name != first:
            if name in self.constants:
                raise self.error(f"its output '{last}' does not depend on its input", "export the network again")
            if name not in self.producers or len(steps) > len(self.nodes):
                raise self.error(f"no node computes the tensor '{name}' in order", "export the network again")
            index, node = self.producers[name]
            if name != node.output[0]:
                raise self.node_error(index, node, f"its second output '{name}' is used", _SIMPLIFY)
            steps.append(self.pattern(index, node) or self.plain(index, node))
            name = steps[-1].source
        return steps[::-1]

    def plain(self, index: int, node: NodeProto) -> _Step:
        if node.op_type in _COMPARISONS or node.op_type == "Where":
            what = "only a unit step or the Softplus pattern of PyTorch may compare or choose"
            raise self.node_error(index, node, what, "use one of the activations " + ", ".join(_ACTIVATIONS))
        signals = [name for name in node.input if name and name not in self.constants]
        if len(signals) != 1:
            names = ", ".join(f"'{name}'" for name in signals) or "none"
            what = f"needs one computed tensor, has {len(signals)} ({names}): the graph is not one chain"
            raise self.node_error(index, node, what, _SIMPLIFY)
        return _Step(index, node, signals[0], _Chain.plain)

    def producer(self, name: str, *operators: str) -> NodeProto | None:
        """The node behind a computed tensor, if it is one of these operators."""
        node = self.producers.get(name, (0, None))[1] if name not in self.constants else None
        return node if node is not None and node.op_type in operators else None

    def pattern(self, index: int, node: NodeProto) -> _Step | None:
        """The unit step or the Softplus of PyTorch that ends at this node."""
        if node.op_type not in ("Cast", "Where"):
            return None
        compare = self.producer(node.input[0], *_COMPARISONS)
        if compare is None:
            return None
        signals = [name for name in compare.input if name not in self.constants]
        if len(signals) != 1:
            return None
        if node.op_type == "Cast":
            return _Step(index, node, signals[0], lambda chain, step: chain.step(step, compare, 1.0, 0.0))
        if all(name in self.constants for name in node.input[1:]):
            high, low = (self.guard(index, node, self.single, index, node, name) for name in node.input[1:])
            return _Step(index, node, signals[0], lambda chain, step: chain.step(step, compare, high, low))
        return self.softplus(index, node, compare, signals[0])

    def softplus(self, index: int, node: NodeProto, compare: NodeProto, compared: str) -> _Step | None:
        """Where(Greater(x or b x, threshold), x, Softplus(b x) / b)."""
        scaled, divided = self.scaling(index, node.input[2])
        inner = self.producer(scaled, "Softplus")
        if inner is None:
            return None
        source, beta = self.scaling(index, inner.input[0])
        if node.input[1] != source or compare.op_type != "Greater" or compare.input[0] != compared or not beta > 0.0:
            return None
        threshold = self.guard(index, node, self.single, index, compare, compare.input[1])
        threshold *= {source: beta, inner.input[0]: 1.0}.get(compared, math.nan)
        if not (threshold >= _SOFTPLUS_EXACT and abs(divided * beta - 1.0) < 1e-6):
            return None
        return _Step(index, node, source, lambda chain, step: chain.softplus(beta, divided))

    def scaling(self, index: int, name: str) -> tuple[str, float]:
        """(tensor, factor) with which `name` = tensor * factor, looking back over one Mul or Div by a constant."""
        node = self.producer(name, "Mul", "Div")
        if node is None:
            return name, 1.0
        signal, other = node.input[:2]
        if node.op_type == "Mul" and signal in self.constants:
            signal, other = other, signal
        if signal in self.constants or other not in self.constants:
            return name, 1.0
        number = self.guard(index, node, self.single, index, node, other)
        if number == 0.0:
            return name, 1.0
        return signal, number if node.op_type == "Mul" else 1.0 / number

    def single(self, index: int, node: NodeProto, name: str) -> float:
        """A constant of one number."""
        return float(self.numbers(index, node, name).reshape(()))

    def input_shape(self, given: onnx.ValueInfoProto, steps: list[_Step]) -> tuple[Shape, int]:
        """Shape of the input, and the size of its batch (1 if it has none, a stand-in if it is unknown)."""
        kind = given.type.tensor_type
        if kind.elem_type not in _REALS:
            names = {v: k for k, v in TensorProto.DataType.items()}
            what = f"input '{given.name}' is {names.get(kind.elem_type, 'no tensor')}"
            raise self.error(what, "export with an input of float32 or float64")
        dims = [d.dim_value if d.HasField("dim_value") and d.dim_value > 0 else 0 for d in kind.shape.dim]
        if len(dims) not in (1, 2):
            raise self.error(f"input '{given.name}' has {len(dims)} axes", "export with an input [batch, n] or [n]")
        width = dims[-1] or next((w for w in map(self.width_wanted, steps) if w), 0)
        if not width:
            raise self.error(f"input '{given.name}' has an unknown length", "export with an input [batch, n], n fixed")
        if width > _WIDEST:
            raise self.error(f"input '{given.name}' has {width} values", f"export with at most {_WIDEST}")
        batch = 1 if len(dims) == 1 else dims[0] or _ANY_BATCH
        return (width,) if len(dims) == 1 else (batch, width), batch

    def width_wanted(self, step: _Step) -> int:
        """How many inputs a step wants; 0 if it says nothing."""
        node, sizes = step.node, [self.constants[n].shape for n in step.node.input if n in self.constants]
        if node.op_type == "Scaler":
            return len(attribute(node, "offset", [])) if len(attribute(node, "offset", [])) > 1 else 0
        if node.op_type == "Gemm" and sizes and len(sizes[0]) == 2:
            return sizes[0][1] if attribute(node, "transB", 0) else sizes[0][0]
        if node.op_type == "MatMul" and sizes and sizes[0] and node.input[0] == step.source:
            return sizes[0][0]
        if node.op_type in _ARITHMETIC and sizes and sizes[0] and sizes[0][-1] > 1:
            return sizes[0][-1]
        return 0


def attribute(node: NodeProto, name: str, default: Any) -> Any:
    """Value of an attribute."""
    return next((helper.get_attribute_value(a) for a in node.attribute if a.name == name), default)


def _positive(axes: list[int], rank: int) -> list[int]:
    """Axes counted from the front; ValueError if one does not exist or comes twice."""
    result = [a + rank if a < 0 else a for a in axes]
    if not all(0 <= a < rank for a in result) or len(set(result)) < len(result):
        raise ValueError(f"axes {axes} of {rank}")
    return result


class _Chain:
    """
    The layers so far, and the shape of what comes out of them: one batch axis of size `batch`, and `width` values for
    each of its rows, in order.
    """

    def __init__(self, reader: _Reader, shape: Shape, batch: int):
        self.reader = reader
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

    def plain(self, step: _Step) -> None:
        node, op = step.node, step.node.op_type
        if op in _ACTIVATIONS:
            self.activate(_ACTIVATIONS[op])
        elif op in ("Gemm", "MatMul"):
            self.dense(step)
        elif op == "Neg":
            self.multiply(np.full(self.width, -1.0))
        elif op == "Scaler":
            self.scaler(node)
        elif op in _ARITHMETIC:
            self.arithmetic(step)
        else:
            self.no_op(step)

    def arithmetic(self, step: _Step) -> None:
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
                    raise self.error(step, "divides by zero", "mend the scaling, a constant input has no deviation")
                self.multiply(1.0 / c)
            case _:
                raise self.error(step, "divides a constant by the signal, which is not linear", _SIMPLIFY)

    def dense(self, step: _Step) -> None:
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

    def gemm(self, step: _Step) -> None:
        node = step.node
        if node.input[0] != step.source or attribute(node, "transA", 0):
            raise self.error(step, "the signal must be its first factor, not transposed", _SIMPLIFY)
        w = self.constant(step, node.input[1])
        if w.ndim != 2 or len(self.shape) != 2:
            raise self.error(step, f"multiplies {self.seen(self.shape)} by {self.seen(w.shape)}", "use two matrices")
        w = w if attribute(node, "transB", 0) else w.T
        self.linear(step, w * attribute(node, "alpha", 1.0), (self.shape[0], w.shape[0]))
        if len(node.input) > 2 and node.input[2]:
            self.add(self.vector(self.constant(step, node.input[2]), None) * attribute(node, "beta", 1.0))

    def linear(self, step: _Step, w: NDArray[np.float64], shape: Shape) -> None:
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

    def no_op(self, step: _Step) -> None:
        """Nodes that leave all values and their order as they are."""
        node = step.node
        if node.op_type in ("Reshape", "Flatten", "Squeeze", "Unsqueeze"):
            if node.input[0] != step.source:
                raise self.error(step, "its shape is computed from the input", "export with constant shapes")
            shape = self.reader.reshaped(node, self.shape)
            self.batch_axis(shape)
            self.shape = shape
        elif node.op_type == "Transpose":
            order = _positive(list(attribute(node, "perm", range(len(self.shape))[::-1])), len(self.shape))
            shape = tuple(self.shape[i] for i in order)
            if [i for i in order if self.shape[i] != 1] != [i for i, d in enumerate(self.shape) if d != 1]:
                raise self.error(step, "changes the order of the values", _SIMPLIFY)
            self.shape = shape
        elif node.op_type == "Cast" and attribute(node, "to", 0) not in _REALS:
            raise self.error(step, "casts to another type than float or double", "export in float32 or float64")
        elif node.op_type == "Dropout":
            self.dropout(step)

    def dropout(self, step: _Step) -> None:
        mode = self.reader.constants.get(step.node.input[2]) if len(step.node.input) > 2 else None
        training = bool(mode.any()) if mode is not None else False
        if training or (self.reader.opset < 7 and not attribute(step.node, "is_test", 0)):
            raise self.error(step, "is in training mode", "export the network in evaluation mode")

    # ---- what patterns do ----

    def step(self, step: _Step, compare: NodeProto, high: float, low: float) -> None:
        """Unit step: the comparison of the signal with a constant c, exactly (also where they are equal)."""
        if (high, low) != (1.0, 0.0):
            raise self.error(step, f"chooses between {high:g} and {low:g}", "only the unit step 1 or 0 is known")
        if step.node.op_type == "Cast" and attribute(step.node, "to", 0) not in _REALS:
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
        elif self.width > _WIDEST:
            raise ValueError(f"an activation of {self.width} values without a dense layer before it")
        else:
            self.layers.append(Dense(np.eye(self.width), np.zeros(self.width), activation))
        self.open = ""

    def add(self, c: Vector) -> None:
        """y = x + c, merged with the layer before where nothing can cancel."""
        last = self.layers[-1] if self.layers else None
        if self.open == "bias":
            self.layers[-1] = replace(last, bias=c)
            self.open = ""
        elif self.open == "factor":  # (x + c1) + c2
            self.layers[-1] = replace(last, shift=last.shift - c)
        elif self.open == "shift":  # x f + c
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

    def constant(self, step: _Step, name: str) -> NDArray[np.float64]:
        return self.reader.numbers(step.index, step.node, name)

    def error(self, step: _Step, what: str, remedy: str) -> NetworkError:
        return self.reader.node_error(step.index, step.node, what, remedy)

    def seen(self, shape: Shape) -> str:
        """A shape as the user knows it."""
        return "[" + ", ".join("batch" if d == _ANY_BATCH else str(d) for d in shape) + "]"
