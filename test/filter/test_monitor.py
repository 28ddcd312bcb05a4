# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The fault monitor: against its twin in float64, what it finds and how soon, [monitor] of a model file, and who writes it."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import monitor_campaign
import numpy as np
import plant
import pytest

import penode_gen
from penode_gen.emission.c_text import real
from penode_gen.emission.model_c import render
from penode_gen.errors import ModelError
from penode_gen.laws import LAWS
from penode_gen.model import Element
from penode_sil.diagnosis.extend import monitored
from penode_sil.filtering import exact_monitor
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.watched import FLAGS, CompiledMonitor, names

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
TEXT = (HERE / "models" / "monitored.toml").read_text().replace("../../../gen", str(ROOT / "gen"))
MODEL = HERE / "models" / "monitored.toml"


class Rubbing(plant.Plant):
    """The plant with a friction of 30 N between body and wheel."""

    def rates(self, x, u):
        dx, fx, fu = super().rates(x, u)
        force = 30.0 * np.tanh((x[..., 2] - x[..., 3]) / 0.02)
        dx[..., 2] -= force / plant.M_B
        dx[..., 3] += force / plant.M_W
        return dx, fx, fu


@pytest.fixture(scope="module")
def rubbed():
    """The model, and measurements of 1 s: without friction, with it, without it."""
    model = penode_gen.load(MODEL)
    parts = [plant.drive(kind(model), model, 400, 1, 3).z[:, 0] for kind in (plant.Plant, Rubbing, plant.Plant)]
    return model, np.concatenate(parts)


def test_monitor_is_that_of_the_independent_one(rubbed) -> None:
    model, z = rubbed
    u = np.zeros((len(z), 1))
    own, wanted = exact_monitor.run(model, "default", u, z, None, {}, lambda n: None)
    double, float_ = (CompiledMonitor(Compiled(model, real), "default") for real in (np.float64, np.float32))
    status, plain = double.run(u, z)[0].status, Compiled(model).filter().run(u, z)[0]
    beside, found, single = float_.run(u, z)[0], double.watched(), float_.watched()
    assert wanted.raised[:400].sum() == 0 and wanted.raised[400:800].any(axis=0).all()
    np.testing.assert_allclose(found.sums, wanted.sums, atol=1e-4)  # differences against exact derivatives
    np.testing.assert_allclose(single.sums, found.sums, atol=1e-3)
    np.testing.assert_array_equal(status & FLAGS["cause"] > 0, found.raised[:, 0])
    np.testing.assert_array_equal(status & FLAGS["other"] > 0, found.raised[:, 1])
    np.testing.assert_array_equal(own.status, status)
    for part in ("values", "deviations", "ratio", "counts"):  # a monitor changes nothing of its filter
        np.testing.assert_array_equal(getattr(beside, part), getattr(plain, part))


def test_missing_measurements_change_nothing(rubbed) -> None:
    model, z = rubbed
    own = CompiledMonitor(Compiled(model), "default")
    own.run(np.zeros((len(z), 1)), z, np.zeros(len(z)))
    found = own.watched()
    assert not found.sums.any() and not found.raised.any()


def test_friction_is_found_and_nothing_else_is(tmp_path: Path) -> None:
    program = monitor_campaign.build(tmp_path)
    delays, alarms = monitor_campaign.with_friction(program, 20), monitor_campaign.without(program, 0.1)
    assert np.isfinite(delays[:, 0]).mean() >= 0.95
    assert alarms[:2].sum() == 0
    assert np.median(delays[:, 0]) < np.nanmedian(delays[:, 2])  # sooner than a chi-square test


def test_threshold_is_that_of_the_mean_time(rubbed) -> None:
    model, _ = rubbed
    wanted = math.log(2 * 72000 / 1e-3)  # two tests, samples of 1 ms
    assert real(wanted) in render(model)["monitored_monitor.c"]
    assert model.monitor.causes[0].changes == {"friction": 30.0} and names(model) == ["rubbing", "other"]


WRONG = [
    ('mean_time = "20 h"', "", "monitor: 'mean_time' is missing; add mean_time = ..."),
    ('"20 h"', '"1 ms"', "monitor.mean_time: is no more than a sample; give the mean time between false alarms, such as '20 h'"),
    ('"20 h"', '"20 m"', "monitor.mean_time: '20 m' is not measured in s; give a quantity in s"),
    ('"20 h"', '"20 h"\nspread = 1', "monitor.spread: 1 is not above 1; give a multiple of the innovations' own spread"),
    ("{ friction = 30 }", "{ frction = 30 }", "monitor.causes.rubbing.frction: unknown key; did you mean 'friction'?"),
    (
        "{ friction = 30 }",
        "{ friction = 0 }",
        "monitor.causes.rubbing: changes nothing; name parameters, each with the change that has to be found, signs included",
    ),
    ("{ friction = 30 }", "{ transition = 1 }", "monitor.causes.rubbing: changes neither a rate nor a sensor of the filter; remove it"),
    ("rubbing = { friction", "other = { friction", "monitor.causes.other: is the name of the test for anything else; rename it"),
    (
        "[monitor.causes]",
        "[monitor.causes]\nRubbing = { friction = 3 }",
        "monitor.causes.rubbing: has the C constant of another one; rename it",
    ),
]


