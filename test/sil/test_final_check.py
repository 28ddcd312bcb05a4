# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The check of every answer: figures are those of `penode simulate`, and what rules do not allow is not said."""

from __future__ import annotations

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from curves import curve, integrate
from one_mass import STEP, model
from scipy.signal import butter, lfilter

import penode_gen
from penode_sil.cli import cli
from penode_sil.diagnosis import diagnose
from penode_sil.diagnosis.checks import final, rules
from penode_sil.diagnosis.checks.case import Case, End
from penode_sil.diagnosis.checks.differing import common
from penode_sil.diagnosis.checks.written import write_extended
from penode_sil.diagnosis.extend.entries import extends
from penode_sil.diagnosis.plant.plant import Linear
from penode_sil.diagnosis.result import UNKNOWN, Cause, Diagnosis, Gain, Value
from penode_sil.diagnosis.study import restoring, study
from penode_sil.diagnosis.study.driven import experiment
from penode_sil.recordings.measured import load

MASS, STIFFNESS, DAMPING, NOISE = 2.0, 800.0, 12.0, 2e-5
SENSORS = f'way = {{ value = "x", unit = "mm", noise = {1e3 * NOISE} }}\nspeed = {{ value = "v", unit = "m/s", noise = 1e-3 }}'
SAMPLES = 2000
FRICTION = 4.0  # N


def record(path, seed, moving=False, friction=FRICTION, mass=MASS, corner=0.0, level=30.0):
    """A CSV of the rig with friction, at rest at first, or `moving`, under a push of this `level` [N]; of a speed sensor behind a
    high-pass [Hz]."""
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(SAMPLES, STEP)
    push = np.fft.irfft(np.where((f > 0.3) & (f < 12.0), np.exp(2j * np.pi * rng.random(f.size)), 0.0), SAMPLES)
    push = level * push / np.std(push) * np.minimum(np.arange(SAMPLES) * STEP, 1.0)
    force = curve(push, STEP)

    def rates(time, x):
        return [x[1], (force(time) - STIFFNESS * x[0] - DAMPING * x[1] - friction * np.tanh(x[1] / 0.01)) / mass]

    x, _ = integrate(rates, [0.02, -0.3] if moving else [0.0, 0.0], STEP, SAMPLES)
    columns = [np.arange(SAMPLES) * STEP, push, 1e3 * (x[0] + NOISE * rng.standard_normal(SAMPLES))]
    speed = lfilter(*butter(1, 2.0 * corner * STEP, "high"), x[1]) if corner else x[1]
    columns.append(speed + 1e-3 * rng.standard_normal(SAMPLES))
    head = "time [s],push [N],way [mm],speed [m/s]"
    np.savetxt(path, np.stack(columns, axis=1), delimiter=",", header=head, comments="", fmt="%.9g")
    return path


LEARNT = """# Extension of rig.toml from recordings: coulomb_friction at damper.

[model]
{extends}
name = "rig_extended"

[parameters]
coulomb_friction_force = {{ value = {force}, unit = "N" }}
coulomb_friction_transition = {{ value = 0.01, unit = "m/s" }}

[elements.coulomb_friction]
between = ["mass", "ground"]
law = "coulomb_friction"
force = "coulomb_friction_force"
transition = "coulomb_friction_transition"
"""


def ended(folder, force, moving=False):
    """A search that has ended with a friction of this force, beside recordings with one of FRICTION; and what it was about."""
    (folder / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.02, SENSORS))
    nominal = penode_gen.load(folder / "rig.toml")
    train, held = (load([record(folder / f"{name}.csv", seed, moving)], nominal) for name, seed in (("train", 1), ("later", 2)))
    one = study.null_study(nominal, [experiment(m, nominal) for m in train])
    one = one if moving else replace(one, null=study.refit(one, [f for f in one.null.free if f.target[0] != "start"]), moving=False)
    one = study.replace(one, seen=study.look(one, one.null))
    (folder / "out").mkdir()
    text = LEARNT.format(extends=extends(nominal.path.resolve()), force=force)
    unused = [experiment(m, nominal) for m in held]
    case = Case(nominal, nominal, train, held, unused, (), folder / "out", lambda text: None, lambda share, doing: None)
    extended = write_extended(text, case)
    cause = Cause("coulomb_friction", "damper", {"force": Value(force, "N", (0.9 * force, 1.1 * force))}, 0.9)
    gain = {s.name: Gain(1.0, 0.1, 0.1, 1.0, "m", 0.0) for s in nominal.sensors}
    answer = Diagnosis("explained", (cause,), gain, {}, 0.99, 100.0, 0.0)
    return case, End(answer, one, extended, one.null, [])


