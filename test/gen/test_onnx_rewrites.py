# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Operators that exporters write beside dense layers: rewritten, and equal to the reference evaluator of ONNX."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnx
import pytest
from onnx.reference import ReferenceEvaluator
from onnx_graphs import B1, B2, DOUBLE, W1, W2, model, node

from penode_gen.networks import Dense, Network, NetworkError
from penode_gen.reading.network_files import read_network

RANDOM = np.random.default_rng(5)
BN = {"g": RANDOM.uniform(0.5, 2.0, 5), "c": RANDOM.normal(size=5), "m": RANDOM.normal(size=5), "v": RANDOM.uniform(0.5, 2.0, 5)}
PLAIN = {"w1": W1, "b1": B1, "w2": W2, "b2": B2}
IN, OUT = node("Gemm", "x w1 b1", "h"), node("Gemm", "a w2 b2", "y")


def limits(*names: str) -> dict[str, np.ndarray]:
    """Scalars."""
    values = {"zero": 0.0, "six": 6.0, "low": -0.4, "far": 3.4e38}
    return {n: np.array(values[n]) for n in names}


CASES = {
    "leaky": ([IN, node("LeakyRelu", "h", "a", alpha=0.2), OUT], PLAIN),
    "prelu": ([IN, node("PRelu", "h p", "a"), OUT], PLAIN | {"p": RANDOM.uniform(0.0, 0.5, 5)}),
    "clip": ([IN, node("Clip", "h low six", "a"), OUT], PLAIN | limits("low", "six")),
    "clip below": ([IN, node("Clip", "h low", "a"), OUT], PLAIN | limits("low")),
    "max": ([IN, node("Max", "h low", "a"), OUT], PLAIN | limits("low")),
    "min": ([IN, node("Min", "six h", "a"), OUT], PLAIN | limits("six")),
    "norm after": ([IN, node("BatchNormalization", "h g c m v", "n"), node("Relu", "n", "a"), OUT], PLAIN | BN),
    "norm before": ([IN, node("Relu", "h", "r"), node("BatchNormalization", "r g c m v", "a", epsilon=1e-3), OUT], PLAIN | BN),
}


def save(tmp_path: Path, nodes: list[onnx.NodeProto], constants: dict[str, np.ndarray]) -> Path:
    path = tmp_path / "net.onnx"
    path.write_bytes(model(nodes, constants, dtype=DOUBLE).SerializeToString())
    return path


def compared(path: Path) -> Network:
    """Equal to the reference on a thousand points: all in double, sums of at most ten terms of order 10."""
    x = 3.0 * np.random.default_rng(1).normal(size=(1000, 3))
    network = read_network(path)
    (expected,) = ReferenceEvaluator(onnx.load(path)).run(None, {"x": x})
    assert np.ptp(expected) > 1.0
    np.testing.assert_allclose(network.evaluate(x), expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    return network


@pytest.mark.parametrize("name", CASES)
def test_rewritten(name: str, tmp_path: Path) -> None:
    network = compared(save(tmp_path, *CASES[name]))
    if name not in ("norm before",):  # a scaling after ReLU stays one; all others are dense layers only, as many as there were
        assert [layer.activation for layer in network.layers if isinstance(layer, Dense)] == ["relu", "identity"]


@pytest.mark.parametrize("limit", [("zero",), ("zero", "far")])
def test_clip_at_zero_is_relu(limit: tuple[str, ...], tmp_path: Path) -> None:
    network = compared(save(tmp_path, [IN, node("Clip", " ".join(("h", *limit)), "a"), OUT], PLAIN | limits(*limit)))
    assert [layer.n_out for layer in network.layers] == [5, 2]


def branch(source: str, name: str, activation: str = "Tanh") -> list[onnx.NodeProto]:
    return [
        node("Gemm", f"{source} w1 b1", f"h{name}"),
        node(activation, f"h{name}", f"a{name}"),
        node("Gemm", f"a{name} w2 b2", f"f{name}"),
    ]


def test_zero_at_zero_by_subtraction(tmp_path: Path) -> None:
    nodes = [*branch("x", "1"), *branch("origin", "2"), node("Sub", "f1 f2", "y")]
    network = compared(save(tmp_path, nodes, PLAIN | {"origin": np.zeros((1, 3))}))
    assert np.all(network.evaluate(np.zeros(3)) == 0.0)


@pytest.mark.parametrize("activation", ["Tanh", "Relu", "Softplus"])
def test_odd_by_subtraction(activation: str, tmp_path: Path) -> None:
    nodes = [*branch("x", "1", activation), node("Neg", "x", "minus"), *branch("minus", "2", activation), node("Sub", "f1 f2", "y")]
    network = compared(save(tmp_path, nodes, PLAIN))
    assert [layer.n_out for layer in network.layers] == [10, 2]
    at_zero = np.zeros(2, np.float32)  # summed in order, in float: pairs cancel to the bit
    hidden = Network(network.layers[:1], None, None, "hidden").evaluate(np.zeros(3)).astype(np.float32)
    for column, value in zip(network.layers[1].weights.astype(np.float32).T, hidden, strict=True):
        at_zero += column * value
    assert np.all(at_zero == 0.0)


@pytest.mark.parametrize(
    ("nodes", "says"),
    [
        ([IN, node("Clip", "h x", "a"), OUT], "operator is not supported"),
        ([IN, node("Elu", "h", "a"), OUT], "operator is not supported"),
        ([*branch("x", "1"), node("Neg", "x", "minus"), *branch("minus", "2", "Relu"), node("Sub", "f1 f2", "y")], "not of one shape"),
        # constants that broadcast along the batch, add an axis or widen the signal
        ([IN, node("Max", "h column", "a"), OUT], "operator is not supported"),
        ([IN, node("Min", "cube h", "a"), OUT], "operator is not supported"),
        ([IN, node("PRelu", "h column", "a"), OUT], "operator is not supported"),
        ([node("Gemm", "x narrow", "h"), node("Max", "h zeros", "a"), OUT], "operator is not supported"),
        ([IN, node("Clip", "h c", "a"), OUT], "operator is not supported"),  # its limits are scalars
        ([IN, node("Clip", "h far", "a"), OUT], "NaN or Inf"),  # beyond float, but below: not as if there were none
        ([node("Gemm", "x w1 b1", "h", transA=1), node("BatchNormalization", "h g c m v", "a"), OUT], "not transposed"),
    ],
)
def test_refused_with_a_remedy(nodes: list[onnx.NodeProto], says: str, tmp_path: Path) -> None:
    constants = (
        PLAIN
        | BN
        | {
            "column": RANDOM.normal(size=(5, 1)),
            "cube": np.ones((1, 1, 1)),
            "narrow": W1[:, :1],
            "zeros": np.zeros(5),
            "far": np.array(np.inf),
        }
    )
    path = save(tmp_path, nodes, {n: v for n, v in constants.items() if any(n in k.input for k in nodes)})
    with pytest.raises(NetworkError) as caught:
        read_network(path)
    assert str(caught.value).startswith(f"{path}: ") and says in str(caught.value) and "; " in str(caught.value)
