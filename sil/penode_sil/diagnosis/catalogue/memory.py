# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forces of laws with states of their own along a motion, from the same C as the model's; and a lag."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_banded

import penode_gen
from penode_gen import laws

from ...batch import Batch

Array = NDArray[np.float64]
# least steps in a period of the motion: gas in a pocket of a tenth of it is 75 times as fast, and Runge-Kutta is stable up to 2.78 a step
PERIOD = 256
MODEL = """[model]
name = "memory"
sample_time = "{step!r} s"
substeps = {substeps}
[parameters]
{parameters}
[inputs]
x = {{ unit = "m" }}
[elements]
e = {{ between = ["x", "ground"], law = "{law}", {arguments} }}
[outputs]
force = {{ value = "F_e", unit = "N" }}
"""


def lag(x: Array, tau: float, step: float) -> Array:
    """First-order lag of x."""
    a = np.exp(-step / tau)
    return solve_banded((1, 0), np.stack([np.ones_like(x), np.full_like(x, -a)]), (1.0 - a) * x, check_finite=False)


def force(law: str, values: Mapping[str, float], s: Array, step: float) -> Array:
    """Force [n] of a law between ends that move apart by s [n], `step` [s] apart, from rest at s[0]. A call costs one simulation."""
    parameters = {f"p_{k}": np.array([v]) for k, v in values.items()}
    period = 2.0 * np.pi * float(np.std(s)) / max(float(np.std(np.diff(s))), 1e-300)  # of the motion, in samples
    ways = float(np.max(np.abs(np.diff(s)), initial=0.0)) / values.get("presliding", np.inf)  # in a sample; bristles bend back in one
    substeps = 2 ** max(0, int(np.ceil(np.log2(max(PERIOD / max(period, 1.0), ways, 1.0))))) if np.isfinite(period) else 1
    return _batch(law, step, substeps).run((s - s[0])[:, None], parameters=parameters, outputs=("force",)).y[0, :, 0]


@cache
def _batch(law: str, step: float, substeps: int) -> Batch:
    arguments = laws.LAWS[law].arguments
    text = MODEL.format(
        step=step,
        substeps=substeps,
        law=law,
        arguments=", ".join(f'{a} = "p_{a}"' for a in arguments),
        parameters="\n".join(f'p_{a} = {{ value = 1, unit = "{u}" }}' for a, u in arguments.items()),
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "memory.toml"
        path.write_text(text)
        return Batch(replace(penode_gen.load(path), interpolation="cubic"), exact=False)
