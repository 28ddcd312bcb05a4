# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Cases of MuJoCo: made again to the byte, of the physics of their model files, scored as they should be. Skipped without MuJoCo."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from campaign import simulated

from mujoco_cases import cases, effects, engine, excitation, mujoco_campaign
from mujoco_cases.effects import Effect
from mujoco_cases.engine import COARSE, SAMPLE, STEP, Job, passive, run
from mujoco_cases.fitting import simulate

there = pytest.mark.skipif(engine.installed() is None, reason=engine.REMEDY)
NULL = 5  # index of the first case in which nothing hides
FAKE = "import json, pathlib, sys; out = pathlib.Path(sys.argv[sys.argv.index('-o') + 1]); out.mkdir(); "


def files(case, folder):
    return {p.name: p.read_bytes() for p in [*case.write(folder), folder / "model.toml"]}


def drawn(name, seed=3):
    """A plant, its parameters by the file, and what drives it for 3 s."""
    rng = np.random.default_rng(seed)
    plant = cases.MAKERS[name](rng)
    return plant, {k: v for k, (v, _) in plant.values.items()}, excitation.start(rng, plant), excitation.command(rng, plant, 1500)


@there
def test_same_seed_same_bytes(tmp_path):
    """Files and truth follow from seed and index; another index makes others."""
    (first, a), (again, b), (other, _) = (cases.make(7, i) for i in (NULL, NULL, NULL + cases.NULL_EVERY))
    written = files(first, tmp_path / "a")
    assert written == files(again, tmp_path / "b")
    assert json.dumps(first.truth(a)) == json.dumps(again.truth(b))
    assert written["model.toml"] != files(other, tmp_path / "c")["model.toml"]
    for case in (first, other):
        told, held = (
            np.loadtxt(tmp_path / f"{'a' if case is first else 'c'}" / f, delimiter=",", skiprows=1)
            for f in ("train_1.csv", "holdout_1.csv")
        )
        assert np.all(np.abs(held).max(axis=0)[1:] < 1.3 * np.abs(told).max(axis=0)[1:])


@there
@pytest.mark.long
def test_a_hidden_effect_is_made_again_and_stated(tmp_path):
    """The same of a case with an effect: half a minute of fits. Its size is inside of what is kept, and its own law gave it back."""
    (first, a), (again, b) = (cases.make(7, 10) for _ in range(2))
    assert files(first, tmp_path / "a") == files(again, tmp_path / "b")
    truth = first.truth(a)
    assert json.dumps(truth) == json.dumps(again.truth(b))
    (effect,) = truth["effects"]
    assert cases.KEPT[0] < effect["ratio"] < cases.KEPT[1] and effect["recovered_within"] <= cases.SHARE and effect["where"]


@there
@pytest.mark.long
def test_a_wrong_parameter_is_off_by_three_tolerances(monkeypatch):
    """A deviation inside of a stated tolerance is no finding: a wrong parameter is far outside, even where less would be seen."""
    monkeypatch.setattr(cases, "MAKERS", {"pendulum": cases.MAKERS["pendulum"]})
    monkeypatch.setattr(effects, "KINDS", {"pendulum": ("wrong_parameter",)})
    case, _ = cases.make(13, 0, tolerances=True)
    ((name, value),) = effects.told(case.effect).items()
    assert case.tolerance and abs(value / case.plant.values[name][0] - 1) >= 0.999 * cases.BEYOND * case.tolerance


HALVED = [
    ("slider", "coulomb_friction", "rail", {"force": 1.0}),
    ("joint", "bump_stop", "pivot", {"gap": 0.05, "stiffness": 2.0}),
    ("joint", "input_delay", "input", {"delay": 0.006 - effects.EARLY}),
    ("joint", "position_dependent_friction", "pivot", {"force": 0.02, "variation": 0.8}),
    ("drive", "backlash", "shaft", {"gap": 0.02}),
    ("drive", "load_dependent_friction", "load", {"share": 0.1}),
    ("quarter", "coulomb_friction", "strut", {"force": 40.0}),
    ("pendulum", "quadratic_damper", "pivot", {"coefficient": 0.01}),
]


@there
@pytest.mark.parametrize(("name", "kind", "place", "numbers"), HALVED)
def test_half_the_step_changes_less_than_the_noise(name, kind, place, numbers):
    """Steps half as long change what is written by less than a tenth of the noise; MuJoCo's delay is the one of the fits."""
    plant, values, start, command = drawn(name)
    hidden = [Effect(kind, plant.input[0] if place == "input" else place, numbers, 1.0, {"wave": 8.0, "phase": 1.0})]
    job = plant.job(values, effects.in_plant(hidden, plant))
    job.start.update(start)
    r = run(job, 1500, STEP, command, effects.reach(hidden), plant.road)
    half = simulate(plant, values, hidden, r.u if plant.input[0] else None, start, 1500, STEP / 2)
    bare = simulate(plant, values, [], r.u if plant.input[0] else None, start, 1500, STEP)
    noise = [s.noise for s in plant.sensors]
    error, change = (np.sqrt(np.mean(((plant.columns(r.y) - x) / noise) ** 2)) for x in (half, bare))
    assert error < cases.STEP_ERROR < 0.3 < change


