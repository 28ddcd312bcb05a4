# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks as data, and their JSON form."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from penode_gen.networks import ACTIVATIONS, Affine, Dense, Network, NetworkError
from penode_gen.reading.network_files import read_network

SHARED = Path(os.environ.get("PENODE_SHARED", Path(__file__).resolve().parents[3] / "shared"))
PUBLISHED = SHARED / "nqvm-published"
EPS = np.finfo(np.float64).eps

_EXACT = {
    "relu": lambda z: max(z, mpmath.mpf(0)),
    "identity": lambda z: z,
    "tanh": mpmath.tanh,
    "sigmoid": lambda z: 1 / (1 + mpmath.exp(-z)),
    "softplus": lambda z: mpmath.log(1 + mpmath.exp(z)),
    "step": lambda z: mpmath.mpf(z >= 0),
}


def dense(n_in: int, n_out: int, activation: str, rng: np.random.Generator) -> Dense:
    return Dense(rng.normal(size=(n_out, n_in)), rng.normal(size=n_out), activation)


def network(activation: str = "tanh", seed: int = 0) -> Network:
    """2 inputs, 3 outputs, both forms of scaling."""
    rng = np.random.default_rng(seed)
    first = Affine([0.5, -0.2], [2.0, 0.3], "centre")
    last = Affine([1.0, 2.0, 3.0], [10.0, 0.1, -1.0], "rescale")
    return Network((first, dense(2, 5, activation, rng), dense(5, 3, "identity", rng), last), None, None, "test")


def exact(net: Network, x: list[float]) -> list[mpmath.mpf]:
    """The same function in 50 digits, one scalar at a time."""
    h = [mpmath.mpf(v) for v in x]
    for layer in net.layers:
        if isinstance(layer, Affine):
            pairs = zip(h, layer.shift.tolist(), layer.factor.tolist(), strict=True)
            h = [(v - s) * f if layer.form == "centre" else v * f + s for v, s, f in pairs]
        else:
            rows = zip(layer.weights.tolist(), layer.bias.tolist(), strict=True)
            sums = [mpmath.fsum(w * v for w, v in zip(row, h, strict=True)) + b for row, b in rows]
            h = [_EXACT[layer.activation](z) for z in sums]
    return h


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_evaluate_agrees_with_50_digits(activation: str) -> None:
    # About 20 roundings lie on each path, no term exceeds 40 in size, and no activation is steeper than 1 (the step is
    # met at no point here); the sum of 40 * 20 * eps is 2e-13.
    mpmath.mp.dps = 50
    net = network(activation)
    points = np.random.default_rng(1).uniform(-3.0, 3.0, (20, 2))
    for x, y in zip(points, net.evaluate(points), strict=True):
        assert all(abs(a - b) < 40 * 20 * EPS for a, b in zip(exact(net, x.tolist()), y.tolist(), strict=True))


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_jacobian_is_the_derivative_of_evaluate(activation: str) -> None:
    # mpmath differentiates the 50-digit function. Slopes are products of three factors below 10 and sums of 5 terms.
    mpmath.mp.dps = 50
    net = network(activation, seed=2)
    for x in np.random.default_rng(3).uniform(-2.0, 2.0, (5, 2)).tolist():
        j = net.jacobian(x)
        for i in range(3):
            for k in range(2):

                def along(t: mpmath.mpf, i: int = i, k: int = k, x: list[float] = x) -> mpmath.mpf:
                    return exact(net, [t if m == k else v for m, v in enumerate(x)])[i]

                assert abs(mpmath.diff(along, x[k], h=mpmath.mpf(10) ** -25) - j[i, k]) < 1000 * 20 * EPS


def test_jacobian_at_the_kink_is_that_of_the_left_side() -> None:
    relu = Network((Dense([[1.0]], [0.0], "relu"),), None, None, "test")
    step = Network((Dense([[1.0]], [0.0], "step"),), None, None, "test")
    assert relu.jacobian([0.0]) == 0.0
    assert step.jacobian([0.0]) == 0.0
    assert step.evaluate([[0.0], [-1e-300]]).tolist() == [[1.0], [0.0]]


