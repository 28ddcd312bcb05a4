# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings of mechanisms with a hidden effect, from equations written down by hand."""
