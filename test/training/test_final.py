# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The final check of a training: figures are those of `penode simulate`, and a model that predicts worse is not handed out."""

from __future__ import annotations

import json
import shlex
import sys
from pathlib import Path

import generator
import pytest
from click.testing import CliRunner

from penode_sil.cli import cli, main

MODEL = Path(__file__).with_name("quarter.toml")


def test_figures_are_those_of_simulate(recordings: tuple[Path, Path], trained: Path, tmp_path: Path) -> None:
    found = json.loads((trained / "training.json").read_text())
    assert {(f["recording"], f["role"]) for f in found["figures"]} == {(recordings[0].name, "training"), (recordings[1].name, "hold-out")}
    assert found["model_file"] == "model_trained.toml"
    for what, model in (("nominal", MODEL), ("trained", trained / found["model_file"])):
        for recording in recordings:
            call = ["simulate", str(model), "--input", str(recording), "-o", str(tmp_path / "z.csv"), "--json"]
            result = CliRunner().invoke(cli, [*call, *shlex.split(found["simulated"])])
            given = json.loads(result.output)["instances"][0]["rmse"]
            own = {f["signal"]: f for f in found["figures"] if f["recording"] == recording.name}
            assert own.keys() == given.keys() and all(own[k][what] == e["value"] for k, e in given.items())


def test_a_model_that_predicts_worse_is_rejected(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Trained on a vehicle with a friction, tested on one that is as the model file has it."""
    train = generator.make(generator.Truth(), 1, seconds=4.0).write(tmp_path / "train.csv")
    held = generator.make(generator.Truth(spring=0, damper=0), 101, seconds=4.0).write(tmp_path / "held.csv")
    out = tmp_path / "out"
    out.mkdir()
    (out / "model_trained.toml").write_text("of a training before")
    monkeypatch.setattr(sys, "argv", ["penode", "train", str(MODEL), "--data", str(train), "--holdout", str(held), "-o", str(out)])
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr().out
    assert ended.value.code == 4 and "keep the nominal model" in said.splitlines()[0]
    assert (out / "model_rejected.toml").read_text().startswith("# Keep the nominal model")
    assert not (out / "model_trained.toml").exists() and not list(out.glob("*.set"))
    found = json.loads((out / "training.json").read_text())
    assert found["model_file"] == "model_rejected.toml" and "predicts a_body, a_wheel worse" in found["notes"][0]
    assert "Keep the nominal model" in (out / "report.html").read_text()
    again = ["penode", "train", str(MODEL), "--data", str(train), "-o", str(tmp_path / "again"), "--from", str(out / "training.json")]
    monkeypatch.setattr(sys, "argv", again)
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 2 and "was rejected" in capsys.readouterr().err
