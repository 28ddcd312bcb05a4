# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Model files without tolerances in which one value or two are wrong."""
