# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The ONNX reader against onnx.reference, with files made here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from onnx import NodeProto, TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator
from onnx_graphs import B1, B2, DOUBLE, FACTOR, FLOAT, MLP, MLP_CONSTANTS, RNG, SHIFT, W1, W2, Constants, model, node, refused, same, save

from penode_gen.networks import Affine, Dense, NetworkError
from penode_gen.reading.network_files import read_network

# ---- dense layers ----


@pytest.mark.parametrize("dtype", [FLOAT, DOUBLE])
def test_gemm_network(tmp_path: Path, dtype: int) -> None:
    net = same(tmp_path, model(MLP, MLP_CONSTANTS, dtype=dtype))
    assert net.architecture == (("dense", "relu", 3, 5), ("dense", "identity", 5, 2))
    assert (net.source, net.n_parameters, net.input_min) == ("net.onnx", 32, None)


def test_weights_are_taken_over_exactly(tmp_path: Path) -> None:
    net = same(tmp_path, model(MLP, MLP_CONSTANTS, dtype=FLOAT))
    first = net.layers[0]
    assert isinstance(first, Dense)
    np.testing.assert_array_equal(first.weights, W1.T.astype(np.float32).astype(np.float64))
    np.testing.assert_array_equal(first.bias, B1.astype(np.float32).astype(np.float64))


@pytest.mark.parametrize("activation", ["Relu", "Tanh", "Sigmoid", "Softplus"])
def test_matmul_with_bias_in_either_order(tmp_path: Path, activation: str) -> None:
    nodes = [
        node("MatMul", "x w1", "a"),
        node("Add", "b1 a", "b"),
        node(activation, "b", "c"),
        node("MatMul", "c w2", "d"),
        node("Add", "d b2", "y"),
    ]
    net = same(tmp_path, model(nodes, MLP_CONSTANTS))
    assert net.architecture == (("dense", activation.lower(), 3, 5), ("dense", "identity", 5, 2))


@pytest.mark.parametrize("attributes", [{}, {"alpha": 0.5}, {"beta": 0.25}, {"alpha": -2.0, "beta": 0.0, "transB": 1}])
@pytest.mark.parametrize("bias", [None, [], [1], [5], [1, 5], [1, 1]])
def test_gemm_attributes_and_bias_shapes(tmp_path: Path, attributes: dict[str, Any], bias: list[int] | None) -> None:
    constants = {"w": W1.T if "transB" in attributes else W1}
    if bias is not None:
        constants["c"] = RNG.normal(size=bias)
    net = same(tmp_path, model([node("Gemm", "x w c" if "c" in constants else "x w", "y", **attributes)], constants))
    assert net.architecture == (("dense", "identity", 3, 5),)


def test_second_addition_is_no_bias(tmp_path: Path) -> None:
    nodes = [node("MatMul", "x w1", "a"), node("Add", "a b1", "b"), node("Add", "b b1", "y")]
    net = same(tmp_path, model(nodes, {"w1": W1, "b1": B1}))
    assert net.architecture == (("dense", "identity", 3, 5), ("affine", "centre", 5))


def test_activations_without_a_dense_layer(tmp_path: Path) -> None:
    net = same(tmp_path, model([node("Tanh", "x", "a"), node("Relu", "a", "y")], {}))
    assert net.architecture == (("dense", "tanh", 3, 3), ("dense", "relu", 3, 3))


@pytest.mark.parametrize(
    ("nodes", "constants"),
    [
        ([node("MatMul", "x w", "a"), node("Tanh", "a", "y")], {"w": W1}),
        ([node("MatMul", "w x", "a"), node("Tanh", "a", "y")], {"w": W1.T}),
        ([node("MatMul", "x v", "y")], {"v": SHIFT}),
        ([node("Mul", "x v", "a"), node("Unsqueeze", "a i", "b"), node("Gemm", "b w", "y")], {"v": SHIFT, "i": np.array([0]), "w": W1}),
        ([node("Mul", "x row", "a"), node("Gemm", "a w", "y")], {"row": SHIFT[np.newaxis, :], "w": W1}),
    ],
)
def test_input_of_one_axis(tmp_path: Path, nodes: list[NodeProto], constants: Constants) -> None:
    for x in RNG.normal(size=(5, 3)):
        same(tmp_path, model(nodes, constants, shape=[3]), x)


