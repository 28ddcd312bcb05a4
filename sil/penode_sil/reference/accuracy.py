# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Tolerances of the integrators, and their errors."""

RTOL, ATOL = 1e-12, 1e-14  # errors of a step. At a kink the estimates are too small: errors of some 3e-9 of a state


class Unsolved(Exception):
    """No step is small enough, or a state is not finite, at a time [s], the only argument."""
