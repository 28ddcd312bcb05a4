# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How fast this machine is now: the processor time of a fixed loop, for ratios that mean the same on another machine, or on a busy one."""

from __future__ import annotations

import time

STEPS = 2_000_000


def loop() -> float:
    """Processor time [s] of a million additions and multiplications of plain Python, as it is now."""
    started, x = time.process_time(), 0.0
    for _ in range(STEPS):
        x = 0.5 * x + 1.0
    return (time.process_time() - started) / STEPS * 1e6
