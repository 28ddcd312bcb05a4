# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What all Python tests share."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parent))  # samples.py
os.environ.setdefault("PENODE_BUILD", str(Path(__file__).resolve().parents[1] / "build" / "sil"))  # as the Makefile does


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Tests marked as long (samples.py) are left out unless -m says otherwise, or a test is named."""
    if config.option.markexpr or any("::" in word for word in config.args):
        return
    left = [item for item in items if item.get_closest_marker("long")]
    config.hook.pytest_deselected(items=left)
    items[:] = [item for item in items if not item.get_closest_marker("long")]


@pytest.fixture
def show(capsys: pytest.CaptureFixture[str]) -> Callable[[str], None]:
    """Print a measured figure although pytest captures output."""

    def line(text: str) -> None:
        with capsys.disabled():
            print(f"\n    {text}", end="")

    return line
