# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""sil/TRAINING.md as it stands: its model file, its commands, what it says that they print."""

from __future__ import annotations

import importlib.util
import json
import re
import shlex
import shutil
from pathlib import Path

import jsonschema
import pytest
from click.testing import CliRunner

from penode_gen import load
from penode_gen.sets.promises import broken
from penode_sil.cli import cli

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "sil" / "TRAINING.md"


def schema() -> dict[str, object]:
    """The one that the manual shows of training.json."""
    spec = importlib.util.spec_from_file_location("schemas", ROOT / "sil/manual/schemas.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.schema("training")


def test_page_runs(recordings: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = PAGE.read_text(encoding="utf-8")
    for path, name in zip(recordings, ("train.csv", "holdout.csv"), strict=True):
        shutil.copy(path, tmp_path / name)
    (model,) = re.findall(r"```toml\n(.*?)```", text, re.DOTALL)
    (tmp_path / "car.toml").write_text(model, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    commands = [line.strip() for line in text.splitlines() if line.startswith("    penode ")]
    assert len(commands) == 2
    for command in commands:
        result = CliRunner().invoke(cli, shlex.split(command)[1:])
        assert result.exit_code == 0, (command, result.output, result.exception)
    assert "car: trained" in result.output and "not identifiable: the common scale of m_b" in result.output
    trained = load(tmp_path / "trained" / "model_trained.toml")
    for name, port in trained.networks.items():
        assert not port.promises or broken(port.promises, trained.sets["default"].networks[name], False) == []
    assert {"car.set", "report.html", "training.json", "spring_net.onnx", "damper_net.onnx"} <= {
        p.name for p in (tmp_path / "trained").iterdir()
    }
    jsonschema.validate(json.loads((tmp_path / "trained/training.json").read_text(encoding="utf-8")), schema())
