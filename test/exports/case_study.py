# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The case study: its model file and the road of its scenario."""

from __future__ import annotations

from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]
NQVM = ROOT / "gen" / "nqvm" / "nqvm.toml"


def chirp(duration: float) -> np.ndarray:
    """The road of the case study's scenario, 0.15 m/s from 1 Hz on, faster by 0.25 Hz a second; sample by sample [n, 1], float."""
    t = np.arange(round(duration / 1e-3) + 1) * 1e-3
    rate = 2 * np.pi * (1 + 0.25 * t)
    return (0.15 / rate * np.sin(2 * np.pi * (t + 0.125 * t**2))).astype(np.float32)[:, None]
