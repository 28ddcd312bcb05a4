# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What options choose from, where the help can read it without what is slow to load."""

from __future__ import annotations

# machine of --on pil:MACHINE -> board of its emulator; the host has none
MACHINES = {"m4f": "mps2-an386", "m3": "mps2-an385", "m7": "mps2-an500", "m33": "mps2-an505", "m55": "mps3-an547", "host": ""}
REPLAYS = ("linear", "held", "bandlimited")  # what an input does between the rows of a recording
