# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A hold-out may begin in motion though the training began at rest, and the other way round."""

from __future__ import annotations

import json

import pytest
from click.testing import CliRunner
from test_mix_ups import RIGS, car, drawn

from penode_sil.cli import cli


@pytest.mark.parametrize("first", [0, 900], ids=["rest", "motion"])
def test_a_right_model_agrees_wherever_its_hold_out_begins(first, tmp_path, monkeypatch):
    """The plant is the model, at rest at first; the hold-out is another recording from there on, or from some time in its motion on."""
    for name, seed, begin in (("train.csv", 1, 0), ("held.csv", 2, first)):
        rows = right(tmp_path, seed, monkeypatch)
        (tmp_path / name).write_text("\n".join([rows[0], *rows[1 + begin :]]) + "\n")
    call = ["diagnose", str(tmp_path / "car.toml"), "--data", str(tmp_path / "train.csv"), "--holdout", str(tmp_path / "held.csv")]
    found = json.loads(CliRunner().invoke(cli, [*call, "-o", str(tmp_path / "out"), "--json"], catch_exceptions=False).stdout)
    assert found["verdict"] == "no_discrepancy" and not found["causes"]
    for gain in found["gain"].values():
        assert gain["before_rmse"] < 1.3 * gain["noise_floor"]


def right(folder, seed, monkeypatch):
    """Lines of a recording of the car with nothing hidden."""
    text, _, *rest = RIGS["car"]
    monkeypatch.setitem(RIGS, "car", (text, lambda u, more: car(u, 0.0), *rest))
    drawn(folder, "car", seed)
    return (folder / "r.csv").read_text().splitlines()
