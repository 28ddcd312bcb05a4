# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the tests of sil/ share: models, and the published case study where it exists."""

from __future__ import annotations

import json
import os
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import penode_gen
from penode_sil.cli import main

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))


@pytest.fixture(scope="session")
def shared() -> Path:
    """The folder with the published numbers; tests that need it skip where it is not."""
    folder = Path(os.environ.get("PENODE_SHARED", ROOT.parent / "shared")) / "nqvm-published"
    if not (folder / "chirp_reference.csv").exists():
        pytest.skip(f"the published numbers are not at {folder}; set PENODE_SHARED to their folder to run this")
    return folder


@pytest.fixture(scope="session")
def published(shared: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., object]:
    """published(method=, input=, substeps=) loads the case study; its set "altered" has half the damper network."""
    folder = tmp_path_factory.mktemp("published")
    for name in ("spring", "damper"):
        shutil.copy(shared / f"{name}.json", folder / f"{name}.json")
    altered = json.loads((folder / "damper.json").read_text())
    last = altered["layers"][-1]
    last["weights"] = [[0.5 * w for w in row] for row in last["weights"]]
    (folder / "altered.json").write_text(json.dumps(altered))
    text = (HERE / "models" / "published.toml").read_text()

    def load(method: str = "rk4", input: str = "linear", substeps: int = 1) -> object:
        path = folder / f"{method}_{input}_{substeps}.toml"
        path.write_text(
            text.replace('method = "rk4"', f'method = "{method}"')
            .replace('input = "linear"', f'input = "{input}"')
            .replace("substeps = 1", f"substeps = {substeps}")
        )
        return penode_gen.load(path)

    return load


@pytest.fixture(scope="session")
def oscillator() -> object:
    """Mass, spring, damper over a moving foot; sets "default" and "stiff"."""
    return penode_gen.load(HERE / "models" / "oscillator.toml")


@pytest.fixture(scope="session")
def nqvm() -> object:
    """The project's own model."""
    return penode_gen.load(ROOT / "gen" / "nqvm" / "nqvm.toml")


@pytest.fixture
def penode(monkeypatch, capsys):
    """penode(*words, code=0) runs the command here; gives its stdout, or the lines of its stderr if it is to fail."""

    def run(*words, code=0):
        monkeypatch.setattr(sys, "argv", ["penode", *map(str, words)])
        try:
            main()
            ended = 0
        except SystemExit as exc:
            ended = exc.code or 0
        out, run.notes = capsys.readouterr()
        assert ended == code, out + run.notes
        return out if code == 0 else run.notes.splitlines()

    return run
