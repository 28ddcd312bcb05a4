# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What texts choose from, where the help of a command can read it without what is slow to load."""

from __future__ import annotations

ACTIVATIONS = ("relu", "identity", "tanh", "sigmoid", "softplus", "step")
