# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Models driven by inputs that move in steps, where a model's own step joins its inputs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from ..study.noise import Experiment
from .compiling import moving

Array = NDArray[np.float64]


def run(model: Model, e: Experiment, simulate: Callable[[Model], Array]) -> Array:
    """What `simulate` gives for a model whose inputs move as those of a recording do.

    Where all of them move in steps: held ones step with the samples, those joined by lines half a sample before, and for small
    differences like these responses are linear in between.
    """
    if e.held is None or not e.held.all() or moving(model):
        return simulate(model)
    held = simulate(replace(model, interpolation="held"))
    return held + 2.0 * e.lead * (simulate(replace(model, interpolation="linear")) - held) if e.lead > 0.0 else held
