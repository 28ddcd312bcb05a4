# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Parameters of which `make test` takes a fixed sample, and `make python-long` the others."""

from __future__ import annotations

from collections.abc import Collection

import pytest


def sample(values: Collection, *kept: object) -> list:
    """All values for pytest.mark.parametrize; those not kept are marked as long. `kept` are some of them, as they stand there."""
    unknown = [value for value in kept if value not in values]
    if unknown or not kept:
        raise ValueError(f"a sample of at least one of the values, not {unknown}")
    long = pytest.mark.long
    return [value if value in kept else pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=long) for value in values]
