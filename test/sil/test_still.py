# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise from recordings at standstill: what a bench measures goes before what a model file states."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from one_mass import STEP, model
from scipy.signal import StateSpace, lsim

import penode_gen
from penode_sil.cli import main
from penode_sil.diagnosis.study.still import with_noise_at_rest
from penode_sil.errors import UserError
from penode_sil.recordings.measured import load

SAMPLES = 4000
MASS, STIFFNESS, DAMPING, NOISE = 2.0, 800.0, 8.0, 1e-5
STATED = 3e-3  # [m] in the model file: that of another sensor, half of the motion
MODEL = model(MASS, STIFFNESS, DAMPING, 0.01, f'x_mass = {{ value = "x", unit = "mm", noise = {STATED * 1e3} }}')


def recording(path: Path, damping: float, seed: int, moves: bool = True) -> Path:
    """A rig with this damping [N*s/m] under a random push, or at standstill; as a table in mm."""
    rng = np.random.default_rng(seed)
    t = np.arange(SAMPLES) * STEP
    push = np.convolve(rng.standard_normal(SAMPLES), np.ones(20) / 20.0, "same") * 10.0 * np.minimum(t, 1.0) * moves
    plant = StateSpace([[0.0, 1.0], [-STIFFNESS / MASS, -damping / MASS]], [[0.0], [1.0 / MASS]], [[1.0, 0.0]], [[0.0]])
    x = lsim(plant, push, t)[1] + NOISE * rng.standard_normal(SAMPLES)
    np.savetxt(path, np.column_stack([t, push, 1e3 * x]), delimiter=",", header="time [s],push [N],x_mass [mm]", comments="", fmt="%.9g")
    return path


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    (tmp_path / "rig.toml").write_text(MODEL)
    recording(tmp_path / "moves.csv", 1.15 * DAMPING, 1)
    recording(tmp_path / "still.csv", DAMPING, 2, moves=False)
    return tmp_path


def diagnosed(rig: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, *words: object) -> dict:
    line = ["penode", "diagnose", rig / "rig.toml", "--data", rig / "moves.csv", "-o", rig / "out", "--json", *words]
    monkeypatch.setattr(sys, "argv", list(map(str, line)))
    main()
    return json.loads(capsys.readouterr().out)


def test_a_wrong_damping_is_found_in_the_noise_of_the_bench_not_in_that_of_the_file(rig, monkeypatch, capsys):
    """Also without a recording at rest: neighbouring samples show that the noise is less than what the file states."""
    for more in ((), ("--still", rig / "still.csv")):
        found = diagnosed(rig, monkeypatch, capsys, *more)
        assert [(c["kind"], c["where"]) for c in found["causes"]] == [("wrong_parameter", "d")]
        low, high = found["causes"][0]["parameters"]["d"]["ci95"]
        assert low < 1.15 * DAMPING < high


def test_noise_is_that_of_all_recordings_about_a_drift(rig):
    known = penode_gen.load(rig / "rig.toml")
    t, push, x = np.loadtxt(rig / "still.csv", delimiter=",", skiprows=1).T
    np.savetxt(
        rig / "drifts.csv", np.column_stack([t, push, x + 5.0 * t]), delimiter=",", header="time [s],push [N],x_mass [mm]", comments=""
    )
    quiet = with_noise_at_rest(known, [rig / "still.csv", rig / "drifts.csv"], (), ())
    assert abs(quiet.sensors[0].noise / NOISE - 1.0) < 4.0 / np.sqrt(2.0 * SAMPLES)  # four deviations of an estimate from so many samples
    assert quiet.inputs == known.inputs  # a push that is exactly zero shows no noise
    assert with_noise_at_rest(known, [], (), ()) == known


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (None, "x_mass varies by .* m, in a recording of motion by .* m; --still takes a recording in which nothing moves"),
        ("time [s],speed [m/s]\n0,1\n1,1\n", "it holds no sensor or input of the model; record at least one of: push, x_mass"),
        ("time [s],x_mass [mm]\n0,1\n1,2\n", "channel x_mass has 2 samples; a noise needs at least 100, record longer"),
        ("time [s],x_mass [s]\n0,1\n1,2\n", "x_mass"),
    ],
)
def test_what_is_no_standstill_is_one_line(rig, text, line):
    path = rig / "moves.csv"
    if text is not None:
        path = rig / "bad.csv"
        path.write_text(text)
    known = penode_gen.load(rig / "rig.toml")
    with pytest.raises(UserError, match=line) as caught:
        with_noise_at_rest(known, [path], (), load([rig / "moves.csv"], known))
    assert len(caught.value.problems) == 1
