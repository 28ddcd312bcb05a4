# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Equations: from the laws of a model to ordered assignments and their exact derivatives, in SymPy."""
