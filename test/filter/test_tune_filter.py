# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode tune-filter`: noises that are known are found, what is written is what was found, and a measured joint."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import plant
import pytest
from test_filter_command import penode

import penode_gen
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.estimates import FLAGS, Estimates
from penode_sil.filtering.innovations import consistency, log_likelihood
from penode_sil.filtering.variable import Variable

HERE = Path(__file__).parent
NQVM = HERE.parents[1] / "gen" / "nqvm" / "nqvm_folded.toml"
MEASURED = Path(os.environ.get("PENODE_SHARED", HERE.parents[2] / "shared")) / "measured" / "robot_joint"
WRONG = """[model]
extends = "{path}"
name = "guessed"

[filter.sensors]
a_body = {{ noise = 0.05 }}
a_wheel = {{ noise = 0.05, gate = 8 }}

[filter.states] # as guessed
z_b = {{ start = 1e-3 }}
z_w = {{ start = 1e-3 }}
v_b = {{ start = 1e-2, noise = 1e-2 }}
v_w = {{ start = 1e-2, noise = 1e-2 }}

[filter.inputs]
z_road = {{ noise = 2e-3, correlation = "1 s" }}
"""


@pytest.fixture(scope="module")
def guessed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, penode_gen.Model]:
    """A folder with 8 s of a plant whose noises are those of folded.toml, and a model file that guesses others; the true model."""
    folder = tmp_path_factory.mktemp("tune")
    true = penode_gen.load(HERE / "models" / "folded.toml")
    z = plant.drive(plant.Plant(true), true, 8000, 1, seed=5).z[:, 0]
    rows = np.column_stack([np.arange(8000) * plant.H, z])
    np.savetxt(folder / "rec.csv", rows, "%.9g", ",", header="time [s],a_body [m/s^2],a_wheel [m/s^2]", comments="")
    (folder / "guessed.toml").write_text(WRONG.format(path=NQVM.as_posix()))
    return folder, true


def test_noises_that_are_known_are_found(guessed: tuple[Path, penode_gen.Model], show: Callable[[str], None]) -> None:
    folder, true = guessed
    words = ["tune-filter", folder / "guessed.toml", "--sensors", "--data", folder / "rec.csv", "-o", folder / "out" / "tuned.toml"]
    found = json.loads(penode(*words, "--json"))
    tuned = penode_gen.load(folder / "out" / "tuned.toml").filter
    for own, right in zip((*tuned.sensors, *tuned.inputs), (*true.filter.sensors, *true.filter.inputs), strict=True):
        assert own.noise == pytest.approx(right.noise, rel=0.2), own.name
    assert tuned.sensors[1].gate == 8.0 and tuned.inputs[0].decay == true.filter.inputs[0].decay
    assert [s.start for s in tuned.states] == [1e-3, 1e-3, 1e-2, 1e-2] and tuned.states[0].noise == 0.0
    assert found["after"]["log_likelihood"] > found["before"]["log_likelihood"]
    for sensor in found["after"]["sensors"].values():
        assert sensor["band"][0] <= sensor["mean_ratio"] <= sensor["band"][1] and abs(sensor["lag_1"]) < 0.05
    for noise in found["noises"]:
        show(f"{noise['table']}.{noise['name']}: {noise['before']:.3g} -> {noise['after']:.3g} {noise['unit']}")
    own = {n["name"]: n["after"] for n in found["noises"]}
    assert tuned.states[2].noise == pytest.approx(own["v_b"] * np.sqrt(plant.H), rel=1e-5)


def test_table_has_errors_before_and_after(guessed: tuple[Path, penode_gen.Model]) -> None:
    folder, _ = guessed
    record = folder / "rec.csv"
    said = penode("tune-filter", folder / "guessed.toml", "--data", record, "--holdout", record, "-o", folder / "own.toml")
    assert "  inputs.z_road.noise: 0.002 -> " in said and "sensors." not in said
    assert "  held out, 16000 measurements: log-likelihood " in said and said.count("mean NIS") == 8
    text = (folder / "own.toml").read_text()
    assert 'extends = "guessed.toml"' in text and "[filter.inputs]" in text and "[filter.sensors]" not in text
    assert (folder / "guessed.toml").read_text() == WRONG.format(path=NQVM.as_posix())


def test_library_with_factors_is_that_of_a_file_with_these_noises(tmp_path: Path) -> None:
    model = penode_gen.load(HERE / "models" / "folded.toml")
    z = plant.drive(plant.Plant(model), model, 300, 1, seed=2).z[:, 0]
    factors = {("inputs", "z_road"): 2.0, ("sensors", "a_wheel"): 4.0, ("states", "v_b"): 0.5}
    (variable,) = Variable(model, "default").run(factors, [(np.zeros((300, 1)), z, np.full(300, 3, np.uint32))])
    text = (HERE / "models" / "folded.toml").read_text().replace("../../../gen", str(HERE.parents[1] / "gen"))
    for old, new in (("noise = 1e-3, corr", "noise = 2e-3, corr"), ("a_wheel = {}", "a_wheel = { noise = 0.4 }")):
        assert old in text
        text = text.replace(old, new)
    line = next(line for line in text.splitlines() if line.startswith("v_b = { start"))
    text = text.replace(line, line.replace("noise = 1e-4", "noise = 0.5e-4"))
    (tmp_path / "folded.toml").write_text(text)
    other = Compiled(penode_gen.load(tmp_path / "folded.toml"), np.float64).filter().run(np.zeros((300, 1)), z, estimates=False)[0]
    assert variable.innovation == pytest.approx(other.innovation, rel=1e-9, abs=1e-15)
    assert variable.variance == pytest.approx(other.variance, rel=1e-9)