def said(end, cause=None, **changes):
    """The end with another cause, or with another answer."""
    causes = (cause,) if cause else end.answer.causes
    return replace(end, answer=replace(end.answer, causes=causes, **changes))


def simulated(file, recording, options):
    """Errors by `penode simulate`."""
    call = ["simulate", str(file), "--input", str(recording), "-o", str(file.with_name("prediction.csv")), "--json", *options.split()]
    run = CliRunner().invoke(cli, call, catch_exceptions=False)
    return json.loads(run.stdout)["instances"][0]["rmse"]


@pytest.mark.parametrize("moving", [False, True])
def test_figures_are_those_of_penode_simulate(tmp_path, moving):
    """To the last digit, in training and hold-out, at rest and from a start in motion."""
    case, end = ended(tmp_path, FRICTION, moving)
    found = final.checked(case, end)
    assert found.simulated == "--start measured" * moving and found.verdict == "explained"
    assert [(f.recording, f.role, f.signal) for f in found.figures] == [
        ("train.csv", "training", "way"),
        ("train.csv", "training", "speed"),
        ("later.csv", "hold-out", "way"),
        ("later.csv", "hold-out", "speed"),
    ]
    for name in ("train.csv", "later.csv"):
        for column, file in (("nominal", case.model.path), ("extended", tmp_path / "out" / found.model_file)):
            errors = simulated(file, tmp_path / name, found.simulated)
            own = {f.signal: f for f in found.figures if f.recording == name}
            assert {k: getattr(f, column) for k, f in own.items()} == {k: e["value"] for k, e in errors.items()}
            assert all(own[k].samples == e["samples"] and own[k].unit == e["unit"] for k, e in errors.items())
    held = found.figures[2]
    assert found.gain["way"].after_rmse == pytest.approx(1e-3 * held.extended, rel=1e-12)
    assert found.gain["way"].before_rmse == pytest.approx(1e-3 * held.nominal, rel=1e-12)
    assert 0.5 * held.nominal < held.refitted < held.nominal and held.noise < held.extended < 2.0 * held.noise
    (shown,) = [c for c in found.residual["holdout"] if c["signal"] == "way"]
    assert shown["after_rms"] == pytest.approx(1e-3 * held.extended, rel=1e-3)


def test_a_model_that_predicts_worse_is_rejected(tmp_path):
    """A friction ten times too large: the file has another name, and no more than a part is explained."""
    case, end = ended(tmp_path, 10.0 * FRICTION)
    found = final.checked(case, end)
    assert found.rejected and found.verdict == "partly_explained"
    assert not (tmp_path / "out" / "model_extended.toml").exists()
    rejected = tmp_path / "out" / "model_rejected.toml"
    assert rejected.read_text().startswith("# Keep the nominal model")
    errors = simulated(rejected, tmp_path / "later.csv", found.simulated)
    assert {f.signal: f.extended for f in found.figures[2:]} == {k: e["value"] for k, e in errors.items()}
    assert all(f.extended > f.nominal for f in found.figures[2:])


@pytest.mark.parametrize(
    "cause, note",
    [
        (Cause("coulomb_friction", "damper", {"force": Value(4.0, "N", (-0.1, 8.1))}, 0.9), "may be nothing"),
        (Cause("sensor_scale", "speed", {"scale": Value(1.1, "1", (0.99, 1.21))}, 0.9), "may be nothing"),
        (Cause("wrong_parameter", "k", {"k": Value(790.0, "N/m", (770.0, 810.0))}, 0.9), "may be nothing"),
        (Cause("constant_force", "spring", {"force": Value(4e9, "N", (3e9, 5e9))}, 0.9), "would have 4e+09 N, but no more than"),
    ],
)
def test_names_without_evidence_are_dropped(tmp_path, cause, note):
    """What may be nothing, and what is larger than all that acts, is a note; without a name something is still unexplained."""
    case, end = ended(tmp_path, FRICTION)
    found = final.checked(
        case, said(end, cause, explanations=({"causes": [{"kind": cause.kind, "where": cause.where}], "posterior": 0.9},))
    )
    assert found.verdict == "unexplained" and [c.kind for c in found.causes] == ["outside_taxonomy"] and not found.explanations
    assert note in found.notes[-1]