@there
@pytest.mark.parametrize("name", sorted(cases.MAKERS))
def test_every_kind_acts(name):
    """At its drawn size each kind changes the signals of each plant that may have it, by the feature that is named for it."""
    plant, values, start, command = drawn(name)
    job = plant.job(values, effects.in_plant([], plant))
    job.start.update(start)
    r = run(job, 1500, COARSE, command, line=plant.road)
    clean, given = plant.columns(r.y), r.u if plant.input[0] else None
    for kind in effects.KINDS[name]:
        place = effects.places(kind, plant)[0]
        site = plant.sites.get(place)
        at = effects.scale_of(kind, place, plant, r, clean, values[site.spring] if site and site.spring else 0.0)
        shape = {"z": 0.0, "wave": 2.5 / max(at.peak, 1e-9), "phase": 1.0}
        file = values.get(place, 0.0)
        changes = []
        for sign in (1.0, -1.0):  # a stop may be on the side that is hardly reached
            hidden = [Effect(kind, place, effects.numbers(kind, 1.0, sign, shape, at, file), sign, shape)]
            y = simulate(plant, values, hidden, given, start, 1500)
            changes.append(np.sqrt(np.mean(((y - clean) / [s.noise for s in plant.sensors]) ** 2)))
        assert max(changes) > 0.1, kind


def mass(attributes, start, rows, force=0.0, m=2.0, **drive):
    """Positions of a mass on a slide from `start`, pushed by a force."""
    world = f'<body><inertial pos="0 0 0" mass="{m}" diaginertia="1 1 1"/><joint name="q" type="slide" axis="1 0 0" {attributes}/></body>'
    act = f'<general name="drive" joint="q" {" ".join(f"{k}={chr(34)}{v}{chr(34)}" for k, v in drive.items())}/>'
    return run(Job(world, "", act, '<jointpos joint="q"/>', start={"q": start}), rows, STEP, np.full(rows, force)).y[:, 0]


@there
def test_free_decay_is_the_closed_form():
    """Mass, spring, damper from 0.1 m: order 4 at 0.2 ms errs by (w h)^4/120 a radian, 1e-12; 1e-9 is allowed."""
    x, t, a = mass(passive((200.0,), (0.8,), None, None, 2.0), 0.1, 1000), np.arange(1000) * SAMPLE, 0.2
    w = np.sqrt(100.0 - a * a)
    assert np.abs(x - 0.1 * np.exp(-a * t) * (np.cos(w * t) + a / w * np.sin(w * t))).max() < 1e-9


@there
def test_friction_takes_its_share_of_a_half_swing_and_stops():
    """
    Dry friction takes 2 F/k of the amplitude in a half swing, and holds within F/k. Below its level MuJoCo brakes over FRICTION_TIME / 2
    and creeps at 1e-4 of the load: 1 % of F/k is allowed for both.
    """
    k, f = 200.0, 1.5
    x = mass(passive((k,), (0.0,), f, None, 2.0), 0.1, 2500)
    turns = [0.1 - 2 * n * f / k for n in range(7)]
    half = round(np.pi / 10 / SAMPLE)
    assert np.allclose(np.abs(x[half * np.arange(1, 6)]), turns[1:6], atol=0.01 * f / k)
    assert abs(x[-1]) < f / k and np.ptp(x[-500:]) < 0.01 * f / k


@there
def test_a_stop_is_a_spring_behind_its_gap():
    """Pushed into its stop by F, the mass comes to rest where both springs hold F; a thousandth of other forces is the stop's impedance."""
    x = mass(passive((10.0,), (6.0,), None, (1.0, 0.1, 1000.0), 2.0), 0.0, 4000, 11.0)
    assert x[-1] == pytest.approx(0.1 + (11.0 - 10.0 * 0.1) / 1010.0, rel=1e-3)


@there
@pytest.mark.parametrize(
    ("drive", "reached"), [({"gear": "0.8"}, 0.8), ({"forcerange": "-0.6 0.6"}, 0.6), ({"dyntype": "filter", "dynprm": "0.05"}, None)]
)
def test_actuators_do_what_their_names_say(drive, reached):
    """Of a unit force on a free mass: x = F t^2/(2 m); behind a lag T, (t^2/2 - T t + T^2 (1 - exp(-t/T)))/m."""
    x, t = mass(passive((0.0,), (0.0,), None, None, 2.0), 0.0, 100, 1.0, **drive), np.arange(100) * SAMPLE
    lag = 0.05
    exact = t**2 / 4 * reached if reached else (t**2 / 2 - lag * t + lag**2 * (1 - np.exp(-t / lag))) / 2
    assert np.abs(x - exact).max() < 1e-6 * exact.max()


