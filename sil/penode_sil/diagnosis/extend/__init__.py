# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The extended model file: causes as elements, values, a network for what has no name, and what all that gains."""
