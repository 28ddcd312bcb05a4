# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""SSP: an FMU in a system, with its parameter sets and their schedule."""