# ---- scaling ----


@pytest.mark.parametrize(
    ("nodes", "forms"),
    [
        ([node("Sub", "x s", "a"), node("Div", "a f", "y")], ["centre"]),
        ([node("Sub", "x s", "a"), node("Mul", "f a", "y")], ["centre"]),
        ([node("Add", "s x", "a"), node("Mul", "a f", "y")], ["centre"]),
        ([node("Mul", "x f", "a"), node("Add", "a s", "y")], ["rescale"]),
        ([node("Div", "x f", "a"), node("Sub", "a s", "y")], ["rescale"]),
        ([node("Sub", "s x", "y")], ["rescale"]),
        ([node("Neg", "x", "a"), node("Add", "a s", "y")], ["rescale"]),
        ([node("Neg", "x", "y")], ["rescale"]),
        ([node("Add", "x one", "y")], ["centre"]),
        ([node("Mul", "x one", "y")], ["rescale"]),
        ([node("Sub", "x s", "a"), node("Sub", "a f", "y")], ["centre"]),
        ([node("Sub", "x s", "a"), node("Div", "a f", "b"), node("Mul", "b f", "c"), node("Add", "c s", "y")], ["centre", "centre"]),
        ([node("Mul", "x f", "a"), node("Add", "a s", "b"), node("Mul", "b f", "c"), node("Add", "c s", "y")], ["rescale"]),
    ],
)
def test_scaling_merges_into_few_layers(tmp_path: Path, nodes: list[NodeProto], forms: list[str]) -> None:
    net = same(tmp_path, model(nodes, {"s": SHIFT, "f": FACTOR, "one": np.array(1.5)}))
    assert [layer.form for layer in net.layers if isinstance(layer, Affine)] == forms


def test_centring_keeps_the_digits_of_large_offsets(tmp_path: Path) -> None:
    # (x - 1e8) * 8 at x = 1e8 + 2^-20: exact if the difference is taken first; x * 8 - 8e8 would lose half the bits
    nodes = [node("Sub", "x s", "a"), node("Mul", "a f", "y")]
    net = read_network(save(tmp_path, model(nodes, {"s": np.array([1e8]), "f": np.array([8.0])}, shape=[None, 1])))
    assert net.evaluate([1e8 + 2.0**-20]).tolist() == [2.0**-17]


def test_sets_with_other_numbers_have_the_same_architecture(tmp_path: Path) -> None:
    nodes = [node("Sub", "x s", "a"), node("Div", "a f", "b"), node("Gemm", "b w", "c"), node("Mul", "c k", "y")]
    nets = [
        read_network(save(tmp_path, model(nodes, {"s": s, "f": f, "w": W1, "k": k})))
        for s, f, k in ((np.zeros(3), np.ones(3), np.array(1.0)), (SHIFT, FACTOR, np.array(3.0)))
    ]
    assert nets[0].architecture == nets[1].architecture


def test_alignment_of_old_files(tmp_path: Path) -> None:
    # before version 7 an attribute said which axis of the first operand a constant starts at
    nodes = [node("Unsqueeze", "x", "a", axes=[2]), node("Add", "a s", "b", broadcast=1, axis=1), node("Squeeze", "b", "y", axes=[2])]
    net = read_network(save(tmp_path, model(nodes, {"s": SHIFT}, opset=6)))
    assert net.evaluate([1.0, 2.0, 3.0]).tolist() == [1.0 + SHIFT[0], 2.0 + SHIFT[1], 3.0 + SHIFT[2]]


