# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A2L for calibration tools, with the types and addresses of a linked program."""