@pytest.mark.parametrize("activation", ["tanh", "sigmoid", "softplus", "relu"])
def test_large_arguments_neither_overflow_nor_warn(activation: str) -> None:
    net = Network((Dense([[1.0]], [0.0], activation),), None, None, "test")
    limits = {"tanh": [-1.0, 1.0], "sigmoid": [0.0, 1.0], "softplus": [0.0, 1e4], "relu": [0.0, 1e4]}
    assert net.evaluate([[-1e4], [1e4]]).ravel().tolist() == limits[activation]
    assert np.isfinite(net.jacobian([[-1e4], [1e4]])).all()


@pytest.mark.parametrize("activation", ACTIVATIONS)
def test_nan_stays_nan(activation: str) -> None:
    assert np.isnan(network(activation).evaluate([0.0, np.nan])).all()


def test_leading_axes_are_kept() -> None:
    net = network()
    x = np.random.default_rng(5).normal(size=(4, 7, 2))
    assert net.evaluate(x).shape == (4, 7, 3)
    assert net.jacobian(x).shape == (4, 7, 3, 2)
    # matrix products of other shapes may add in another order: 5 terms below 10
    np.testing.assert_allclose(net.evaluate(x)[3, 6], net.evaluate(x[3, 6]), rtol=0, atol=50 * EPS)
    with pytest.raises(ValueError, match="last axis must be 2"):
        net.evaluate([1.0, 2.0, 3.0])


def test_sizes_architecture_and_kind() -> None:
    net = network("relu")
    assert (net.n_inputs, net.n_outputs, net.n_parameters) == (2, 3, 2 * 5 + 5 + 5 * 3 + 3)
    assert net.is_piecewise_linear
    assert not network("tanh").is_piecewise_linear
    assert not network("step").is_piecewise_linear
    assert network("relu", seed=1).architecture == net.architecture
    assert network("tanh").architecture != net.architecture
    assert hash(net.architecture) == hash(network("relu", seed=9).architecture)


