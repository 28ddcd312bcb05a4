# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Small ONNX files for the tests of the reader, and the two ways a test judges them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import NodeProto, TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from penode_gen.networks import Network, NetworkError
from penode_gen.reading.network_files import read_network

FLOAT, DOUBLE = TensorProto.FLOAT, TensorProto.DOUBLE
RNG = np.random.default_rng(0)
W1, B1, W2, B2 = RNG.normal(size=(3, 5)), RNG.normal(size=5), RNG.normal(size=(5, 2)), RNG.normal(size=2)
SHIFT, FACTOR = RNG.normal(size=3), RNG.uniform(0.5, 2.0, 3)

Constants = dict[str, NDArray[Any]]


def node(op: str, inputs: str, output: str, **attributes: Any) -> NodeProto:
    return helper.make_node(op, inputs.split(), output.split(), **attributes)


def model(
    nodes: list[NodeProto], constants: Constants, shape: list[Any] | None = None, dtype: int = DOUBLE, opset: int = 17, extra: str = ""
) -> onnx.ModelProto:
    """Graph from x to y. Constants of float64 take the type of the graph."""
    real = helper.tensor_dtype_to_np_dtype(dtype)
    typed = {n: c.astype(real if c.dtype == np.float64 else c.dtype) for n, c in constants.items()}
    tensors = [numpy_helper.from_array(c, n) for n, c in typed.items()]
    inputs = [helper.make_tensor_value_info("x", dtype, ["batch", 3] if shape is None else shape)]
    outputs = [helper.make_tensor_value_info(n, dtype, ["any"]) for n in ("y " + extra).split()]
    graph = helper.make_graph(nodes, "net", inputs, outputs, tensors)
    domains = [helper.make_opsetid("", opset), helper.make_opsetid("ai.onnx.ml", 3)]
    return helper.make_model(graph, opset_imports=domains, ir_version=9)


def save(folder: Path, made: onnx.ModelProto) -> Path:
    path = folder / "net.onnx"
    path.write_bytes(made.SerializeToString())
    return path


def same(folder: Path, made: onnx.ModelProto, x: NDArray[np.float64] | None = None) -> Network:
    """
    Read the model and compare it with onnx.reference; x are inputs, 20 rows of 3 if not given.

    The reference computes in the type of the graph, we in float64. All numbers here are of order 1 to 10, with less
    than 20 roundings on a path: 20 * 10 * 2 eps is the bound, for float (eps 1.2e-7) 5e-5, for double 9e-14.
    """
    net = read_network(save(folder, made))
    dtype = helper.tensor_dtype_to_np_dtype(made.graph.input[0].type.tensor_type.elem_type)
    rows = np.random.default_rng(1).uniform(-2.0, 2.0, (20, 3)).astype(dtype) if x is None else np.asarray(x, dtype)
    expected = ReferenceEvaluator(made).run(None, {"x": rows})[0]
    got = net.evaluate(rows)
    assert got.size == expected.size
    np.testing.assert_allclose(got.ravel(), expected.ravel(), rtol=0, atol=400 * np.finfo(expected.dtype).eps)
    return net


def refused(folder: Path, made: onnx.ModelProto, *parts: str) -> str:
    """The message with which the model is refused: one line with the file, all `parts`, and a remedy after a ';'."""
    with pytest.raises(NetworkError) as caught:
        read_network(save(folder, made))
    message = str(caught.value)
    assert message.startswith(f"{folder / 'net.onnx'}: ")
    assert "\n" not in message
    assert "; " in message
    for part in parts:
        assert part in message, message
    return message


MLP = [node("Gemm", "x w1 b1", "z"), node("Relu", "z", "h"), node("Gemm", "h w2 b2", "y")]
MLP_CONSTANTS: Constants = {"w1": W1, "b1": B1, "w2": W2, "b2": B2}
