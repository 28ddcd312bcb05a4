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
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
from google.protobuf.message import DecodeError
from onnx import NodeProto, TensorProto

from ..networks import Network, NetworkError
from . import onnx_rewrites
from .onnx_graph import ACTIVATIONS, ANY_BATCH, ARITHMETIC, COMPARISONS, REALS, SIMPLIFY, WIDEST, Graph, Shape, attribute, line
from .onnx_layers import Chain, Step

_SOFTPLUS_EXACT = 15.0  # from here on x and softplus(x) are the same float: log(1 + e^-15) is below half an ulp of 15


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
            raise NetworkError(f"{path}: no such file; correct the path in the model file") from None
        remedy = "keep the weight data (.data) file of the export beside it"
        raise NetworkError(f"{path}: weights in another file cannot be read: {line(error)}; {remedy}") from None
    except (ValueError, RuntimeError, TypeError) as error:
        raise NetworkError(f"{path}: cannot be read: {line(error)}; export the network again") from None
    if not model.graph.node:
        raise NetworkError(f"{path}: holds no network (its graph has no nodes); export the trained network again")
    return model


class _Reader(Graph):
    """Finds the chain in a graph and walks it."""

    def network(self) -> Network:
        self.check_operators()
        try:
            onnx.checker.check_model(self.model)
        except (onnx.checker.ValidationError, ValueError, RuntimeError) as error:
            raise self.error(f"not a valid model: {line(error)}", "export the network again") from None
        self.read_constants()
        given, result = self.ends()
        steps = self.chain(given.name, result)
        chain = Chain(self, *self.input_shape(given, steps))
        with np.errstate(all="ignore"):  # the network refuses what is not finite
            for step in steps:
                self.guard(step.index, step.node, step.apply, chain, step)
        if not chain.layers:
            raise self.error("no layer between input and output", "export the trained network again")
        net = Network(tuple(chain.layers), *self.trained_range(), str(self.path))
        return replace(net, source=self.path.name)

    # ---- the chain ----

    def chain(self, first: str, last: str) -> list[Step]:
        """The steps from the input tensor to the output tensor, in order of evaluation."""
        steps: list[Step] = []
        name = last
        while name != first:
            if name in self.constants:
                raise self.error(f"its output '{last}' does not depend on its input", "export the network again")
            if name not in self.producers or len(steps) > len(self.nodes):
                raise self.error(f"no node computes the tensor '{name}' in order", "export the network again")
            index, node = self.producers[name]
            if name != node.output[0]:
                raise self.node_error(index, node, f"its second output '{name}' is used", SIMPLIFY)
            steps.append(self.pattern(index, node) or self.plain(index, node))
            name = steps[-1].source
        return steps[::-1]

    def plain(self, index: int, node: NodeProto) -> Step:
        if node.op_type in COMPARISONS or node.op_type == "Where":
            what = "only a unit step or the Softplus pattern of PyTorch may compare or choose"
            raise self.node_error(index, node, what, "use one of the activations " + ", ".join(ACTIVATIONS))
        signals = [name for name in node.input if name and name not in self.constants]
        if len(signals) != 1:
            names = ", ".join(f"'{name}'" for name in signals) or "none"
            what = f"needs one computed tensor, has {len(signals)} ({names}): the graph is not one chain"
            raise self.node_error(index, node, what, SIMPLIFY)
        return Step(index, node, signals[0], Chain.plain)

    def pattern(self, index: int, node: NodeProto) -> Step | None:
        """The unit step or the Softplus of PyTorch that ends at this node."""
        if node.op_type not in ("Cast", "Where"):
            return None
        compare = self.producer(node.input[0], *COMPARISONS)
        if compare is None:
            return None
        signals = [name for name in compare.input if name not in self.constants]
        if len(signals) != 1:
            return None
        if node.op_type == "Cast":
            return Step(index, node, signals[0], lambda chain, step: chain.step(step, compare, 1.0, 0.0))
        if all(name in self.constants for name in node.input[1:]):
            high, low = (self.guard(index, node, self.single, index, node, name) for name in node.input[1:])
            return Step(index, node, signals[0], lambda chain, step: chain.step(step, compare, high, low))
        return self.softplus(index, node, compare, signals[0])

    def softplus(self, index: int, node: NodeProto, compare: NodeProto, compared: str) -> Step | None:
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
        return Step(index, node, source, lambda chain, step: chain.softplus(beta, divided))

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

    def input_shape(self, given: onnx.ValueInfoProto, steps: list[Step]) -> tuple[Shape, int]:
        """Shape of the input, and the size of its batch (1 if it has none, a stand-in if it is unknown)."""
        kind = given.type.tensor_type
        if kind.elem_type not in REALS:
            names = {v: k for k, v in TensorProto.DataType.items()}
            what = f"input '{given.name}' is {names.get(kind.elem_type, 'no tensor')}"
            raise self.error(what, "export with an input of float32 or float64")
        dims = [d.dim_value if d.HasField("dim_value") and d.dim_value > 0 else 0 for d in kind.shape.dim]
        if len(dims) not in (1, 2):
            raise self.error(f"input '{given.name}' has {len(dims)} axes", "export with an input [batch, n] or [n]")
        width = dims[-1] or next((w for w in map(self.width_wanted, steps) if w), 0)
        if not width:
            raise self.error(f"input '{given.name}' has an unknown length", "export with an input [batch, n], n fixed")
        if width > WIDEST:
            raise self.error(f"input '{given.name}' has {width} values", f"export with at most {WIDEST}")
        batch = 1 if len(dims) == 1 else dims[0] or ANY_BATCH
        return (width,) if len(dims) == 1 else (batch, width), batch

    def width_wanted(self, step: Step) -> int:
        """How many inputs a step takes; 0 if it does not state that."""
        node = step.node
        sizes: list[Shape] = [self.constants[n].shape for n in node.input if n in self.constants]
        if node.op_type == "Scaler":
            offsets: list[float] = attribute(node, "offset", [])
            return len(offsets) if len(offsets) > 1 else 0
        if node.op_type == "Gemm" and sizes and len(sizes[0]) == 2:
            return sizes[0][1] if attribute(node, "transB", 0) else sizes[0][0]
        if node.op_type == "MatMul" and sizes and sizes[0] and node.input[0] == step.source:
            return sizes[0][0]
        if node.op_type in ARITHMETIC and sizes and sizes[0] and sizes[0][-1] > 1:
            return sizes[0][-1]
        return 0