@pytest.mark.parametrize(("old", "new", "line"), WRONG, ids=[str(n) for n in range(len(WRONG))])
def test_each_thing_that_is_wrong_has_its_line(old: str, new: str, line: str, tmp_path: Path) -> None:
    assert old in TEXT
    (tmp_path / "model.toml").write_text(TEXT.replace(old, new))
    with pytest.raises(ModelError) as caught:
        penode_gen.load(tmp_path / "model.toml")
    assert any(str(problem).endswith(line) for problem in caught.value.problems), caught.value


def test_monitor_needs_a_filter(tmp_path: Path) -> None:
    head, _, rest = TEXT.partition("[filter.sensors]")
    (tmp_path / "model.toml").write_text(head + rest[rest.index("[monitor]") :])
    with pytest.raises(ModelError, match=r"monitor: the model has no filter whose innovations it could watch; add \[filter\]"):
        penode_gen.load(tmp_path / "model.toml")


def test_command_shows_sums_and_flags(tmp_path: Path) -> None:
    (tmp_path / "road.toml").write_text('title = "rest"\nduration = "0.2 s"\n[input.z_road]\nkind = "constant"\nvalue = "0 m"\n')
    words = ["simulate", MODEL, "--scenario", tmp_path / "road.toml", "--filter", "-o", tmp_path / "out.csv", "--json"]
    done = subprocess.run([sys.executable, "-m", "penode_sil", *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    entry = json.loads(done.stdout)["instances"][0]["filter"]["monitor"]
    assert set(entry) == {"rubbing", "other"} and entry["rubbing"]["raised"] == 0 and entry["other"]["first"] is None
    assert "monitor.rubbing [1],monitor.rubbing.raised [1],monitor.other [1]" in (tmp_path / "out.csv").read_text().splitlines()[0]
    words = ["filter", MODEL, "--data", tmp_path / "out.csv", "-o", tmp_path / "again.csv"]
    done = subprocess.run([sys.executable, "-m", "penode_sil", *map(str, words)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "monitor rubbing: not raised; highest" in done.stdout


EXTENDED = """# Extension of model.toml from recordings: coulomb_friction at body-wheel.

[model]
extends = "model.toml"
name = "layered_extended"

[parameters]
coulomb_friction_force = { value = 28.5, unit = "N" }
coulomb_width = { value = 0.02, unit = "m/s" }
gain_a_body = { value = 1.1, unit = "1" }
bias_a_wheel = { value = 0.4, unit = "m/s^2" }

[elements]
coulomb_friction = { between = ["body", "wheel"], law = "coulomb_friction", force = "coulomb_friction_force", transition = "coulomb_width" }

[sensors]
a_body = { value = "gain_a_body*der(v_b)", unit = "m/s^2", noise = 0.02 }
a_wheel = { value = "der(v_w) + bias_a_wheel", unit = "m/s^2", noise = 0.1 }
"""


def nominal(folder: Path, filtered: bool = True) -> penode_gen.Model:
    text = (HERE / "models" / "layered.toml").read_text().replace("../../../gen", str(ROOT / "gen"))
    (folder / "model.toml").write_text(text if filtered else text[: text.index("[filter")])
    return penode_gen.load(folder / "model.toml")


def test_diagnosis_writes_the_monitor_of_what_it_named(tmp_path: Path) -> None:
    (tmp_path / "model_extended.toml").write_text(EXTENDED)
    note = monitored.write(tmp_path, nominal(tmp_path), "model_extended.toml")
    assert note.startswith("model_monitored.toml watches for coulomb_friction, bias_a_wheel;")
    found = penode_gen.load(tmp_path / "model_monitored.toml")
    causes = {c.name: c.changes for c in found.monitor.causes}
    assert causes == {"coulomb_friction": {"coulomb_friction_force": 28.5}, "bias_a_wheel": {"bias_a_wheel": 0.4}}
    assert found.parameters["coulomb_friction_force"].value == 0.0 and found.parameters["bias_a_wheel"].value == 0.0
    assert found.parameters["gain_a_body"].value == 1.1  # what it does depends on the networks: it cannot be watched for
    assert found.name == "layered_monitored" and found.monitor.mean_time == 72000.0


def test_diagnosis_writes_no_monitor_without_a_filter_or_a_cause(tmp_path: Path) -> None:
    (tmp_path / "model_extended.toml").write_text(EXTENDED)
    assert monitored.write(tmp_path, nominal(tmp_path, filtered=False), "model_extended.toml") == ""
    (tmp_path / "model_extended.toml").write_text('[model]\nextends = "model.toml"\nname = "layered_extended"\n')
    note = monitored.write(tmp_path, nominal(tmp_path), "model_extended.toml")
    assert note == "no model_monitored.toml: no cause was named that a monitor can watch for"
    assert not (tmp_path / "model_monitored.toml").exists()


def test_sizes_of_laws() -> None:
    found = {name: monitored.sizes(Element("e", ("a", "b"), name, {k: k for k in law.arguments})) for name, law in LAWS.items()}
    assert found["coulomb_friction"] == ["force"] and found["stribeck_friction"] == ["breakaway", "coulomb"]
    assert found["aerated_damper"] == ["damping"] and found["bump_stop"] == ["stiffness"] and found["maxwell_bushing"] == []
