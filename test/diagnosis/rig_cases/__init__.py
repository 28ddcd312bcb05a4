# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Laboratory rigs with an effect that their model files lack, simulated from equations of motion in C; see README.md one level up."""
