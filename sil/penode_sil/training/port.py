# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Networks to be trained, and their inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Port:
    """A network to be trained: the columns of its inputs among those that the engine sees, whether they are rates, whether it is 0
    at 0, and how many knots its shape holds (0: it is no curve)."""

    name: str
    seen: tuple[tuple[int, ...], ...]  # one tuple of columns for each call
    rate: bool
    zero: bool
    knots: int


def inputs_of(port: Port, seen: Sequence[Array]) -> Array:
    """All that went into a network [n, inputs]."""
    return np.concatenate([s[:, list(columns)] for s in seen for columns in port.seen])
