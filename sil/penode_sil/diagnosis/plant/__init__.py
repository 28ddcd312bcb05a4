# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The model as a diagnosis sees it: places where forces may be missing, linearised, and compiled for many runs at once."""
