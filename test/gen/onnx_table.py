# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`make onnx-table`: which operators the reader takes, by the node cases of the ONNX project, and what the refused ones say."""

from __future__ import annotations

import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
from test_onnx_conformance import node_cases, outcome

from penode_gen.networks import Network


def in_scope(inputs: list[object]) -> bool:
    """A float vector or matrix goes in: what a layer of a network could be."""
    return bool(inputs) and isinstance(inputs[0], np.ndarray) and inputs[0].dtype in (np.float32, np.float64) and inputs[0].ndim in (1, 2)


def main() -> None:
    """Both tables."""
    read: Counter[str] = Counter()
    cases: Counter[str] = Counter()
    why: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for case in node_cases().values():
            inputs, outputs = case.data_sets[0]
            if not in_scope(list(inputs)) or len(case.model.graph.node) != 1:
                continue
            kind = case.model.graph.node[0].op_type
            cases[kind] += 1
            found = outcome(Path(folder), case.model, list(inputs), outputs[0] if outputs else None)
            if isinstance(found, Network):
                read[kind] += 1
            else:
                text = found.removeprefix(f"{folder}/net.onnx: ").partition(";")[0]
                why[text.partition(": ")[2] if text.startswith("node ") else text] += 1
    print("| operator | cases read | of |\n|---|---|---|")
    for kind in sorted(read):
        print(f"| {kind} | {read[kind]} | {cases[kind]} |")
    print(
        f"\n{len(set(cases) - set(read))} other operators have cases with such an input. Why cases are refused:\n"
        "\n| reason | cases |\n|---|---|"
    )
    for text, count in why.most_common(12):
        print(f"| {text} | {count} |")


if __name__ == "__main__":
    main()
