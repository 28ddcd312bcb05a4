# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What was trained, where it is used: on the target, and in another runtime."""

from __future__ import annotations

import shutil
from pathlib import Path

import generator
import numpy as np
import pytest

import penode_gen
from penode_gen.networks import Dense, Network
from penode_gen.reading.network_files import read_network
from penode_sil.scenario import Exchange
from penode_sil.schedule import exchange_calls
from penode_sil.targets import Pil, Sil

NAMES = ("spring_net", "damper_net")


def test_states_of_sil_and_pil_have_one_hash(trained: Path) -> None:
    """The trained set, adopted while the controller runs: host and Cortex-M4F agree to the bit before and after."""
    if not (shutil.which("qemu-system-arm") and shutil.which("arm-none-eabi-gcc")):
        pytest.skip("no qemu-system-arm or arm-none-eabi-gcc")
    model = penode_gen.load(trained / "model_trained.toml")
    road = generator.make(generator.Truth(), 101, seconds=1.0).road[:400, None]
    calls = exchange_calls(model, Exchange(0.15, "default", "write", 64), np.float32)
    sil, pil = Sil(model).run(road, calls, "before"), Pil(model, "m4f").run(road, calls, "before")
    assert sil.digest == pil.digest
    assert [s for _, s in sil.calls] == [s for _, s in pil.calls] == [0] * len(calls)
    never = Sil(model).run(road, (), "before")  # the check can fail: the set changes states, from where it is adopted on
    assert np.array_equal(never.x[:151], sil.x[:151]) and never.digest != sil.digest


@pytest.mark.parametrize("name", NAMES)
def test_onnxruntime_computes_the_same(trained: Path, name: str) -> None:
    runtime = pytest.importorskip("onnxruntime", reason="onnxruntime is not installed (pip install onnxruntime)")
    session = runtime.InferenceSession(str(trained / f"{name}.onnx"), providers=["CPUExecutionProvider"])
    network = read_network(trained / f"{name}.onnx")
    x = np.linspace(float(network.input_min[0]), float(network.input_max[0]), 2001, dtype=np.float32)[:, None]
    (found,) = session.run(None, {"x": x})
    assert np.max(np.abs(found - network.evaluate(x))) <= rounding(network, x)
    assert session.run(None, {"x": np.zeros((1, 1), np.float32)})[0][0, 0] == 0.0


def rounding(network: Network, x: np.ndarray) -> float:
    """What float may be off, in all places x [n, 1]: each sum of n terms by (n + 1) half units of the sum of their sizes, each scaling by
    two, carried on by the sizes of the weights; ReLU makes no difference larger."""
    unit = 2.0**-24
    size, off = np.abs(x.astype(float)), np.zeros_like(x, dtype=float)
    for layer in network.layers:
        if isinstance(layer, Dense):
            weights, bias, terms = np.abs(layer.weights), np.abs(layer.bias), layer.n_in + 1
        else:
            weights, bias, terms = np.diag(np.abs(layer.factor)), np.abs(layer.shift), 2
        off = off @ weights.T
        size = size @ weights.T + bias
        off = off + terms * unit * (size + off)
    return float(np.max(off))
