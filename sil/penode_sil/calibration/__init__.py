# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Calibration over XCP: a virtual controller to connect to, and the master side, by pyxcp."""
