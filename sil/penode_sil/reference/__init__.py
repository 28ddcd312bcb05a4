# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How the reference simulation integrates: compiled where it can be, else by SciPy."""
