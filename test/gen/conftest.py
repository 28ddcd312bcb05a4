# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the tests of gen/ share."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from penode_gen.emission import selftest

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "prove")]  # models and graphs; the reference of prove-promise


@pytest.fixture(scope="module", autouse=True)
def short_self_tests() -> Iterator[None]:
    """Self-tests of 8 samples instead of 200: what is generated here is mostly not about them. test_selftest.py sets its own length."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(selftest, "LEVELS", 1)
        yield
