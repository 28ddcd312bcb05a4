# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A fit that does not come down to the noise: what is left says so, other starts are tried, the command ends with 4, channels are asked
about."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import penode_gen
from penode_sil.cli import cli, main
from penode_sil.errors import NotConverged, RecordingError
from penode_sil.recordings.measured import load
from penode_sil.training import asked, data, heldout, left, notes, story, threads, tries
from penode_sil.training.engine import Engine
from penode_sil.training.problem import Problem
from penode_sil.training.result import Error

sys.path.insert(0, str(Path(__file__).with_name("smooth")))
import plants


def remains(ratio: float, alike: float) -> left.Left:
    """What is left of one signal."""
    return left.Left(("a",), np.array([ratio]), np.array([0.01]), np.array([alike]), np.array([1000.0]))


def test_noise_has_no_memory_and_what_a_fit_missed_has() -> None:
    random = np.random.default_rng(1)
    noise, slow = random.standard_normal(40_000), 0.2 * np.sin(np.arange(40_000) * 0.02)
    assert left._alike([noise]) == 0.0 and left._alike([noise + slow]) > 0.0  # 2 % of the noise's variance
    assert left._alike([np.where(np.arange(40_000) % 3 == 0, noise, 0.0)]) == 0.0  # a sensor that is slower


@pytest.mark.parametrize(
    ("ratio", "alike", "unfinished"), [(1.0, 0.1, False), (1.1, 0.1, True), (1.1, 0.0, False), (1.3, 0.0, True), (np.nan, 0.5, False)]
)
def test_another_start_is_tried_where_one_may_lead_further(ratio: float, alike: float, unfinished: bool) -> None:
    assert remains(ratio, alike).unfinished == unfinished


