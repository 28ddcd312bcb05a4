# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Models without inputs: C99 knows no empty structure and no array of no length, so the C has one input that nothing reads."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from . import expressions as ex
from .causalise import Causal
from .model import Input, Model

UNUSED = Input("unused_", "1", description="the model has no input: not read")  # a name that no model file can have


def with_input(model: Model, causal: Causal) -> tuple[Model, Causal]:
    """Both as they are, or with an unused input if they have none."""
    if model.inputs:
        return model, causal
    padded = replace(model, inputs=(UNUSED,), interpolation="held")
    return padded, replace(causal, model=padded, inputs=(ex.symbol(UNUSED.name),))


def columns(model: Model, u: Any) -> np.ndarray:
    """Inputs [..., n_u] as the C takes them: with a column of zeros for a model without inputs."""
    u = np.asarray(u)
    return u if model.inputs else np.zeros((*u.shape[:-1], 1))
