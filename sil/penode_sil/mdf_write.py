# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Tables as MDF 4 files: one channel group, its time as the master."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from .output import Column, whole


def write_mf4(path: Path, columns: list[Column], comment: str = "penode simulate") -> None:
    """Write columns, the first of which is the time [s], with their units; doubles, and whole numbers as they are. `comment`: who wrote
    it."""
    from asammdf import MDF, Signal  # slow to load

    time, *others = columns
    stamps = np.asarray(time.values, dtype=np.float64)
    signals = []
    for column in others:
        values = np.asarray(column.values)
        signals.append(Signal(values if values.dtype.kind in "iu" else values.astype(np.float64), stamps, column.unit, column.name))
    with whole(path) as part, MDF(version="4.10") as file:
        file.append(signals, comment=comment, common_timebase=True)
        file.save(part, overwrite=True)
