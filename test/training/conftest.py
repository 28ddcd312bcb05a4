# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings that several tests train on; made once."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Twelve seconds of the plant to train on, and others to judge by."""
    import generator

    folder = tmp_path_factory.mktemp("recordings")
    return tuple(generator.make(generator.Truth(), seed, seconds=12.0).write(folder / f"rec{seed}.csv") for seed in (1, 101))
