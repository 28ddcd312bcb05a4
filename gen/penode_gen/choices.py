# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Choices of options, in a module that loads fast enough for the help of a command."""

from __future__ import annotations

ACTIVATIONS = ("relu", "identity", "tanh", "sigmoid", "softplus", "step")
