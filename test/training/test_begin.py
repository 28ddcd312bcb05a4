# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode train --from`: what is known already is where the fit starts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from onnx import NodeProto, TensorProto, helper, numpy_helper

import penode_gen
from penode_gen.networks import Affine, Dense, Network
from penode_sil.cli import cli
from penode_sil.errors import UserError
from penode_sil.training import begin
from penode_sil.training.port import Port

QUARTER = Path(__file__).with_name("quarter.toml")


def network(activation: str, inputs: int = 2, scaled: bool = True) -> Network:
    random = np.random.default_rng(3)
    layers = [
        Dense(random.normal(size=(7, inputs)), random.normal(size=7), activation),
        Dense(random.normal(size=(1, 7)), random.normal(size=1), "identity"),
    ]
    first, last = (
        Affine(random.normal(size=inputs), random.uniform(1.0, 2.0, inputs), "centre"),
        Affine(np.array([3.0]), np.array([40.0]), "rescale"),
    )
    return Network((first, *layers, last) if scaled else tuple(layers), None, None, "given")


@pytest.mark.parametrize("scaled", [True, False])
@pytest.mark.parametrize("activation", ["tanh", "relu", "softplus"])
def test_numbers_to_train_compute_what_the_network_does(activation: str, scaled: bool) -> None:
    given = network(activation, scaled=scaled)
    x = np.random.default_rng(4).normal(size=(50, 2))
    found = begin.dense(Port("net", ((0, 1),), False, False, 0), given, np.array([0.3, 5.0]), 17.0)
    assert np.allclose(found(x), given.evaluate(x)[:, 0], rtol=1e-12, atol=1e-9)
    zero = begin.dense(Port("net", ((0, 1),), False, True, 0), given, np.array([0.3, 5.0]), 17.0)
    assert np.allclose(zero(x), (given.evaluate(x) - given.evaluate(np.zeros((1, 2))))[:, 0], rtol=1e-12, atol=1e-9)


def test_curve_goes_through_the_network_at_its_knots() -> None:
    given = network("relu", 1)
    found = begin.curve(Port("net", ((0,),), False, True, 21), given, 2.0)
    assert len(found.knots) == 21 and found.values[found.zero] == 0.0
    assert np.allclose(found.values, (given.evaluate(found.knots[:, None]) - given.evaluate(np.zeros((1, 1))))[:, 0])


def test_training_goes_on_where_one_ended(trained: Path, recordings: tuple[Path, Path], tmp_path: Path) -> None:
    """Same recording: the same forces, within their own band, and parameters within theirs."""
    result = CliRunner().invoke(
        cli,
        [
            "train",
            str(QUARTER),
            "--data",
            str(recordings[0]),
            "-o",
            str(tmp_path / "on"),
            "--from",
            str(trained / "training.json"),
            "--json",
        ],
    )
    assert result.exit_code == 0, result.output
    found, before = json.loads(result.output), json.loads((trained / "training.json").read_text())
    assert found["converged"]
    for name, p in found["parameters"].items():
        assert abs(p["value"] - before["parameters"][name]["value"]) < p["sigma"], name
    for name, n in found["networks"].items():
        now, then = n["band"][0], before["networks"][name]["band"][0]
        away = np.interp(then["x"], now["x"], now["y"]) - np.array(then["y"])
        assert np.sqrt(np.mean((away[1:-1] / np.maximum(np.array(then["sigma"])[1:-1], 1e-9)) ** 2)) < 1.0, name


def test_what_files_say(trained: Path) -> None:
    model = penode_gen.load(QUARTER)
    start = begin.read([trained / "model_trained.toml"], model)
    assert set(start.networks) == set(model.networks) and start.parameters["m_b"] != model.parameters["m_b"].value
    assert set(begin.read([trained / "spring_net.onnx"], model).networks) == {"spring_net"}
    assert begin.read([QUARTER], model).networks == {}  # 0 everywhere: nothing to start from


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("net.onnx", "", "has no network net"),
        ("old.mat", "", "neither a model file"),
        ("spring_net.onnx", "nonsense", "not an ONNX file"),
        (
            "other.toml",
            (
                '[model]\nname = "o"\nsample_time = "1 ms"\n[parameters]\nq = { value = 1, unit = "kg" }\n'
                '[outputs]\ny = { value = "q", unit = "kg" }\n'
            ),
            "no parameter and no network",
        ),
    ],
)
def test_bad_start_is_one_line(name: str, text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises((UserError, penode_gen.ModelError)) as caught:
        begin.read([tmp_path / name], penode_gen.load(QUARTER))
    assert any(says in p for p in caught.value.problems), caught.value.problems


@pytest.mark.parametrize(
    ("layer", "says"),
    [
        (helper.make_node("Mul", ["x", "k"], ["y"]), "no layer with weights"),
        (helper.make_node("Gemm", ["x", "k"], ["y"]), "1 and 2, the model's 1 and 1"),
    ],
)
def test_network_that_cannot_be_a_start_is_one_line(layer: NodeProto, says: str, tmp_path: Path) -> None:
    width = 1 if layer.op_type == "Mul" else 2
    ends = [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["batch", w]) for n, w in (("x", 1), ("y", width))]
    graph = helper.make_graph([layer], "given", ends[:1], ends[1:], [numpy_helper.from_array(np.full((1, width), 3.0, np.float32), "k")])
    path = tmp_path / "spring_net.onnx"
    path.write_bytes(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8).SerializeToString())
    with pytest.raises(UserError) as caught:
        begin.read([path], penode_gen.load(QUARTER))
    assert says in str(caught.value) and len(caught.value.problems) == 1
