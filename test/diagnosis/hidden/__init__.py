# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings with a hidden physical effect. Shares nothing with the program that has to find it."""
