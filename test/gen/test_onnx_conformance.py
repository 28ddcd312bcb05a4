# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The ONNX reader against the cases of the ONNX project: each is computed as expected, or refused as a NetworkError."""

from __future__ import annotations

import warnings
from functools import cache
from pathlib import Path

import numpy as np
import onnx
import pytest
from numpy.typing import NDArray
from onnx import ModelProto, numpy_helper
from onnx.backend.test.case.node import collect_testcases

from penode_gen.networks import Network, NetworkError
from penode_gen.reading.network_files import read_network

DATA = Path(onnx.__file__).parent / "backend" / "test" / "data"

# Cases with a float input of one or two axes whose other inputs, made constant, leave one chain. Refused with reason:
# a bias for each row of the batch (gemm_default_matrix_bias), a transposed signal, more than two axes, integers, a
# graph that only copies, limits of Clip that depend on nothing else but cross each other.
NODE_CASES = """
    test_gemm_default_zero_bias test_gemm_default_no_bias test_gemm_default_scalar_bias test_gemm_transposeB
    test_gemm_default_single_elem_vector_bias test_gemm_default_vector_bias test_gemm_alpha test_gemm_beta
    test_matmul_2d test_matmul_1d_1d
    test_sigmoid_example test_softplus_example test_tanh_example
    test_sub_example test_mul_example test_div_example test_neg_example
    test_clip_example test_clip_inbounds test_clip_outbounds test_clip_splitbounds test_leakyrelu_example
    test_max_float32 test_max_float64 test_max_two_inputs test_min_float32 test_min_float64 test_min_two_inputs
""".split()
PYTORCH_CASES = """
    test_Linear test_Linear_no_bias test_Softplus
    test_operator_addconstant test_operator_add_broadcast test_operator_add_size1_right_broadcast
    test_operator_add_size1_singleton_broadcast test_operator_mm
""".split()


def frozen(made: ModelProto, inputs: list[object]) -> tuple[ModelProto, NDArray[np.float64] | None]:
    """The model with all inputs but the first made constant, and the value of the first (None if that is no tensor)."""
    result = ModelProto()
    result.CopyFrom(made)
    given = {i.name for i in result.graph.initializer}
    names = [i.name for i in result.graph.input if i.name not in given]
    for name, value in list(zip(names, inputs, strict=False))[1:]:
        if isinstance(value, (np.ndarray, np.generic)):
            result.graph.initializer.append(numpy_helper.from_array(np.asarray(value), name))
    return result, inputs[0] if inputs and isinstance(inputs[0], np.ndarray) else None


def outcome(folder: Path, made: ModelProto, inputs: list[object], expected: object) -> Network | str:
    """The network, after its output was compared; or why it was refused."""
    changed, x = frozen(made, inputs)
    path = folder / "net.onnx"
    path.write_bytes(changed.SerializeToString())
    try:
        net = read_network(path)
    except NetworkError as error:
        assert str(error).startswith(f"{path}: ") and "; " in str(error) and "\n" not in str(error)
        return str(error)
    assert x is not None
    got, expected = net.evaluate(x), np.asarray(expected)
    assert got.size == expected.size
    # the expected values are float: sums of at most 20 terms of order 1 and some single operations
    bound = 100 * float(np.finfo(np.float32).eps) * max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(got.ravel(), expected.ravel(), rtol=0, atol=bound)
    return net


@cache
def node_cases() -> dict[str, onnx.backend.test.case.test_case.TestCase]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the cases overflow on purpose
        return {case.name: case for case in collect_testcases(None) if case.model is not None and case.data_sets}


def test_node_cases(tmp_path: Path) -> None:
    accepted = set()
    for name, case in node_cases().items():
        inputs, outputs = case.data_sets[0]
        if isinstance(outcome(tmp_path, case.model, list(inputs), outputs[0] if outputs else None), Network):
            accepted.add(name)
    assert accepted == set(NODE_CASES)
    assert len(node_cases()) > 1500  # the collection is what it was: 1884 in onnx 1.23


def pytorch_models() -> list[Path]:
    return sorted(p for kind in ("pytorch-converted", "pytorch-operator") for p in (DATA / kind).iterdir())


@pytest.mark.parametrize("folder", pytorch_models(), ids=lambda p: p.name)
def test_old_files_of_pytorch(tmp_path: Path, folder: Path) -> None:
    made = onnx.load(folder / "model.onnx")
    tensors = [sorted((folder / "test_data_set_0").glob(f"{kind}_*.pb")) for kind in ("input", "output")]
    inputs, outputs = ([numpy_helper.to_array(onnx.load_tensor(p)) for p in paths] for paths in tensors)
    result = outcome(tmp_path, made, list(inputs), outputs[0])
    assert isinstance(result, Network) == (folder.name in PYTORCH_CASES), result