def test_a_force_at_the_beginning_is_measured_there(tmp_path):
    """A rig that is released: the smoother fades over the first twentieth of a recording, but the largest force there counts. Noise of
    the speed sensor is 1e-3 of 0.3 m/s, its force below 0.1 %; the smoother takes half of that away."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.02, SENSORS))
    nominal = penode_gen.load(tmp_path / "rig.toml")
    measured = load([record(tmp_path / "free.csv", 1, moving=True, friction=0.0, level=1e-6)], nominal)
    one = study.null_study(nominal, [experiment(m, nominal) for m in measured])
    (surface,) = restoring.surfaces(one, None, None)
    way, speed = np.loadtxt(tmp_path / "free.csv", delimiter=",", skiprows=1, usecols=(2, 3)).T
    force = np.abs(1e-3 * STIFFNESS * way + DAMPING * speed)
    late = force[len(force) // 20 :]
    assert surface.largest == pytest.approx(np.max(force), rel=0.02)
    assert np.max(np.abs(surface.measured)) == pytest.approx(np.max(late), rel=0.05) and np.max(late) < 0.8 * np.max(force)


def test_a_name_about_reversals_needs_reversals(tmp_path):
    case, end = ended(tmp_path, FRICTION)
    play = Cause("backlash", "spring", {"gap": Value(1e-3, "m", (9e-4, 1.1e-3))}, 0.9)
    turning = replace(play, where="damper")
    one = end.study.seen[0]
    ahead = replace(one, motions=tuple(replace(m, v=np.abs(m.v) + 1.0) for m in one.motions))
    assert [c.kind for c in final.checked(case, said(end, turning)).causes] == ["backlash"]
    found = final.checked(case, said(replace(end, study=replace(end.study, seen=(ahead,))), play))
    assert "backlash" not in {c.kind for c in found.causes} and "the rate there does not change its sign" in found.notes[-1]


def test_a_model_does_not_agree_where_the_written_one_mends_it(tmp_path):
    """A small friction, found and withheld, without which the nominal model is off by ten times the noise: it is named."""
    case, end = ended(tmp_path, FRICTION)
    note = "Coulomb friction at damper is real but small: 3% of the force there; not named, but in model_extended.toml"
    found = final.checked(case, replace(said(end, verdict="no_discrepancy", notes=(note,)), withheld=end.answer.causes))
    assert found.verdict == "explained" and [c.kind for c in found.causes] == ["coulomb_friction"] and found.explained > 0.9
    assert note not in found.notes and found.explanations[0]["causes"] == [{"kind": "coulomb_friction", "where": "damper"}]


def test_what_makes_a_sensor_worse_than_without_it_goes(tmp_path):
    """An offset and a delay of a sensor that has neither, beside a law that is right: both go, and what is left is written."""
    case, end = ended(tmp_path, FRICTION)
    plain = (tmp_path / "out" / "model_extended.toml").read_text()
    more = LEARNT.format(extends=extends(case.model.path.resolve()), force=FRICTION).replace(
        "[elements", 'bias_speed = { value = 0.05, unit = "m/s" }\n\n[elements'
    )
    burdened = write_extended(more + '\n[sensors]\nspeed = { value = "v + bias_speed", unit = "m/s", noise = 0.001 }\n', case)
    asked = []

    def without(gone):
        asked.append(gone)
        return replace(end, extended=write_extended(plain, case))

    found = final.checked(case, replace(end, extended=burdened, without=without))
    assert asked == [[("sensor_bias", "speed")]] and found.verdict == "explained"
    assert "bias_speed" not in (tmp_path / "out" / "model_extended.toml").read_text()
    assert all(f.extended < 2.0 * f.noise for f in found.figures)


def test_a_recording_that_penode_simulate_does_not_read_has_figures_too(tmp_path):
    """And a note on why."""
    case, end = ended(tmp_path, FRICTION)
    lines = (tmp_path / "later.csv").read_text().splitlines()
    (tmp_path / "later.csv").write_text("\n".join([*lines[:500], lines[499], *lines[500:]]) + "\n")
    found = final.checked(case, end)
    assert len(found.figures) == 4 and "penode simulate does not take later.csv" in found.notes[-1]


def test_recordings_that_differ_by_a_parameter_have_a_set_each(tmp_path):
    """A mass of 2 kg in one recording and 2.6 kg in the other, which no common value explains; each figure is that of its own set. With a
    friction beside it the parameter is not named: the model then follows neither recording, and one friction does better than values of
    their own would, if they left as much as the model does."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.02, SENSORS))
    nominal = penode_gen.load(tmp_path / "rig.toml")
    paths = [
        record(tmp_path / f"{name}.csv", seed, False, 0.0, mass) for name, seed, mass in (("empty", 1, MASS), ("input", 2, 1.3 * MASS))
    ]
    found = diagnose(nominal, load(paths, nominal), (), tmp_path / "out")
    (cause,) = found.causes
    assert (cause.kind, cause.where, found.verdict) == ("differs_between_recordings", "m", "explained")
    assert {k: v.value for k, v in cause.parameters.items()} == pytest.approx({"of_empty": MASS, "of_input": 1.3 * MASS}, rel=0.01)
    for f in found.figures:
        errors = simulated(tmp_path / "out" / "model_extended.toml", tmp_path / f.recording, f"{found.simulated} --set {f.set}")
        assert f.extended == errors[f.signal]["value"] and f.extended < 1.2 * f.noise
    train = load([record(path, seed, False, FRICTION, MASS) for seed, path in enumerate(paths)], nominal)
    found = diagnose(nominal, train, (), tmp_path / "out")
    assert [c.kind for c in found.causes] == ["coulomb_friction"]
    one = study.begin(nominal, [experiment(m, nominal) for m in train])
    right = replace(one.null, simulated=tuple(e.y for e in one.experiments))
    assert common(one, End(found, one, nominal, right, []), one.null)
    assert not common(one, End(replace(found, causes=2 * found.causes), one, nominal, right, []), one.null)