def test_numbers_are_copied_and_read_only() -> None:
    weights = np.ones((1, 1), dtype=np.float32)
    layer = Dense(weights, [0.0], "relu")
    weights[0, 0] = 5.0
    assert layer.weights.dtype == np.float64
    assert layer.weights[0, 0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        layer.weights[0, 0] = 2.0


_ONE = Dense([[1.0]], [0.0], "relu")


@pytest.mark.parametrize(
    ("layers", "low", "high", "message"),
    [
        ((), None, None, "no layers"),
        ((_ONE, Dense([[1.0, 2.0]], [0.0], "relu")), None, None, "layer 2: takes 2 values, but the layer"),
        ((Dense([[1.0]], [0.0], "elu"),), None, None, "unknown activation 'elu'"),
        ((Affine([0.0], [1.0], "scale"),), None, None, "unknown form 'scale'"),
        ((Affine([0.0], [1.0, 2.0], "centre"),), None, None, "vectors of one length"),
        ((Dense([[1.0]], [0.0, 1.0], "relu"),), None, None, "do not fit"),
        ((Dense([1.0], [0.0], "relu"),), None, None, "do not fit"),
        ((Dense([[np.nan]], [0.0], "relu"),), None, None, "NaN or infinite"),
        ((Affine([np.inf], [1.0], "centre"),), None, None, "NaN or infinite"),
        ((_ONE,), [0.0], None, "only one of minimum and maximum"),
        ((_ONE,), [0.0, 1.0], [2.0, 2.0], "needs 1 minima and maxima"),
        ((_ONE,), [2.0], [1.0], "below its maximum"),
        ((_ONE,), [-np.inf], [1.0], "below its maximum"),
    ],
)
def test_what_does_not_fit_is_refused(layers: Any, low: Any, high: Any, message: str) -> None:
    low, high = (None if v is None else np.array(v) for v in (low, high))
    with pytest.raises(NetworkError, match=message) as caught:
        Network(layers, low, high, "net.onnx")
    assert str(caught.value).startswith("net.onnx: ")
    assert "\n" not in str(caught.value)


# ---- the JSON form ----

_LAYER = {"activation": "relu", "weights": [[1.0], [2.0]], "bias": [0.5, -0.5]}
_LAST = {"activation": "identity", "weights": [[1.0, -1.0]], "bias": [0.25]}


def document(**changes: Any) -> dict[str, Any]:
    """A whole network as the published files write it, with some keys replaced; None takes a key away."""
    whole = {
        "input": {"name": "deflection", "unit": "m"},
        "output": {"name": "force", "unit": "N"},
        "normalise": {"kind": "min-max", "min": [1.0], "max": [5.0]},
        "layers": [_LAYER, _LAST],
        "denormalise": {"kind": "min-max", "min": [-10.0], "max": [10.0]},
    } | changes
    return {key: value for key, value in whole.items() if value is not None}


def read(folder: Path, content: Any) -> Network:
    path = folder / "net.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content))
    return read_network(path)


def test_json_is_scaled_as_documented(tmp_path: Path) -> None:
    net = read(tmp_path, document(trained_range={"min": [0.0], "max": [8.0]}))
    # x = 3: h = (3 - 1) / 4 = 1/2; relu(1/2 + 1/2) = 1, relu(1 - 1/2) = 1/2; 1 - 1/2 + 1/4 = 3/4; 3/4 * 20 - 10 = 5
    assert net.evaluate([3.0]).tolist() == [5.0]
    assert net.architecture == (("affine", "centre", 1), ("dense", "relu", 1, 2), ("dense", "identity", 2, 1), ("affine", "rescale", 1))
    assert (net.input_min.tolist(), net.input_max.tolist(), net.source) == ([0.0], [8.0], "net.json")


def test_json_needs_nothing_but_layers(tmp_path: Path) -> None:
    net = read(tmp_path, {"layers": [_LAYER, _LAST]})
    assert net.evaluate([1.0]).tolist() == [1.5 - 1.5 + 0.25]
    assert net.input_min is None and net.input_max is None


@pytest.mark.parametrize(
    ("content", "where", "what"),
    [
        (document(lyers=[]), "the file", "unknown key 'lyers'"),
        (document(layers=None), "the file", "'layers' is missing"),
        (document(layers=[]), "layers", "no layers"),
        (document(input={"nam": "x"}), "input", "unknown key 'nam'"),
        (document(output={"unit": 3}), "output.unit", "3 is not a text"),
        (document(normalise={"kind": "standard", "min": [0], "max": [1]}), "normalise", "unknown kind 'standard'"),
        (document(normalise={"kind": "min-max", "min": [0], "max": [0]}), "normalise", "not below its maximum"),
        (document(normalise={"kind": "min-max", "min": [0], "max": [1, 2]}), "normalise", "1 minima, but 2 maxima"),
        (document(normalise={"kind": "min-max", "min": [0, 0], "max": [1, 1]}), r"layers\[0\]", "takes 1 values"),
        (document(denormalise={"kind": "min-max", "min": [0, 0], "max": [1, 1]}), "denormalise", "takes 2 values"),
        (document(layers=[_LAYER | {"activation": "elu"}]), r"layers\[0\].activation", "unknown activation 'elu'"),
        (document(layers=[_LAYER | {"activation": ["relu"]}]), r"layers\[0\].activation", "unknown activation"),
        (document(layers=[_LAYER | {"gain": 1}]), r"layers\[0\]", "unknown key 'gain'"),
        (document(layers=[_LAYER | {"bias": [1.0]}]), r"layers\[0\]", "2 rows of weights, but 1 biases"),
        (document(layers=[_LAYER | {"weights": [[1.0], [1.0, 2.0]]}]), r"layers\[0\].weights", "different lengths"),
        (document(layers=[_LAYER | {"weights": [[1.0], ["2"]]}]), r"weights\[1\]\[0\]", "not a number"),
        (document(layers=[_LAYER | {"bias": [1.0, True]}]), r"layers\[0\].bias\[1\]", "not a number"),
        (document(layers=[_LAYER | {"bias": [1.0, 10**400]}]), r"layers\[0\].bias\[1\]", "too large"),
        (document(layers=[_LAYER, _LAYER]), r"layers\[1\]", r"takes 1 values, but layers\[0\] gives 2"),
        (document(trained_range={"min": [0.0]}), "trained_range", "'max' is missing"),
        (document(trained_range={"min": [0, 0], "max": [1, 1]}), "trained_range", "2 ranges for a network of 1"),
        (document(trained_range={"min": [1.0], "max": [0.0]}), "trained_range", "not below its maximum"),
        ([], "the file", "must be an object"),
        ("{", "not JSON", "Expecting"),
        ('{"layers": [], "layers": []}', "not JSON", "'layers' stands twice"),
        ('{"layers": NaN}', "not JSON", "NaN is not a number"),
        ('{"layers": [{"activation": "relu", "weights": [[1e999]], "bias": [0]}]}', r"weights\[0\]\[0\]", "too large"),
        ("[" * 100_000, "not JSON", "recursion"),
    ],
)
def test_faulty_json_is_refused_in_one_line(tmp_path: Path, content: Any, where: str, what: str) -> None:
    with pytest.raises(NetworkError, match=f"net.json: (.*){where}.*: .*{what}.*; .") as caught:
        read(tmp_path, content)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("name", "what"), [("gone.json", "No such file"), ("net.txt", "unknown suffix '.txt'")])