def innovations(innovation: list[list[float]], verdict: list[list[int]], status: list[int]) -> Estimates:
    e = np.array(innovation)
    n = np.zeros((len(e), 0))
    return Estimates(
        n, n, e, np.full(e.shape, 4.0), e**2 / 4.0, np.array(verdict, np.uint32), np.array(status, np.uint32), np.zeros((2, 4))
    )


def test_consistency_of_a_few_innovations() -> None:
    """By hand: variance 4; the third sample of the first sensor is refused, the last is one in which the filter held."""
    given = penode_gen.load(HERE.parents[1] / "sil" / "filter" / "quarter.toml").filter  # gates of 5
    found = innovations([[2, 0], [2, 0], [40, 2], [-2, 9]], [[1, 0], [1, 2], [3, 1], [1, 1]], [0, FLAGS["missing"], 0, FLAGS["nonfinite"]])
    value, count = log_likelihood(given, [found])
    assert count == 4
    assert value == pytest.approx(-0.5 * (4 * np.log(8 * np.pi) + 1 + 1 + 25 + 1))
    known = consistency(given, [found, found])
    body = known.sensors["a_body"]
    assert (body.used, body.refused, body.mean_ratio, body.lag_1) == (4, 2, 1.0, pytest.approx(1.0))
    assert body.band[0] == pytest.approx(0.1211, abs=1e-4) and body.band[1] == pytest.approx(2.7858, abs=1e-4)
    assert known.sensors["a_wheel"].used == 2 and known.sensors["a_wheel"].lag_1 is None
    none = consistency(given, [innovations([[0, 0]], [[0, 0]], [0])])
    assert none.all.mean_ratio is None and none.measurements == 0


def test_what_is_wrong_is_one_line(guessed: tuple[Path, penode_gen.Model], tmp_path: Path) -> None:
    folder, _ = guessed
    model, record = folder / "guessed.toml", folder / "rec.csv"
    said = penode("tune-filter", model, "--data", record, "-o", model, fails=True)
    assert said == f"penode: --output: {model} is the model file itself; name another, which will extend it\n"
    said = penode("tune-filter", model, "--data", record, "--set", "x", "-o", tmp_path / "o.toml", fails=True)
    assert said.startswith('penode: --set: the model has no set "x"; ')
    nothing = "\n".join(line for line in model.read_text().splitlines() if "z_road" not in line and "[filter.inputs]" not in line)
    (tmp_path / "still.toml").write_text(nothing.replace(", noise = 1e-2", ""))
    rows = np.loadtxt(record, delimiter=",", skiprows=1)
    head = "time [s],a_body [m/s^2],a_wheel [m/s^2],z_road [m]"
    np.savetxt(tmp_path / "rec.csv", np.column_stack([rows, np.zeros(len(rows))]), "%.9g", ",", header=head, comments="")
    said = penode("tune-filter", tmp_path / "still.toml", "--data", tmp_path / "rec.csv", "-o", tmp_path / "o.toml", fails=True)
    assert said == (
        f"penode: {tmp_path / 'still.toml'}: no state, input or parameter of [filter] has a noise above zero; give one to start from, "
        "or --sensors\n"
    )
    said = penode("tune-filter", NQVM, "--data", record, "-o", tmp_path / "o.toml", fails=True)
    assert "has no [filter]; add one" in said
    for name, base in (("one", model.as_posix()), ("two", "one.toml")):
        (tmp_path / f"{name}.toml").write_text(f'[model]\nextends = "{base}"\n')
    said = penode("tune-filter", tmp_path / "two.toml", "--data", record, "-o", tmp_path / "o.toml", fails=True)
    assert "this would be the fourth file that extends another" in said and len(said.splitlines()) == 1
    assert not (tmp_path / "o.toml").exists()


@pytest.mark.skipif(not MEASURED.exists(), reason="the measured data are not beside the checkout")
def test_measured_joint_held_out(tmp_path: Path, show: Callable[[str], None]) -> None:
    """Noises from the first 6 s of a measured joint fit the 4 s after them."""
    words = [
        "tune-filter",
        HERE / "models" / "joint.toml",
        "--sensors",
        "--data",
        MEASURED / "train.csv",
        "--holdout",
        MEASURED / "test.csv",
    ]
    found = json.loads(penode(*words, "-o", tmp_path / "tuned.toml", "--json"))
    before, after = (found["held_out"][part] for part in ("before", "after"))
    q = after["sensors"]["q"]
    low, high = q["band"]
    show(
        f"mean NIS {q['mean_ratio']:.3f} of {low:.3f} to {high:.3f}, lag-1 correlation {q['lag_1']:.3f}, {q['refused']} refused, "
        f"log-likelihood {before['log_likelihood']:.0f} -> {after['log_likelihood']:.0f}"
    )
    assert low <= q["mean_ratio"] <= high and abs(q["lag_1"]) < 0.2
    assert after["log_likelihood"] > before["log_likelihood"]