def test_scaler_of_the_ml_domain(tmp_path: Path) -> None:
    for offset, scale in ((SHIFT, FACTOR), (SHIFT[:1], FACTOR), (SHIFT, FACTOR[:1])):
        nodes = [node("Scaler", "x", "a", domain="ai.onnx.ml", offset=offset.tolist(), scale=scale.tolist())]
        nodes.append(node("Gemm", "a w", "y"))
        # its attributes are float: offsets and factors of order 1 carry 6e-8, three products of order 1 below 1e-5
        net = read_network(save(tmp_path, model(nodes, {"w": W1}, dtype=FLOAT)))
        x = RNG.normal(size=(6, 3))
        np.testing.assert_allclose(net.evaluate(x), ((x - offset) * scale) @ W1, rtol=0, atol=1e-5)
        assert net.architecture[0] == ("affine", "centre", 3)


# ---- operators that change nothing ----


@pytest.mark.parametrize(
    "nodes",
    [
        [node("Identity", "x", "a")],
        [node("Flatten", "x", "a")],
        [node("Reshape", "x full", "a")],
        [node("Reshape", "x copy", "a")],
        [node("Unsqueeze", "x one", "b"), node("Squeeze", "b one", "a")],
        [node("Unsqueeze", "x one", "b"), node("Squeeze", "b", "a")],
        [node("Unsqueeze", "x last", "b"), node("Flatten", "b", "a")],
        [node("Reshape", "x deep", "b"), node("Relu", "b", "c"), node("Reshape", "c full", "a")],
        [node("Unsqueeze", "x zero", "b"), node("Add", "b s", "c"), node("Squeeze", "c zero", "a")],
        [node("Unsqueeze", "x one", "b"), node("Transpose", "b", "c", perm=[1, 0, 2]), node("Squeeze", "c zero", "a")],
        [node("Cast", "x", "b", to=FLOAT), node("Cast", "b", "a", to=DOUBLE)],
        [node("Dropout", "x", "a")],
        [node("Dropout", "x ratio false", "a")],
        [node("Dropout", "x", "a mask")],
    ],
)
def test_no_ops_are_dropped(tmp_path: Path, nodes: list[NodeProto]) -> None:
    constants = {
        "w": W1,
        "s": SHIFT,
        "full": np.array([-1, 3]),
        "copy": np.array([0, -1]),
        "deep": np.array([0, 3, 1, -1]),
        "zero": np.array([0]),
        "one": np.array([1]),
        "last": np.array([-1]),
        "ratio": np.array(0.5),
        "false": np.array(False),
    }
    x = np.random.default_rng(1).integers(-8, 8, (20, 3)) / 4.0  # a cast to float changes none of these
    same(tmp_path, model([*nodes, node("Gemm", "a w", "y")], constants), x)


@pytest.mark.parametrize("tail", [[node("Squeeze", "z one", "y")], [node("Reshape", "z flat", "y")]])
def test_output_without_its_axis_of_one(tmp_path: Path, tail: list[NodeProto]) -> None:
    constants = {"w": W1[:, :1], "one": np.array([1]), "flat": np.array([-1])}
    assert same(tmp_path, model([node("Gemm", "x w", "z"), *tail], constants)).n_outputs == 1


def test_scalars_may_go_on_without_their_axis(tmp_path: Path) -> None:
    nodes = [
        node("MatMul", "x v", "a"),
        node("Mul", "a two", "b"),
        node("Tanh", "b", "c"),
        node("Unsqueeze", "c last", "d"),
        node("MatMul", "d w", "y"),
    ]
    same(tmp_path, model(nodes, {"v": SHIFT, "two": np.array([2.0]), "last": np.array([-1]), "w": W1[:1]}))


