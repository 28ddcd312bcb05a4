# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings that several tests train on; made once."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from penode_sil.cli import cli

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Twelve seconds of the plant to train on, and others to judge by."""
    import generator

    folder = tmp_path_factory.mktemp("recordings")
    return tuple(generator.make(generator.Truth(), seed, seconds=12.0).write(folder / f"rec{seed}.csv") for seed in (1, 101))


@pytest.fixture(scope="session")
def trained(recordings: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder that `penode train` made of them."""
    folder = tmp_path_factory.mktemp("trained")
    train, held = recordings
    model = Path(__file__).with_name("quarter.toml")
    result = CliRunner().invoke(cli, ["train", str(model), "--data", str(train), "--holdout", str(held), "-o", str(folder), "--json"])
    assert result.exit_code == 0, result.output
    assert json.loads(result.output) == json.loads((folder / "training.json").read_text())
    return folder
