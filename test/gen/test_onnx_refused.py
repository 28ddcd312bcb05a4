# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the ONNX reader refuses, and with which words."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st
from onnx import NodeProto, TensorProto, helper, numpy_helper
from onnx_graphs import B1, MLP, MLP_CONSTANTS, SHIFT, W1, Constants, model, node, refused, save

from penode_gen.networks import NetworkError
from penode_gen.reading.network_files import read_network

W = {"w": W1}


@pytest.mark.parametrize(
    ("nodes", "constants", "parts"),
    [
        # operators
        ([node("Elu", "x", "y", name="act")], {}, ["node 1 'act' (Elu)", "not supported", "Relu, Tanh"]),
        ([node("Gemm", "x w", "a"), node("Softmax", "a", "y")], W, ["node 2 (Softmax)", "not supported"]),
        ([node("Relu", "x", "y", domain="com.corp")], {}, ["node 1 (Relu)", "of com.corp is not supported"]),
        ([node("Scaler", "x", "y")], {}, ["node 1 (Scaler)", "not supported"]),
        ([node("Shape", "x", "s"), node("Reshape", "x s", "y")], {}, ["node 1 (Shape)"]),
        # graphs that are no chain
        ([node("Relu", "x", "a"), node("Add", "a x", "y")], {}, ["node 2 (Add)", "'a', 'x'", "not one chain"]),
        ([node("Mul", "x x", "y")], {}, ["node 1 (Mul)", "not one chain"]),
        ([node("Gemm", "x w x", "y")], {"w": np.eye(3)}, ["node 1 (Gemm)", "not one chain"]),
        ([node("Relu", "c", "y")], {"c": SHIFT}, ["node 1 (Relu)", "has 0 (none)"]),
        ([node("Identity", "c", "y")], {"c": SHIFT}, ["does not depend on its input"]),
        ([node("Dropout", "x", "a m"), node("Cast", "m", "y", to=TensorProto.DOUBLE)], {}, ["second output 'm'"]),
        ([node("Identity", "x", "y")], {}, ["no layer between input and output"]),
        # arithmetic
        ([node("Div", "c x", "y")], {"c": SHIFT}, ["node 1 (Div)", "not linear"]),
        ([node("Div", "x c", "y")], {"c": np.array([1.0, 0.0, 1.0])}, ["node 1 (Div)", "divides by zero"]),
        ([node("Div", "x c", "y")], {"c": np.array([1e-320])}, ["layer 1", "NaN or infinite"]),
        ([node("Greater", "x c", "a"), node("Where", "a x c", "y")], {"c": SHIFT}, ["node 2 (Where)", "unit step"]),
        ([node("Less", "x c", "a"), node("Where", "a k c", "y")], {"c": np.zeros(1), "k": np.ones(1) * 2}, ["2 and 0"]),
        # numbers
        ([node("Gemm", "x w", "y")], {"w": np.full((3, 5), np.nan)}, ["node 1 (Gemm)", "NaN or Inf in 'w'"]),
        ([node("Add", "x c", "y")], {"c": np.array([np.inf])}, ["node 1 (Add)", "NaN or Inf in 'c'"]),
        # shapes
        ([node("Gemm", "x w", "y")], {"w": W1.T}, ["node 1 (Gemm)", "5 values go in", "[batch, 3]"]),
        ([node("MatMul", "x w", "y")], {"w": np.ones((1, 3, 4))}, ["node 1 (MatMul)", "two axes"]),
        ([node("MatMul", "w x", "y")], {"w": np.eye(3)}, ["node 1 (MatMul)", "before the signal"]),
        ([node("Gemm", "w x", "y")], {"w": np.eye(3)}, ["node 1 (Gemm)", "first factor"]),
        ([node("Gemm", "x w", "y", transA=1)], W, ["node 1 (Gemm)", "not transposed"]),
        ([node("Gemm", "x w b", "y")], {"w": W1, "b": np.ones((2, 5))}, ["node 1 (Gemm)", "rows of a batch"]),
        ([node("Gemm", "x w b", "y")], {"w": W1, "b": np.ones(4)}, ["node 1 (Gemm)", "does not fit"]),
        ([node("Add", "x c", "y")], {"c": np.ones(2)}, ["node 1 (Add)", "[2]", "[batch, 3]", "does not fit"]),
        ([node("Add", "x c", "y")], {"c": np.ones((4, 1))}, ["node 1 (Add)", "rows of a batch"]),
        ([node("MatMul", "x w", "a"), node("Add", "a c", "y")], {"w": W1[:, :1], "c": np.ones(4)}, ["node 2 (Add)"]),
        ([node("Reshape", "x s", "y")], {"s": np.array([-1])}, ["node 1 (Reshape)", "rows of a batch"]),
        ([node("Reshape", "x s", "y")], {"s": np.array([1, 3])}, ["node 1 (Reshape)", "batch of any size"]),
        ([node("Reshape", "x s", "y")], {"s": np.array([0, 0, 0])}, ["node 1 (Reshape)"]),
        ([node("Reshape", "s x", "y")], {"s": np.array([1, 3])}, ["node 1 (Reshape)"]),
        ([node("Flatten", "x", "y", axis=0)], {}, ["node 1 (Flatten)", "rows of a batch"]),
        ([node("Flatten", "x", "y", axis=5)], {}, ["node 1 (Flatten)", "axis 5 of 2"]),
        ([node("Squeeze", "x s", "y")], {"s": np.array([1])}, ["node 1 (Squeeze)", "not 1"]),
        ([node("Unsqueeze", "x s", "y")], {"s": np.array([7])}, ["node 1 (Unsqueeze)", "axes"]),
        ([node("Transpose", "x", "y")], {}, ["node 1 (Transpose)", "order of the values"]),
        # types
        ([node("Cast", "x", "y", to=TensorProto.FLOAT16)], {}, ["node 1 (Cast)", "float or double"]),
        ([node("Add", "x c", "y")], {"c": np.array([1, 2, 3])}, ["node 1 (Add)", "int64", "float32 or float64"]),
        ([node("Add", "x c", "y")], {"c": SHIFT.astype(np.float16)}, ["node 1 (Add)", "float16"]),
        ([node("Dropout", "x r t", "y")], {"r": np.array(0.5), "t": np.array(True)}, ["node 1 (Dropout)", "training"]),
    ],
)
def test_graph_is_refused(tmp_path: Path, nodes: list[NodeProto], constants: Constants, parts: list[str]) -> None:
    refused(tmp_path, model(nodes, constants), *parts)


