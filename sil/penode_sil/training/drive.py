# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What drives a model between the samples of a recording, at the times where a step of its method needs it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from penode_gen.model import Model

Array = NDArray[np.float64]
NODES = {"euler": (0.0,), "heun": (0.0, 1.0), "rk4": (0.0, 0.5, 0.5, 1.0)}
SHARES = {"euler": (1.0,), "heun": (0.5, 0.5), "rk4": (1 / 6, 1 / 3, 1 / 3, 1 / 6)}


@dataclass(frozen=True, eq=False)
class Drive:
    """u [n, 2, n_u]: inputs and their rates at the samples; between [n - 1, substeps, stages, 2, n_u]: on the way to the next.
    `step` [s] is that of a substep."""

    method: str
    substeps: int
    step: float
    u: Array
    between: Array


def drive(model: Model, u: Array, held: bool) -> Drive:
    """The drive of a model by samples u [n, n_u]: a smooth curve through them, or steps where the input is held.

    A model that is deployed with a linearly implicit method trains with RK4 in its substeps; such methods serve stiff plants, which RK4
    may not simulate: then the simulation leaves all bounds, which is reported.
    """
    method = model.method if model.method in NODES else "rk4"
    n, substeps = len(u), model.substeps
    u = u if u.shape[1] else np.zeros((n, 0))
    nodes = (np.arange(substeps)[:, None] + np.array(NODES[method])[None, :]) / substeps
    at = np.arange(n - 1)[:, None, None] + nodes[None]
    if not u.shape[1]:
        both, between = np.zeros((n, 2, 0)), np.zeros((*at.shape, 2, 0))
    elif held:
        both = np.stack([u, np.zeros_like(u)], axis=1)
        between = both[:-1, None, None] * np.ones((1, *nodes.shape, 1, 1))
    else:
        spline = CubicSpline(np.arange(n), u)
        rate = spline.derivative()
        both = np.stack([u, rate(np.arange(n)) / model.sample_time], axis=1)
        between = np.stack([spline(at), rate(at) / model.sample_time], axis=-2)
    return Drive(method, substeps, model.sample_time / substeps, np.ascontiguousarray(both), np.ascontiguousarray(between))