def test_path_that_is_no_network(tmp_path: Path, name: str, what: str) -> None:
    with pytest.raises(NetworkError, match=f"{name}: {what}"):
        read_network(tmp_path / name)


def test_json_that_is_not_text_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "net.json"
    path.write_bytes(b"\xff\xfe\x00\x80{")
    with pytest.raises(NetworkError, match="not JSON"):
        read_network(path)


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from([*document(), "min", "bias"]), inner),
    max_leaves=8,
)


@settings(max_examples=300, deadline=None)
@given(key=st.sampled_from([*document(), "trained_range"]), value=_JSON)
def test_no_value_of_any_key_ends_in_another_exception(tmp_path_factory: Any, key: str, value: Any) -> None:
    try:
        net = read(tmp_path_factory.mktemp("any"), document() | {key: value})
    except NetworkError as error:
        assert "\n" not in str(error)
    else:
        assert np.isfinite(net.evaluate(np.zeros(net.n_inputs))).all()


@pytest.mark.skipif(not PUBLISHED.is_dir(), reason=f"no published networks at {PUBLISHED}; set PENODE_SHARED")
@pytest.mark.parametrize("name", ["spring", "damper"])
def test_published_network_is_read_as_its_readme_says(name: str) -> None:
    net = read_network(PUBLISHED / f"{name}.json")
    assert net.n_parameters == 593
    assert net.is_piecewise_linear
    raw = json.loads((PUBLISHED / f"{name}.json").read_text())
    x = np.linspace(-0.1, 0.1, 101)
    low, high = raw["normalise"]["min"][0], raw["normalise"]["max"][0]
    h = ((x - low) / (high - low))[np.newaxis, :]
    for i, layer in enumerate(raw["layers"]):
        z = np.array(layer["weights"]) @ h + np.array(layer["bias"])[:, np.newaxis]
        h = np.maximum(z, 0.0) if i < 3 else z
    low, high = raw["denormalise"]["min"][0], raw["denormalise"]["max"][0]
    y = h[0] * (high - low) + low
    # four layers of at most 16 terms, each below 100 after scaling, and outputs up to 2000 N
    np.testing.assert_allclose(net.evaluate(x[:, np.newaxis])[:, 0], y, rtol=0, atol=64 * 2000 * EPS)
