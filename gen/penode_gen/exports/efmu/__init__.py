# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""eFMU: manifests, Algorithm Code in GALEC, Production Code and Behavioral Model."""
