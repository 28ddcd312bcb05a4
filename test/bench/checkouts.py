# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Peers that are in no registry: measured where the environment names a checkout, else what was measured last is quoted.

ONNX2C_DIR    a checkout of github.com/kraiskil/onnx2c, built in its folder build
CMSIS_NN_DIR  a checkout of github.com/ARM-software/CMSIS-NN, the release after 7.0.0 or later: that is when floats came

Nothing of them is kept but what their steps cost.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable
from pathlib import Path

import onnx
from onnx import helper, numpy_helper
from peers import GLUE, Case, Layer, Peer, _flat, _folder


def _named(what: str, folder: Path) -> str:
    """The peer's name with the commit of its checkout."""
    commit = subprocess.run(["git", "-C", str(folder), "rev-parse", "--short=7", "HEAD"], check=True, capture_output=True, text=True)
    return f"{what} ({commit.stdout.strip()})"


def graph(layers: list[Layer]) -> onnx.ModelProto:
    """A network as ONNX: Gemm and Relu in turn, weights as PyTorch exports them, which onnx2c makes the best of."""
    nodes, weights, signal = [], [], "x"
    for k, (w, b) in enumerate(layers):
        last = k == len(layers) - 1
        weights += [numpy_helper.from_array(w, f"w{k}"), numpy_helper.from_array(b, f"b{k}")]
        out = "y" if last else f"s{k}"
        nodes.append(helper.make_node("Gemm", [signal, f"w{k}", f"b{k}"], [out], transB=1))
        if not last:
            nodes.append(helper.make_node("Relu", [out], [f"h{k}"]))
        signal = f"h{k}"
    ends = [helper.make_tensor_value_info(name, onnx.TensorProto.FLOAT, [1, 1]) for name in ("x", "y")]
    made = helper.make_graph(nodes, "network", ends[:1], ends[1:], weights)
    return helper.make_model(made, opset_imports=[helper.make_opsetid("", 13)], ir_version=8)


def onnx2c(case: Case, checkout: Path) -> Peer:
    """The networks as onnx2c translates them."""
    folder, inside = _folder("onnx2c", case), 0
    for name, layers in case.networks.items():
        onnx.save(graph(layers), folder / f"{name}.onnx")
        made = subprocess.run(
            [str(checkout / "build" / "onnx2c"), str(folder / f"{name}.onnx")], check=True, capture_output=True, text=True
        )
        text, count = re.subn(r"\bentry\(", f"peer_{name}_entry(", made.stdout)
        if count < 1:
            raise SystemExit("bench: onnx2c made no function entry()")
        (folder / f"{name}_network.c").write_text(text)
        inside += 4 * _flat(layers).size
    sources = [GLUE / "onnx2c.c", *(folder / f"{name}_network.c" for name in case.networks)]
    return Peer(_named("onnx2c", checkout), folder, sources, weights_inside=inside)


def cmsis_nn(case: Case, checkout: Path) -> Peer:
    """Fully connected layers of CMSIS-NN in float, weights in its standard layout; the packed one is for MVE."""
    parts = ["FullyConnectedFunctions/arm_fully_connected_f32.c"]
    parts += [f"NNSupportFunctions/arm_nn_mat_mult_nt_{kind}_f32.c" for kind in ("t", "n_packed")]
    sources = [GLUE / "cmsis_nn.c", *(checkout / "Source" / part for part in parts)]
    if not all(path.exists() for path in sources):
        raise SystemExit(f"bench: {checkout} has no kernels in float; they came after release 7.0.0")
    options = ["-DARM_NN_ENABLE_F32=1", f"-I{checkout / 'Include'}"]
    return Peer(_named("CMSIS-NN", checkout), _folder("cmsis_nn", case), sources, options)


NAMES = {"ONNX2C_DIR": "onnx2c", "CMSIS_NN_DIR": "CMSIS-NN"}
CHECKOUTS: dict[str, Callable[[Case, Path], Peer]] = {"ONNX2C_DIR": onnx2c, "CMSIS_NN_DIR": cmsis_nn}


def at_hand() -> dict[str, Callable[[Case], Peer]]:
    """Those whose checkout the environment names."""
    given = {variable: Path(os.environ[variable]).resolve() for variable in CHECKOUTS if os.environ.get(variable)}
    return {variable: lambda case, v=variable, p=path: CHECKOUTS[v](case, p) for variable, path in given.items()}