def test_a_high_pass_of_a_sensor_is_no_agreement(tmp_path):
    """Nothing else is wrong, and the written model is as far off."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.02, SENSORS))
    nominal = penode_gen.load(tmp_path / "rig.toml")
    train = load([record(tmp_path / "train.csv", 1, False, 0.0, MASS, 0.3)], nominal)
    one = study.begin(nominal, [experiment(m, nominal) for m in train])
    one = study.replace(one, seen=study.look(one, one.null))
    case = Case(nominal, nominal, train, (), (), (), tmp_path / "out", lambda text: None, lambda share, doing: None)
    same = f'[model]\n{extends(nominal.path.resolve())}\nname = "rig_extended"\n'
    end = End(Diagnosis("no_discrepancy", (), {}, {}, 1.0, 0.0, 0.0), one, write_extended(same, case), None, [])
    found = final.checked(case, end)
    assert found.verdict == "not_identifiable" and found.notes[0].startswith("speed (0.")
    unknown = Diagnosis("unexplained", (UNKNOWN,), {}, {}, 0.0, 0.0, 0.0)  # nor is it an effect without a name
    found = final.checked(case, replace(end, answer=unknown))
    assert found.verdict == "not_identifiable" and found.causes == ()
    rubbing = load([record(tmp_path / "more.csv", 1, False, 1.0, MASS, 0.3)], nominal)  # of which a high-pass explains a part
    one = study.begin(nominal, [experiment(m, nominal) for m in rubbing])
    one = study.replace(one, seen=study.look(one, one.null))
    found = final.checked(replace(case, train=rubbing), replace(end, answer=unknown, study=one))
    assert found.verdict == "unexplained"


@pytest.mark.parametrize(
    "tolerance, stiffness, law, within",
    [(0.02, 1.019, "", True), (0.02, 1.021, "", False), (0.02, 1.019, "quadratic_damper", False), (0.0, 1.001, "", False)],
)
def test_values_within_tolerances_are_what_the_file_allows(tmp_path, tolerance, stiffness, law, within):
    """Of a stiffness known to 2 %; a law beside it is more than that. Without a stated tolerance no other value is."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, tolerance, SENSORS))
    nominal = penode_gen.load(tmp_path / "rig.toml")
    case = Case(nominal, nominal, (), (), (), (), tmp_path, lambda text: None, lambda share, doing: None)
    k = nominal.parameters["k"]
    written = replace(nominal, parameters={**nominal.parameters, "k": replace(k, value=stiffness * k.value)})
    if law:
        written = replace(written, elements=(*written.elements, replace(written.elements[0], name="more", law=law)))
    assert rules.allowed(case, End(None, None, written, None, [])) is within