@there
def test_a_simulation_that_diverges_is_refused_quietly(tmp_path, monkeypatch, capfd):
    """No log file, no line: MuJoCo's warning is an exception."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(engine.Unstable):
        mass(passive((-1e9,), (0.0,), None, None, 2.0), 0.1, 100)
    assert not list(tmp_path.iterdir()) and capfd.readouterr() == ("", "")


@there
@pytest.mark.parametrize("name", sorted(cases.MAKERS))
def test_the_model_file_is_the_plant(name, tmp_path, monkeypatch):
    """`penode simulate` of the written file predicts a null case to its noise, 3 % for rounding; a swing gets its start there."""
    monkeypatch.setattr(cases, "MAKERS", {name: cases.MAKERS[name]})
    monkeypatch.setattr(effects, "KINDS", {name: effects.KINDS[name]})
    case, _ = cases.make(11, NULL, tolerances=False)
    *_, last = case.write(tmp_path)
    if name == "pendulum":
        text = (tmp_path / "model.toml").read_text()
        start = case.records["holdout_1"].start["q"]
        (tmp_path / "model.toml").write_text(text.replace(", velocity =", f', start_position = "{start} rad", velocity ='))
    error = simulated(f"{Path(sys.executable).with_name('penode')} simulate", tmp_path / "model.toml", last)
    for s in case.plant.sensors:
        assert error[s.name] == pytest.approx(s.noise, rel=0.03)


@there
def test_the_row_of_a_null_case(tmp_path):
    """The command sees files and no truth; what it says is scored: nothing named is right, a name is a false alarm."""
    quiet = f"{sys.executable} -c \"{FAKE}(out / 'diagnosis.json').write_text(json.dumps(dict(verdict='no_discrepancy', causes=[])))\""
    loud = quiet.replace("causes=[]", "causes=[dict(kind='cubic_spring', where='x')]")
    rows = [mujoco_campaign.one(7, NULL, None, c, 60.0, tmp_path / str(i), keep=True) for i, c in enumerate((quiet, loud))]
    assert [r["outcome"] for r in rows] == ["right", "false alarm"]
    truth = json.loads((tmp_path / "0" / "truth" / f"7-{NULL}.json").read_text())
    assert truth["group"] == "null" and truth["effects"] == [] and not list((tmp_path / "0" / "cases").rglob("*truth*"))
    assert "| null | 2 | 1 | 1 | 0 | 1 of 2 |" in mujoco_campaign.page(rows, "about")


def row(group, outcome, kind="", plant="joint"):
    return {
        "case": "1:2",
        "group": group,
        "plant": plant,
        "tolerance": None,
        "kinds": [kind] * bool(kind),
        "ratios": [3.0] * bool(kind),
        "answer": [],
        "verdict": "unexplained",
        "why": "",
        "outcome": outcome,
        "right": outcome == "right",
        "covered": [["x", True]],
        "seconds": 2.0,
        "refused": {"size": 1},
    }


def test_page_and_gate():
    """Right, false and missed add up by kind and plant; twelve wrong of twelve is no chance, two are."""
    kinds = ["input_dead_zone"] * 2 + ["input_lag"] * 10
    rows = [row("single", o, k) for k, o in zip(kinds, ["wrong name", "missed", *["right"] * 10], strict=True)]
    text = mujoco_campaign.page([*rows, row("null", "right", plant="drive")], "about")
    assert "| single | 12 | 10 | 1 | 1 |  | 83%" in text and "| dead zone and saturation | 2 | 0 | 1 | 1 |" in text
    assert "| plant drive | 1 | 1 | 0 | 0 | 0 of 1 | 100%" in text and "13 of 13 hold the truth" in text and "13 size" in text
    assert not mujoco_campaign.gate(rows)
    assert mujoco_campaign.gate([row("single", "missed", "input_lag")] * 12)[0].startswith("single: 12 of 12 wrong, at most")


def test_where_mujoco_is_not_installed(monkeypatch, capsys):
    """One line says how to get it."""
    monkeypatch.setattr(engine, "installed", lambda: None)
    monkeypatch.setattr(sys, "argv", ["mujoco_campaign.py"])
    assert mujoco_campaign.main() == 2
    assert capsys.readouterr().err == f"mujoco_campaign: {engine.REMEDY}\n"


def test_the_generator_knows_nothing_of_penode():
    """What makes the cases shares no code with what explains them."""
    for path in Path(cases.__file__).parent.glob("*.py"):
        lines = path.read_text().splitlines()
        assert not [x for x in lines if x.lstrip().startswith(("import ", "from ")) and "penode" in x]
