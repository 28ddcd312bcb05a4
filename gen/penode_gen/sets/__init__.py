# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Parameter sets: their rows, their layout and serial form, the straight pieces they fold to, and what a model file promises of them."""