def test_of_several_starts_the_one_that_predicts_best_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first leaves all bounds, so the recording is doubted; the second leaves least, and the third predicts best."""
    ends, asked_for = {1: (1.2, 5.0), 2: (1.3, 4.0)}, []
    fits = {k: (SimpleNamespace(with_=lambda noise, k=k: k, noise=None), SimpleNamespace(point=k)) for k in ends}
    monkeypatch.setattr(left, "of", lambda problem, point: remains(ends[point][0], 0.1))
    monkeypatch.setattr(tries, "_predicted", lambda problem, fit: ends[fit.point][1])
    _, fit, tried = tries.several(lambda k, tell: (f"start {k}", fits.get(k)), lambda: asked_for.append(1), lambda share, doing: None)
    assert fit.point == 2 and asked_for == [1]
    assert [(t.start, t.heldout) for t in tried[:2]] == [("start 2", 4.0), ("start 1", 5.0)] and tried[2].start == "start 0"
    with pytest.raises(FloatingPointError, match="from each of 3 starts"):
        tries.several(lambda k, tell: (f"start {k}", None), lambda: None, lambda share, doing: None)


def test_what_was_tried_is_said() -> None:
    (one,) = notes.noise(
        remains(1.5, 0.2), (tries.Try("straight lines", 1.5), tries.Try("start 2", 1.51), tries.Try("start 3", float("nan")))
    )
    assert "straight lines (1.5), start 2 (1.51), start 3 (left all bounds)" in one and "penode diagnose" in one
    assert "lacks something" not in one
    (one,) = notes.noise(remains(1.5, 0.2), (tries.Try("straight lines", 1.5), tries.Try("start 2", 2.5)))
    assert "--seed" in one
    assert "may be too small" in notes.noise(remains(100.0, 0.0), (tries.Try("straight lines", 100.0),))[1]
    assert "0.1 times" in notes.noise(remains(0.1, 0.0), (tries.Try("straight lines", 0.1),))[0]
    assert notes.noise(remains(1.0, 0.0), (tries.Try("straight lines", 1.0),)) == []


def test_the_remedy_for_how_inputs_run_is_named_where_it_helps() -> None:
    error = Error("a", "m/s^2", 1.0, 0.1, 0.11, 0.1, 0.1, True)
    (one,) = notes.deployed([error], [replace(error, deployed=0.1001)])
    assert "10.0 % more" in one and 'input = "cubic"' in one and "0.1 % more" in one
    assert notes.deployed([error], [replace(error, deployed=0.109)]) == []
    assert notes.deployed([replace(error, deployed=0.101)], [error]) == []


@pytest.mark.parametrize(
    ("factor", "code", "said"), [(0.01, 4, "may be too small"), (1.0, 0, ""), (10.0, 0, "times the noise that the model")]
)
def test_residuals_are_judged_by_the_stated_noise(
    factor: float, code: int, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plant = plants.draw("tank", 1, 14.0)
    model, table = plant.write(tmp_path)
    model.write_text(re.sub(r"noise = ([\d.]+)", lambda m: f"noise = {float(m[1]) * factor:g}", plant.model))
    monkeypatch.setattr(sys, "argv", ["penode", "train", str(model), "--data", str(table), "-o", str(tmp_path / "out"), "--json"])
    try:
        main()
        ended = 0
    except SystemExit as exc:
        ended = exc.code
    found = json.loads(capsys.readouterr().out)
    assert ended == code, found["notes"]
    assert found["converged"] == (code == 0) and found["chi2"] == pytest.approx(factor**-2.0, rel=0.1)
    assert found["training"][0]["stated"] and any(said in n for n in [*found["notes"], ""])
    assert (tmp_path / "out" / "model_trained.toml").exists() and found["tried"][0]["ratio"] > 0.0
    assert len(found["tried"]) == (3 if code else 1)


def test_exit_code_4_is_in_the_help() -> None:
    said = CliRunner().invoke(cli, ["train", "--help"]).output
    assert re.search(r"4 the\s+fit\s+did\s+not\s+reach\s+the\s+stated\s+noise", said), said


@pytest.fixture(scope="module")
def vehicle(tmp_path_factory: pytest.TempPathFactory) -> tuple[Problem, list[story.Port]]:
    """Three seconds of a vehicle whose spring and damper are networks alone."""
    path, table = plants.draw("alone", 1, 3.0).write(tmp_path_factory.mktemp("vehicle"))
    model = penode_gen.load(path)
    engine = Engine(model, [])
    records = tuple(data.record(model, m, engine.signals) for m in load([table], model))
    ports = story.ports_of(model, engine)
    return Problem(engine, records, data.at_first(model, records, engine.signals), np.ones(len(ports))), ports


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (None, ""),
        (asked._times(asked._INPUT, (0,), -1.0), "has z_road the wrong sign? "),
        (asked._times(asked._SIGNAL, (0, 1), 1.0 / 9.80665), "are a_body and a_wheel in g? "),
        (asked._exchanged(asked._SIGNAL, 0, 1), "are a_body and a_wheel exchanged? "),
    ],
)
def test_channels_are_asked_about(change, says: str, vehicle: tuple[Problem, list[story.Port]]) -> None:
    problem, ports = vehicle
    if change:
        problem = problem.with_(records=tuple(change(r) for r in problem.records))
    with threads.one():
        said = asked.question(problem, ports)
    assert said.startswith(says) and bool(said) == bool(says), said


def test_a_question_is_one_line_with_its_remedy(tmp_path: Path) -> None:
    plant = plants.draw("alone", 1, 3.0)
    model, table = plant.write(tmp_path)
    table.write_text(plant.table.replace("z_road [m]", "z_road [km]"))  # a thousand times too large, as a road in mm is
    result = CliRunner().invoke(cli, ["train", str(model), "--data", str(table), "-o", str(tmp_path / "out")])
    assert isinstance(result.exception, RecordingError), result.output
    assert "rec.csv: is z_road in mm?" in str(result.exception) and "--channel 'z_road=z_road [mm]'" in str(result.exception)
    assert not (tmp_path / "out").exists()


def test_what_stays_within_bounds_from_no_start_did_not_converge() -> None:
    assert NotConverged("m.toml: a; b").as_json()["error"]["exit"] == 4


def test_loud_is_beside_the_stated_noise(vehicle: tuple[Problem, list[story.Port]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(left, "of", lambda problem, point: remains(1.26, 0.0))
    assert heldout.loud(vehicle[0], None)
