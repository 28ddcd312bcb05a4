# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""sil/FROM_PYTORCH.md as it stands. Without PyTorch, a network of the same graph stands in for what it exports."""

from __future__ import annotations

import importlib.util
import re
import shlex
from pathlib import Path

import generator
import numpy as np
import pytest
from click.testing import CliRunner
from onnx import TensorProto, helper, numpy_helper

from penode_gen import load
from penode_gen.reading.network_files import read_network
from penode_sil.cli import cli

PAGE = Path(__file__).parents[2] / "sil" / "FROM_PYTORCH.md"


def exported(path: Path) -> None:
    """The graph that torch.onnx.export writes of the page's module, its constant branch folded: min(1, 10 |x|) 60 sign(x), and 5 at 0."""
    first = np.zeros((16, 1)), np.zeros(16)
    first[0][:4, 0], first[1][:4] = (10.0, 10.0, -10.0, -10.0), (0.0, -1.0, 0.0, -1.0)
    last = np.zeros((1, 16))
    last[0, :4] = 60.0, -60.0, -60.0, 60.0
    values = {
        "w1": first[0],
        "b1": first[1],
        "w2": np.eye(16),
        "b2": np.zeros(16),
        "w3": last,
        "b3": np.array([5.0]),
        "origin": np.array([[5.0]]),
    }
    constants = [numpy_helper.from_array(v.astype(np.float32), n) for n, v in values.items()]
    gemm = [
        helper.make_node("Gemm", [i, f"w{k}", f"b{k}"], [o], f"/layers/{k}/Gemm", transB=1)
        for k, i, o in ((1, "rate", "h1"), (2, "a1", "h2"), (3, "a2", "f"))
    ]
    relu = [helper.make_node("Relu", [f"h{k}"], [f"a{k}"], f"/layers/{k}/Relu") for k in (1, 2)]
    nodes = [gemm[0], relu[0], gemm[1], relu[1], gemm[2], helper.make_node("Sub", ["f", "origin"], ["force"], "/Sub")]
    ends = [helper.make_tensor_value_info(n, TensorProto.FLOAT, ["batch", 1]) for n in ("rate", "force")]
    made = helper.make_model(
        helper.make_graph(nodes, "main_graph", ends[:1], ends[1:], constants), opset_imports=[helper.make_opsetid("", 17)], ir_version=8
    )
    path.write_bytes(made.SerializeToString())


def test_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On a vehicle whose spring is linear, as the page's model has it."""
    text = PAGE.read_text(encoding="utf-8")
    (python,), (model,) = (re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL) for kind in ("python", "toml"))
    monkeypatch.chdir(tmp_path)
    if importlib.util.find_spec("torch") is not None:
        exec(compile(python, str(PAGE), "exec"), {})
    else:
        compile(python, str(PAGE), "exec")
        exported(tmp_path / "damper_net.onnx")
    (tmp_path / "car.toml").write_text(model, encoding="utf-8")
    plain = generator.PLAIN | {"c": 25e3, "d_t": 0.0}
    generator.make(generator.Truth(spring=0, plain=tuple(plain.items())), 1, seconds=12.0).write(tmp_path / "train.csv")
    before = read_network(tmp_path / "damper_net.onnx")
    assert before.evaluate(np.zeros(1))[0] == 0.0
    commands = [line.strip() for line in text.splitlines() if line.startswith("    penode ")]
    assert [c.split()[1] for c in commands] == ["generate", "simulate", "train"]
    for command in commands:
        result = CliRunner().invoke(cli, shlex.split(command)[1:])
        assert result.exit_code == 0, (command, result.output, result.exception)
    assert (tmp_path / "c" / "car.c").exists() and (tmp_path / "predicted.csv").exists()
    assert "takes the rest" in result.output
    trained = load(tmp_path / "trained" / "model_trained.toml")
    assert trained.sets["default"].networks["damper_net"].architecture == before.architecture
