# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Models without inputs: C99 knows no empty structure and no array of no length, so the C has one input that nothing reads."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ..model import Input, Model
from . import expressions as ex
from .causalise import Causal
from .sampled import as_inputs

UNUSED = Input("unused_", "1", description="the model has no input: not read")  # a name that no model file can have


def with_input(model: Model, causal: Causal) -> tuple[Model, Causal]:
    """Both with what the C takes for inputs: signals of actuators that work on samples, and an unused input where there is none."""
    if model.inputs:
        return as_inputs(model, causal)
    padded = replace(model, inputs=(UNUSED,), interpolation="held")
    return padded, replace(causal, model=padded, inputs=(ex.symbol(UNUSED.name),))


def columns(model: Model, u: Any) -> np.ndarray:
    """Inputs [..., n_u] as the C takes them: with a column of zeros for a model without inputs."""
    u = np.asarray(u)
    return u if model.inputs else np.zeros((*u.shape[:-1], 1))
