# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks from files: ONNX, or the JSON form of a published case study."""

from __future__ import annotations

from pathlib import Path

from ..networks import Network, NetworkError
from . import json_file, onnx_file


def read_network(path: Path) -> Network:
    """The network in an .onnx or .json file; raises NetworkError for everything that is not one we can run."""
    readers = {".onnx": onnx_file.read_onnx, ".json": json_file.read_json}
    if path.suffix.lower() not in readers:
        raise NetworkError(f"{path}: unknown suffix '{path.suffix}'; a network is an .onnx or a .json file")
    return readers[path.suffix.lower()](path)