@pytest.mark.parametrize(("second", "withdrawn"), [(0.3, False), (1.0, True), (0.03, False), (0.9, True)])
def test_names_are_withdrawn_where_the_hold_out_as_a_whole_is_predicted_worse(second, withdrawn):
    """One sensor is off 1.2 times as much with the cause as without it: what another one gains may outweigh that, 0.83 times its error or
    less; and what is gained below the noise counts for nothing."""
    errors = {"training": ((1.0, 0.1), (1.0, 0.1)), "hold-out": ((1.0, 1.2), (1.0, second))}
    noise = np.array([0.05, 0.05])
    rows = [row(role, j, *pair) for role, pairs in errors.items() for j, pair in enumerate(pairs)]
    table = SimpleNamespace(rows=rows, noise=noise, of=lambda role: [r for r in rows if r.figure.role == role])
    assert rules.misled(*ended_with_a_stop(0.0), table) == (["way"] if withdrawn else [])


@pytest.mark.parametrize(("corner", "withdrawn"), [(0.0, True), (5.0, False)])
def test_names_are_not_withdrawn_for_the_drift_of_a_hold_out(corner, withdrawn):
    """A swing of 20 Hz is a tenth of what it is without the cause, a drift twice that; the plant swings from 5 Hz on."""
    t = STEP * np.arange(1000)
    swing, drift = np.sin(2.0 * np.pi * 20.0 * t), t
    table_rows = [row(role, 0, *pair) for role, pair in (("training", (1.0, 0.1)), ("hold-out", (1.0, 1.5)))]
    table_rows[1].errors = {"nominal": 0.5 * swing + drift, "extended": 0.05 * swing + 2.0 * drift}
    table = SimpleNamespace(rows=table_rows, noise=np.array([0.01]), of=lambda role: [r for r in table_rows if r.figure.role == role])
    assert rules.misled(*ended_with_a_stop(corner), table) == (["way"] if withdrawn else [])


@pytest.mark.parametrize(
    ("stiffness", "to_ground", "swings"),
    [(400.0, 0.0, True), (400.0, 100.0, False), (0.0, 0.0, False)],  # a free shaft; one with a spring to ground; two that are apart
)
def test_a_plant_that_drifts_and_swings(stiffness, to_ground, swings):
    """Two inertias of 1 and 2 on a shaft: sqrt(k (1 + 1/2)) rad/s, beside an angle that nothing brings back."""
    a = np.zeros((4, 4))
    a[0, 1] = a[2, 3] = 1.0
    a[1, [0, 2]] = -stiffness - to_ground, stiffness
    a[3, [0, 2]] = 0.5 * stiffness, -0.5 * stiffness
    none = np.zeros((0, 0))
    found = Linear(a, none, none, none, none, none, 0, 0).beside_drift
    assert found == pytest.approx(np.sqrt(1.5 * stiffness) / (2.0 * np.pi) if swings else 0.0, rel=1e-6)


def ended_with_a_stop(corner):
    """What a rule asks of a case and of its end with a stop that is named, for a plant that swings from `corner` [Hz] on beside a drift."""
    study = SimpleNamespace(linear=SimpleNamespace(beside_drift=corner))
    end = SimpleNamespace(answer=SimpleNamespace(causes=(Cause("bump_stop", "spring", {}, 0.9),)), faults=(), study=study)
    return SimpleNamespace(holdout=("far.csv",), model=SimpleNamespace(sample_time=STEP)), end


def row(role, sensor, nominal, extended):
    """A row of the table with these errors of the two models."""
    figure = SimpleNamespace(role=role, signal=("way", "speed")[sensor])
    return SimpleNamespace(sensor=sensor, figure=figure, rms={"nominal": nominal, "extended": extended}.get)