def test_more_than_one_input_or_output(tmp_path: Path) -> None:
    made = model(MLP, MLP_CONSTANTS, extra="z")
    refused(tmp_path, made, "has 2 outputs ('y', 'z')")
    made = model([node("Gemm", "x w1 more", "y")], {"w1": W1})
    made.graph.input.append(helper.make_tensor_value_info("more", TensorProto.DOUBLE, [5]))
    refused(tmp_path, made, "has 2 inputs ('x', 'more')")


@pytest.mark.parametrize("shape", [[], [1, 2, 3], ["batch", 1, 3]])
def test_input_of_other_rank(tmp_path: Path, shape: list[Any]) -> None:
    refused(tmp_path, model([node("Relu", "x", "y")], {}, shape=shape), f"{len(shape)} axes", "[batch, n]")


def test_input_of_damaged_size(tmp_path: Path) -> None:
    refused(tmp_path, model([node("Neg", "x", "y")], {}, shape=["batch", 2**40]), "input 'x' has 1099511627776 values", "at most 4096")


@pytest.mark.parametrize("name", ["FLOAT16", "BFLOAT16", "INT32", "INT64"])
def test_input_of_other_type(tmp_path: Path, name: str) -> None:
    made = model([node("Relu", "x", "y")], {}, dtype=getattr(TensorProto, name))
    refused(tmp_path, made, f"input 'x' is {name}", "float32 or float64")


def test_file_that_is_none(tmp_path: Path) -> None:
    path = tmp_path / "net.onnx"
    with pytest.raises(NetworkError, match=r"net\.onnx: no such file; "):
        read_network(path)
    path.mkdir()
    with pytest.raises(NetworkError, match=r"net\.onnx: no such file; "):
        read_network(path)


def test_model_without_nodes(tmp_path: Path) -> None:
    (tmp_path / "net.onnx").write_bytes(b"")
    with pytest.raises(NetworkError, match="holds no network"):
        read_network(tmp_path / "net.onnx")


def test_weights_shorter_than_their_shape(tmp_path: Path) -> None:
    made = model(MLP, MLP_CONSTANTS)
    made.graph.initializer[0].raw_data = made.graph.initializer[0].raw_data[:-8]
    refused(tmp_path, made)


def test_weights_of_no_known_type(tmp_path: Path) -> None:
    made = model(MLP, MLP_CONSTANTS)
    made.graph.initializer[0].data_type = 65
    refused(tmp_path, made)


def test_sparse_weights(tmp_path: Path) -> None:
    made = model([node("Gemm", "x w", "y")], {})
    values = numpy_helper.from_array(np.ones(1), "w")
    indices = helper.make_tensor("i", TensorProto.INT64, [1], [0])
    made.graph.sparse_initializer.append(helper.make_sparse_tensor(values, indices, [3, 5]))
    refused(tmp_path, made, "sparse")


GOOD_NODES = [node("Sub", "x s", "h"), node("Gemm", "h w1 b1", "z"), *MLP[1:]]
GOOD = model(GOOD_NODES, MLP_CONSTANTS | {"s": SHIFT}).SerializeToString()


@settings(max_examples=500, deadline=None)
@example(cut=0, changes=[(75, 10)])  # a line feed in the name of an operator
@given(cut=st.integers(0, len(GOOD)), changes=st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)), max_size=4))
def test_broken_file_never_ends_in_another_exception(tmp_path_factory: Any, cut: int, changes: list[tuple[int, int]]) -> None:
    content = bytearray(GOOD)
    for at, value in changes:
        content[at] = value
    path = tmp_path_factory.mktemp("broken") / "net.onnx"
    path.write_bytes(bytes(content if changes else content[:cut]))
    try:
        net = read_network(path)
    except NetworkError as error:
        assert "\n" not in str(error)
    else:  # a changed weight or name is still a network
        assert net.evaluate(np.zeros(net.n_inputs)).shape == (net.n_outputs,)


def test_bias_of_a_constant_network_is_kept(tmp_path: Path) -> None:
    # weights of zero are legal: the network is its bias
    net = read_network(save(tmp_path, model([node("Gemm", "x w b", "y")], {"w": 0.0 * W1, "b": B1})))
    assert net.evaluate([1.0, 2.0, 3.0]).tolist() == B1.tolist()
