# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where tests find files: this folder, and the checkout."""

from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
