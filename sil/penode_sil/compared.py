# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model that was written beside the nominal one: which of them predicts worse, and what becomes of a file that does."""

from __future__ import annotations

from dataclasses import dataclass

REJECTED = "model_rejected.toml"  # a written model that predicts worse than the nominal one


def rejected(text: str, name: str) -> str:
    """The text of REJECTED: that of a model file which would be called `name` if it predicted better."""
    return f"# Keep the nominal model: this one predicts worse. It would be {name} if it did not.\n{text}"


def worsened(before: float, after: float) -> bool:
    """Is an error larger than before, or none at all? Less than 5 % may be chance."""
    return not after <= 1.05 * before


@dataclass(frozen=True)
class Compared:
    """RMS error of the nominal model as `penode simulate` gives it, of a sensor over all `samples` of a recording, in the unit of the model
    file. `role`: training or hold-out."""

    recording: str
    role: str
    signal: str
    unit: str
    samples: int
    nominal: float
