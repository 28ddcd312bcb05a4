# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The flags of inc/penode/pen_status.h by name."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from penode_gen.flags import FLAGS

BIT = {name: 1 << n for n, name in enumerate(FLAGS)}


def names(status: int) -> list[str]:
    """The flags that are set."""
    return [name for name in FLAGS if status & BIT[name]]


def counts(statuses: ArrayLike) -> dict[str, int]:
    """How many samples raised each flag; flags that none raised are left out."""
    array = np.asarray(statuses, dtype=np.uint32)
    return {name: n for name in FLAGS if (n := int(np.count_nonzero(array & BIT[name])))}
