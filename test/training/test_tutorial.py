# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""sil/TRAINING.md as it stands: its model file, its commands, all that it says that they print; and what they write."""

from __future__ import annotations

import importlib.util
import json
import sys
from pathlib import Path
from types import ModuleType

import generator
import jsonschema
import pytest

from penode_gen import load
from penode_gen.sets.promises import broken

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "sil/TRAINING.md"


def module(path: str) -> ModuleType:
    """A program of another folder, by its path."""
    spec = importlib.util.spec_from_file_location(Path(path).stem, ROOT / path)
    assert spec and spec.loader
    found = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = found  # dataclasses look there
    spec.loader.exec_module(found)
    return found


def test_page_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", ["generator.py", str(tmp_path)])
    generator.main()
    steps = list(module("test/manual/replay.py").replay(PAGE.read_text(encoding="utf-8"), tmp_path))
    assert len(steps) == 3
    for step in steps:
        assert step.same, f"{step.what}: the page has\n{step.expected}\nbut there is\n{step.found}"
    trained = load(tmp_path / "trained" / "model_trained.toml")
    for name, port in trained.networks.items():
        assert not port.promises or broken(port.promises, trained.sets["default"].networks[name], False) == []
    assert {"car.set", "report.html", "training.json", "spring_net.onnx", "damper_net.onnx"} <= {
        p.name for p in (tmp_path / "trained").iterdir()
    }
    written = json.loads((tmp_path / "trained/training.json").read_text(encoding="utf-8"))
    jsonschema.validate(written, module("sil/manual/schemas.py").schema("training"))
