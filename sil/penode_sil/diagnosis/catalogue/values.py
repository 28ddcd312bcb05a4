# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Another value of a parameter of the model file, as a cause. The search and `checks` find it."""

from __future__ import annotations

from collections.abc import Sequence

from ..result import Cause, Named, Value

KIND = "wrong_parameter"
ROUNDED = 0.01  # the least tolerance of a value for which the file states none


def named(parameter: str) -> Named:
    """The name of this cause."""
    return Named(KIND, parameter)


def cause(parameter: str, value: Value, confidence: float, others: Sequence[str] = ()) -> Cause:
    """The cause, with other parameters that explain the recordings as well."""
    return Cause(KIND, parameter, {parameter: value}, confidence, tuple(map(named, others)))


def is_one(found: Cause) -> bool:
    """Is a cause another value of a parameter?"""
    return found.kind == KIND


def is_off(low: float, high: float, nominal: float, limit: float) -> bool:
    """Is a value known to lie from `low` to `high` farther from its nominal value than a relative `limit`?"""
    far = limit * abs(nominal)
    return not low - far <= nominal <= high + far