def test_fixed_batch(tmp_path: Path) -> None:
    nodes = [node("Reshape", "x one", "a"), node("Gemm", "a w", "y")]
    same(tmp_path, model(nodes, {"one": np.array([1, 3]), "w": W1}, shape=[1, 3]), np.ones((1, 3)))
    same(tmp_path, model(nodes, {"one": np.array([4, 3]), "w": W1}, shape=[4, 3]), np.ones((4, 3)))


# ---- constants ----


def test_weights_behind_constant_nodes_and_constant_operators(tmp_path: Path) -> None:
    nodes = [
        node("Transpose", "w1t", "w1", perm=[1, 0]),
        helper.make_node("Constant", [], ["raw"], value=numpy_helper.from_array(B1.astype(np.float32))),
        node("Cast", "raw", "b1", to=DOUBLE),
        node("Reshape", "w2flat", "w2"),
        node("Identity", "b2same", "b2"),
        *MLP,
    ]
    nodes[3] = node("Reshape", "w2flat shape", "w2")
    constants = {"w1t": W1.T, "w2flat": W2.ravel(), "shape": np.array([5, 2]), "b2same": B2}
    same(tmp_path, model(nodes, constants))


def test_arithmetic_of_constants_has_their_precision(tmp_path: Path) -> None:
    # 1/3 in float, not in double, is what the file says
    nodes = [node("Div", "one three", "third"), node("Mul", "x third", "y")]
    constants = {"one": np.array([1.0]), "three": np.array([3.0])}
    net = read_network(save(tmp_path, model(nodes, constants, shape=[None, 1], dtype=FLOAT)))
    assert net.evaluate([1.0]).tolist() == [float(np.float32(1) / np.float32(3))]


def test_initializers_may_be_listed_as_inputs(tmp_path: Path) -> None:
    made = model(MLP, MLP_CONSTANTS)
    for tensor in made.graph.initializer:
        made.graph.input.append(helper.make_tensor_value_info(tensor.name, DOUBLE, list(tensor.dims)))
    same(tmp_path, made)


def test_unknown_length_follows_from_the_weights(tmp_path: Path) -> None:
    same(tmp_path, model([node("Identity", "x", "i"), node("Gemm", "i w1", "y")], {"w1": W1}, shape=["batch", "n"]))
    nodes = [node("Sub", "x s", "i"), node("MatMul", "i w1", "y")]
    same(tmp_path, model(nodes, {"s": SHIFT, "w1": W1}, shape=[None, None]))
    refused(tmp_path, model([node("Relu", "x", "y")], {}, shape=["batch", "n"]), "unknown length", "n fixed")


def test_external_weights(tmp_path: Path) -> None:
    path = tmp_path / "net.onnx"
    made = model(MLP, MLP_CONSTANTS)
    onnx.save(made, path, save_as_external_data=True, location="net.onnx.data", size_threshold=0)
    x = RNG.normal(size=(4, 3))
    expected = np.maximum(x @ W1 + B1, 0.0) @ W2 + B2
    np.testing.assert_allclose(read_network(path).evaluate(x), expected, rtol=0, atol=400 * np.finfo(float).eps)
    data = tmp_path / "net.onnx.data"
    data.write_bytes(data.read_bytes()[:40])
    with pytest.raises(NetworkError, match=r"net\.onnx: .*; ") as caught:
        read_network(path)
    assert "\n" not in str(caught.value)
    data.unlink()
    with pytest.raises(NetworkError, match=r"net.onnx: weights in another file.*net.onnx.data.*keep the weight data"):
        read_network(path)


