# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Run a model in the loop: reference (MiL), compiled C on the host (SiL), compiled C on an emulated Cortex-M (PiL)."""
