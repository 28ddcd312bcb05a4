# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A trained network as an ONNX file: layers as Gemm, scaling as Sub, Mul and Add, and what is known of it in its metadata."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from penode_gen.networks import Affine, Network

from ..output import whole

_NODES = {"relu": "Relu", "tanh": "Tanh", "sigmoid": "Sigmoid", "softplus": "Softplus"}


def model(network: Network, name: str, text: str, properties: Mapping[str, str]) -> onnx.ModelProto:
    """The network in float; the same layers come back from penode_gen.reading.network_files.read_network."""
    constants: list[onnx.TensorProto] = []
    nodes: list[onnx.NodeProto] = []
    now = "x"

    def constant(values: NDArray[np.float64]) -> str:
        constants.append(numpy_helper.from_array(np.asarray(values, dtype=np.float32), f"c{len(constants)}"))
        return constants[-1].name

    def node(kind: str, *given: str) -> None:
        nonlocal now
        out = f"h{len(nodes)}"
        nodes.append(helper.make_node(kind, [now, *given], [out], f"{kind.lower()}{len(nodes)}"))
        now = out

    for layer in network.layers:
        if isinstance(layer, Affine):
            for kind, values in (
                (("Sub", layer.shift), ("Mul", layer.factor)) if layer.form == "centre" else (("Mul", layer.factor), ("Add", layer.shift))
            ):
                node(kind, constant(values))
        else:
            node("Gemm", constant(layer.weights), constant(layer.bias))
            nodes[-1].attribute.append(helper.make_attribute("transB", 1))
            if layer.activation != "identity":
                node(_NODES[layer.activation])
    nodes[-1].output[0] = "y"
    ends = [
        helper.make_tensor_value_info(n, TensorProto.FLOAT, ["batch", w]) for n, w in (("x", network.n_inputs), ("y", network.n_outputs))
    ]
    graph = helper.make_graph(nodes, name, ends[:1], ends[1:], constants)
    found = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)], ir_version=8, producer_name="penode")
    found.doc_string = text
    if network.input_min is not None and network.input_max is not None:
        own = {"penode.input_min": network.input_min, "penode.input_max": network.input_max}
        properties = {k: ",".join(f"{float(v):.9g}" for v in values) for k, values in own.items()} | dict(properties)
    helper.set_model_props(found, dict(properties))
    onnx.checker.check_model(found)
    return found


def write(path: Path, content: onnx.ModelProto) -> None:
    """The file, whole or not at all."""
    with whole(path) as part:
        part.write_bytes(content.SerializeToString(deterministic=True))