def test_external_weights_outside_of_the_folder_are_refused(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(bytes(1000))
    (tmp_path / "in").mkdir()
    made = model(MLP, MLP_CONSTANTS)
    onnx.external_data_helper.convert_model_to_external_data(made, size_threshold=0, location="../secret")
    for tensor in made.graph.initializer:
        tensor.ClearField("raw_data")
        tensor.data_location = TensorProto.EXTERNAL
    refused(tmp_path / "in", made, "weights in another file")


# ---- trained range ----


def test_trained_range_from_metadata(tmp_path: Path) -> None:
    made = model(MLP, MLP_CONSTANTS)
    helper.set_model_props(made, {"penode.input_min": "-1,-2.5, 0", "penode.input_max": "1,2.5,1e3", "other": "x"})
    net = read_network(save(tmp_path, made))
    assert (net.input_min.tolist(), net.input_max.tolist()) == ([-1.0, -2.5, 0.0], [1.0, 2.5, 1000.0])


@pytest.mark.parametrize(
    ("low", "high", "part"),
    [
        ("0,0,0", None, "only one of minimum and maximum"),
        ("0,0", "1,1", "needs 3 minima and maxima, has 2 and 2"),
        ("0,0,zero", "1,1,1", "metadata penode.input_min = '0,0,zero'"),
        ("0,0,nan", "1,1,1", "every minimum must be finite"),
        ("", "1,1,1", "metadata penode.input_min = ''"),
    ],
)
def test_faulty_range_is_refused(tmp_path: Path, low: str | None, high: str | None, part: str) -> None:
    made = model(MLP, MLP_CONSTANTS)
    bounds = {"penode.input_min": low, "penode.input_max": high}
    helper.set_model_props(made, {key: text for key, text in bounds.items() if text is not None})
    with pytest.raises(NetworkError) as caught:
        read_network(save(tmp_path, made))
    assert part in str(caught.value)


# ---- patterns ----


def torch_softplus(beta: float, threshold: float, compared: str) -> tuple[list[NodeProto], Constants]:
    nodes = [
        node("Mul", "x beta", "bx"),
        node("Softplus", "bx", "s"),
        node("Div", "s beta", "d"),
        node("Greater", f"{compared} threshold", "c"),
        node("Where", "c x d", "y"),
    ]
    return nodes, {"beta": np.array(beta), "threshold": np.array(threshold)}


@pytest.mark.parametrize(("beta", "compared"), [(1.0, "x"), (1.0, "bx"), (2.0, "bx"), (0.75, "x")])
def test_softplus_of_pytorch(tmp_path: Path, beta: float, compared: str) -> None:
    nodes, constants = torch_softplus(beta, 40.0, compared)
    # above the threshold of 30 the two branches differ by e^-30 = 1e-13 at most
    x = np.linspace(-60.0, 60.0, 60).reshape(20, 3)
    net = read_network(save(tmp_path, model(nodes, constants)))
    expected = ReferenceEvaluator(model(nodes, constants)).run(None, {"x": x})[0]
    np.testing.assert_allclose(net.evaluate(x), expected, rtol=1e-14, atol=1e-12)
    assert (net.architecture == (("dense", "softplus", 3, 3),)) == (beta == 1.0)


@pytest.mark.parametrize(
    ("beta", "threshold", "change"), [(1.0, 5.0, {}), (-1.0, 40.0, {}), (0.0, 40.0, {}), (1.0, 40.0, {2: node("Mul", "s four", "d")})]
)
def test_softplus_that_is_none_is_refused(tmp_path: Path, beta: float, threshold: float, change: dict[int, NodeProto]) -> None:
    nodes, constants = torch_softplus(beta, threshold, "bx")
    for i, other in change.items():
        nodes[i] = other
    refused(tmp_path, model(nodes, constants | {"four": np.array(4.0)}), "node 5 (Where)")


@pytest.mark.parametrize("op", ["Greater", "GreaterOrEqual", "Less", "LessOrEqual"])
@pytest.mark.parametrize("order", ["x c", "c x"])
@pytest.mark.parametrize("c", [0.0, 0.5])
@pytest.mark.parametrize("tail", [node("Cast", "b", "y", to=DOUBLE), node("Where", "b one zero", "y")])
def test_unit_step_is_exact_also_at_its_edge(tmp_path: Path, op: str, order: str, c: float, tail: NodeProto) -> None:
    constants = {"c": np.array(c), "one": np.array(1.0), "zero": np.array(0.0)}
    x = np.array([[c, np.nextafter(c, 9.0), np.nextafter(c, -9.0)], [-1.0, 2.0, -0.0]])
    same(tmp_path, model([node(op, order, "b"), tail], constants), x)


def test_step_of_a_dense_layer_is_one_layer(tmp_path: Path) -> None:
    nodes = [node("Gemm", "x w1 b1", "z"), node("GreaterOrEqual", "z zero", "b"), node("Cast", "b", "y", to=DOUBLE)]
    net = same(tmp_path, model(nodes, {"w1": W1, "b1": B1, "zero": np.array(0.0)}))
    assert net.architecture == (("dense", "step", 3, 5),)


# ---- random networks ----


OPERATORS = "Gemm GemmT MatMul Add Sub Mul Div Add' Sub' Relu Tanh Sigmoid Softplus Reshape Neg".split()  # ': c first


@st.composite
def graphs(draw: st.DrawFn) -> tuple[onnx.ModelProto, int]:
    """A random chain of supported operators and the number of its inputs."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    width = n = draw(st.integers(1, 6))
    nodes: list[NodeProto] = []
    constants: Constants = {"full": np.array([0, -1])}

    def constant(*shape: int) -> str:
        name = f"c{len(constants)}"
        constants[name] = rng.uniform(0.5, 1.5, shape) * rng.choice([-1.0, 1.0], shape) / np.sqrt(max(shape, default=1))
        return name

    for i in range(draw(st.integers(1, 9))):
        op = draw(st.sampled_from(OPERATORS))
        x, y = (f"t{i}" if i else "x"), f"t{i + 1}"
        if op in ("Gemm", "GemmT", "MatMul"):
            new = draw(st.integers(1, 6))
            if op == "MatMul":
                nodes.append(node("MatMul", f"{x} {constant(width, new)}", y))
            else:
                w = constant(new, width) if op == "GemmT" else constant(width, new)
                bias = draw(st.sampled_from(["", constant(new), constant(1, new), constant(1)]))
                nodes.append(node("Gemm", f"{x} {w} {bias}".strip(), y, transB=int(op == "GemmT"), alpha=0.5, beta=1.5))
            width = new
        elif op.rstrip("'") in ("Add", "Sub", "Mul", "Div"):
            c = draw(st.sampled_from([constant(width), constant(1, width), constant(1), constant()]))
            nodes.append(node(op.rstrip("'"), f"{c} {x}" if op.endswith("'") else f"{x} {c}", y))
        else:
            nodes.append(node(op, f"{x} full" if op == "Reshape" else x, y))
    nodes.append(node("Neg", nodes[-1].output[0], "y"))
    return model(nodes, constants, shape=["batch", n]), n


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(case=graphs())
def test_random_networks(tmp_path_factory: Any, case: tuple[onnx.ModelProto, int]) -> None:
    made, n = case
    x = np.linspace(-2.0, 2.0, 5 * n).reshape(5, n)
    path = save(tmp_path_factory.mktemp("random"), made)
    expected = ReferenceEvaluator(made).run(None, {"x": x})[0]
    # What is lost at the start grows on the way like the values may: the bound follows the network in absolute numbers,
    # layer by layer, and each layer adds at most 8 roundings (6 products, a bias, an activation) of 10.
    bound = np.abs(x).max() + 2.0
    net = read_network(path)
    for layer in net.layers:
        if isinstance(layer, Dense):
            bound = np.abs(layer.weights).sum(axis=1).max() * bound + np.abs(layer.bias).max() + 1.0
        else:
            bound = (bound + np.abs(layer.shift).max()) * max(1.0, np.abs(layer.factor).max())
    np.testing.assert_allclose(net.evaluate(x), expected, rtol=0, atol=100 * bound * np.finfo(float).eps)
