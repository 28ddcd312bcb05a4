# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The search: forms of causes proposed, fitted, compared on held-out blocks, accepted, reconsidered, named. It knows no kind by name."""
