# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An attempt at a diagnosis that takes its process down. A module of its own, for other processes find it by its name."""

from __future__ import annotations

import os
import signal

from penode_sil.diagnosis import folder
from penode_sil.diagnosis.files import Job


def dying(one: Job) -> folder.Answer:
    """Takes its process down for one of the recordings; for the others it claims to have written files."""
    if "friction" in one.data[0].name:
        os.kill(os.getpid(), signal.SIGKILL)
    return {"verdict": "no_discrepancy", "causes": [], "gain": {}, "seconds": 0.0}, ""
