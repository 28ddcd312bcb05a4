# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The Algorithm Code of a model step by step against its C, each step from the C's state."""

from __future__ import annotations

from typing import Any

import numpy as np
from galec import Block

from penode_gen.exports.efmu import code as efmu_code
from penode_sil.targets import Sil


def distances(model: Any, u: np.ndarray, real: type, text: str = "", signals: frozenset[str] = frozenset()) -> np.ndarray:
    """
    How far each state, then each output, is from the C's after each step, in ulp of the largest value that it has in the run.

    `u` [n, inputs]; step k of the block starts from the C's state and input k - 1. [n, states + outputs]
    """
    run = Sil(model, real).run(u)
    wanted = np.concatenate([run.x, run.y], axis=1)
    block = Block(text or efmu_code.block(model).text, real)
    assert block.run("Startup") == set() and block.run("Recalibrate") == signals
    states, outputs = [f"'state.{s}'" for s in model.states], [name for name, kind in block.kinds.items() if kind == "output"]
    found = np.empty_like(wanted)
    for k, row in enumerate(u):
        block.values |= {i.name: real(v) for i, v in zip(model.inputs, row, strict=True)}
        assert block.run("DoStep") == signals
        found[k] = [block.values[name] for name in (*states, *outputs)]
        block.values |= {name: real(v) for name, v in zip(states, run.x[k], strict=True)}
    unit = np.spacing(np.abs(wanted).max(axis=0).astype(real))
    return np.abs(found.astype(float) - wanted.astype(float)) / unit
