# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Channels of which the sign is the other one, or that are exchanged, in rigs in which something else is hidden as well."""

from __future__ import annotations

import json
from itertools import count

import numpy as np
import pytest
from click.testing import CliRunner
from curves import curve, integrate

import penode_gen
from penode_sil.cli import cli
from penode_sil.diagnosis.checks.channels import Mix, mending, mixed
from penode_sil.diagnosis.checks.written import joined
from penode_sil.diagnosis.study.driven import experiment
from penode_sil.errors import RecordingError
from penode_sil.recordings.measured import load

STEP, SAMPLES = 4e-3, 2000
CAR = """
[model]
name = "car"
sample_time = "4 ms"
[parameters]
m_b = { value = 400, unit = "kg", tolerance = 0.01 }
m_w = { value = 45, unit = "kg", tolerance = 0.01 }
c = { value = 22000, unit = "N/m", tolerance = 0.01 }
d = { value = 1500, unit = "N*s/m", tolerance = 0.01 }
c_t = { value = 210000, unit = "N/m", tolerance = 0.01 }
[inputs]
road = { unit = "m" }
[bodies]
body = { mass = "m_b", position = "z_b", velocity = "v_b" }
wheel = { mass = "m_w", position = "z_w", velocity = "v_w" }
[elements]
spring = { between = ["body", "wheel"], law = "linear_spring", stiffness = "c" }
damper = { between = ["body", "wheel"], law = "linear_damper", damping = "d" }
tyre = { between = ["wheel", "road"], law = "linear_spring", stiffness = "c_t" }
[outputs]
z_b = { value = "z_b", unit = "m" }
[sensors]
a_body = { value = "der(v_b)", unit = "m/s^2", noise = 0.02 }
a_wheel = { value = "der(v_w)", unit = "m/s^2", noise = 0.1 }
deflection = { value = "z_b - z_w", unit = "m", noise = 1e-4 }
"""
DRIVE = """
[model]
name = "drive"
sample_time = "4 ms"
[parameters]
J_m = { value = 0.02, unit = "kg*m^2" }
J_l = { value = 0.08, unit = "kg*m^2" }
k = { value = 30, unit = "N*m/rad" }
d = { value = 0.05, unit = "N*m*s/rad" }
b = { value = 0.1, unit = "N*m*s/rad", tolerance = "unknown" }
k_0 = { value = 8, unit = "N*m/rad" }
[inputs]
torque = { unit = "N*m" }
load = { unit = "N*m" }
[bodies]
motor = { inertia = "J_m", position = "q_m", velocity = "w_m" }
table = { inertia = "J_l", position = "q_l", velocity = "w_l" }
[elements]
shaft = { between = ["motor", "table"], law = "linear_spring", stiffness = "k" }
loss = { between = ["motor", "table"], law = "linear_damper", damping = "d" }
bearing = { between = ["table", "ground"], law = "linear_damper", damping = "b" }
holder = { between = ["table", "ground"], law = "linear_spring", stiffness = "k_0" }
push = { between = ["motor", "ground"], law = "expression", force = "-torque" }
pull = { between = ["table", "ground"], law = "expression", force = "-load" }
[outputs]
out = { value = "q_l", unit = "rad" }
[sensors]
motor_angle = { value = "q_m", unit = "rad", noise = 1e-4 }
table_angle = { value = "q_l", unit = "rad", noise = 1e-4 }
speed = { value = "w_m", unit = "rad/s", noise = 1e-2 }
"""
OVEN = """
[model]
name = "oven"
sample_time = "4 ms"
[parameters]
C = { value = 0.5, unit = "J/K", tolerance = 0.05 }
C_w = { value = 2, unit = "J/K", tolerance = 0.05 }
G = { value = 1.5, unit = "W/K", tolerance = 0.05 }
G_out = { value = 1, unit = "W/K", tolerance = 0.05 }
[inputs]
heat = { unit = "W" }
[states]
T = { unit = "K" }
W = { unit = "K" }
[equations]
air = "C*der(T) = heat - G*(T - W)"
wall = "C_w*der(W) = G*(T - W) - G_out*W"
[outputs]
out = { value = "T", unit = "K" }
[sensors]
inside = { value = "T", unit = "K", noise = 0.02 }
outside = { value = "W", unit = "K", noise = 0.02 }
"""


def car(u, more):
    def rates(x, u):
        pull = 22e3 * (x[0] - x[1]) + 1500.0 * (x[2] - x[3]) + 80.0 * more * np.tanh((x[2] - x[3]) / 0.01)
        return [x[2], x[3], -pull / 400.0, (pull - 210e3 * (x[1] - 0.006 * u[0])) / 45.0]

    x, dx = run(rates, u, 4)
    return [0.006 * u[0]], {"a_body": dx[2], "a_wheel": dx[3], "deflection": x[0] - x[1]}


def drive(u, more):
    def rates(x, u):
        twist = 30.0 * (x[0] - x[1]) + 0.05 * (x[2] - x[3])
        rub = 0.2 * x[3] + 0.4 * more * np.tanh(x[3] / 0.02)
        return [x[2], x[3], (2.0 * u[0] - twist) / 0.02, (twist + u[1] - rub - 8.0 * x[1]) / 0.08]

    x, _ = run(rates, u, 4)
    return [2.0 * u[0], u[1]], {"motor_angle": x[0], "table_angle": x[1], "speed": x[2]}


def oven(u, more):
    def rates(x, u):
        lost = 1.5 * (x[0] - x[1])
        return [(5.0 * u[0] - lost) / 0.5, (lost - x[1] - 0.2 * more * x[1] * abs(x[1])) / 2.0]

    x, _ = run(rates, u, 2)
    return [5.0 * u[0]], {"inside": x[0], "outside": x[1]}


def run(rates, u, states):
    """States and rates [states, SAMPLES] from rest, driven by signals [SAMPLES] each."""
    force = [curve(x, STEP) for x in u]
    return integrate(lambda time, x: rates(x, [f(time) for f in force]), [0.0] * states, STEP, SAMPLES)


RIGS = {"car": (CAR, car, ("road",), 12.0), "drive": (DRIVE, drive, ("torque", "load"), 8.0), "oven": (OVEN, oven, ("heat",), 1.0)}


def mixes(model):
    """All that may be wrong, one at a time, by kind and names."""
    inputs, sensors = ([s.name for s in some] for some in (model.inputs, model.sensors))
    found = [("input_sign", (i,)) for i in inputs] + [("sensor_sign", (s,)) for s in sensors]
    alike = {"car": [("a_body", "a_wheel")], "drive": [("torque", "load"), ("motor_angle", "table_angle")], "oven": [("inside", "outside")]}
    return found + [("swapped_channels", pair) for pair in alike[model.name]]


def drawn(folder, rig, seed, wrong=None):
    """A recording in which something is hidden, `wrong` channels and all; the model and the experiment."""
    text, plant, inputs, fastest = RIGS[rig]
    rng = np.random.default_rng(seed)
    f = np.fft.rfftfreq(SAMPLES, STEP)
    u = []
    for _ in inputs:
        x = np.fft.irfft(np.where((f > 0.1) & (f < fastest), np.exp(2j * np.pi * rng.random(f.size)) / np.maximum(f, 0.3), 0.0), SAMPLES)
        u.append(x / np.std(x) * np.minimum(np.arange(SAMPLES) * STEP, 1.0))
    driving, sensors = plant(u, rng.choice([0.0, 0.5, 1.0]))
    (folder / f"{rig}.toml").write_text(text)
    model = penode_gen.load(folder / f"{rig}.toml")
    noise = {s.name: s.noise for s in model.sensors}
    columns = dict(zip(inputs, driving, strict=True)) | {k: z + noise[k] * rng.standard_normal(SAMPLES) for k, z in sensors.items()}
    kind, names = wrong or ("", ())
    if kind == "swapped_channels":
        columns |= {names[0]: columns[names[1]], names[1]: columns[names[0]]}
    elif kind:
        columns[names[0]] = -columns[names[0]]
    units = {s.name: s.unit for s in (*model.inputs, *model.sensors)}
    head = ",".join(["time [s]", *(f"{k} [{units[k]}]" for k in columns)])
    table = np.stack([np.arange(SAMPLES) * STEP, *columns.values()], axis=1)
    np.savetxt(folder / "r.csv", table, delimiter=",", header=head, comments="", fmt="%.9g")
    return model, [experiment(m, model) for m in load([folder / "r.csv"], model)]


def named(model, found):
    return [(m.kind, tuple(m.names(model))) for m in found]


@pytest.mark.parametrize("rig", RIGS)
def test_what_is_mixed_up_is_found_and_nothing_else(tmp_path, rig):
    """All that may be wrong with channels of a rig, beside what is hidden there; and two rigs in which no channel is."""
    (tmp_path / f"{rig}.toml").write_text(RIGS[rig][0])
    seeds = count(100)
    for wrong in [*mixes(penode_gen.load(tmp_path / f"{rig}.toml")), None, None]:
        model, experiments = drawn(tmp_path, rig, next(seeds), wrong)
        found = named(model, mixed(model, experiments, "default"))
        assert found == ([wrong] if wrong else [])


def test_two_of_them_are_found_one_after_the_other(tmp_path):
    model, experiments = drawn(tmp_path, "car", 7, ("swapped_channels", ("a_body", "a_wheel")))
    both = [Mix(False, (2,)).mended(e) for e in experiments]
    found = sorted(named(model, mixed(model, both, "default")))
    assert found == [("sensor_sign", ("deflection",)), ("swapped_channels", ("a_body", "a_wheel"))]


@pytest.mark.parametrize("rig", RIGS)
def test_the_mended_model_follows_the_recording_as_it_is(tmp_path, rig):
    """Every mix, mended in the model file: what the mended model predicts is what the nominal one predicts for right channels."""
    (tmp_path / f"{rig}.toml").write_text(RIGS[rig][0])
    model = penode_gen.load(tmp_path / f"{rig}.toml")
    for kind, names in mixes(model):
        driving = names[0] in {i.name for i in model.inputs}
        numbers = tuple(k for k, s in enumerate(model.inputs if driving else model.sensors) if s.name in names)
        mended = mending(model, [Mix(driving, numbers)], tmp_path)
        one, experiments = drawn(tmp_path, rig, 3, (kind, names))
        assert not mixed(mended, experiments, "default") and mixed(one, experiments, "default")
        assert [s.noise for s in mended.sensors] == [model.sensors[k].noise for k in _order(model, kind, driving, numbers)]


def _order(model, kind, driving, numbers):
    order = list(range(len(model.sensors)))
    if kind == "swapped_channels" and not driving:
        a, b = numbers
        order[a], order[b] = b, a
    return order


def test_what_a_file_cannot_have_is_refused_with_the_remedy(tmp_path):
    text = DRIVE.replace("motor_angle =", "q_m =").replace("table_angle =", "q_l =")
    (tmp_path / "drive.toml").write_text(text)
    with pytest.raises(RecordingError, match="q_m and q_l are exchanged; say --channel q_m=q_l --channel q_l=q_m"):
        mending(penode_gen.load(tmp_path / "drive.toml"), [Mix(False, (0, 1))], tmp_path)


def test_entries_of_a_mended_file_stay_but_where_more_was_learnt():
    base = '[model]\nextends = "a.toml"\n\n[sensors]\na = { value = "-(x)" }\nb = { value = "-(y)" }\n'
    text = '# More.\n\n[model]\nextends = "a.toml"\nname = "n"\n\n[sensors]\nb = { value = "-(y) + 1" }\n'
    assert joined(base, text) == (
        '# More.\n\n[model]\nextends = "a.toml"\nname = "n"\n\n[sensors]\na = { value = "-(x)" }\nb = { value = "-(y) + 1" }\n'
    )


def test_the_command_names_exchanged_channels_first(tmp_path):
    """And its extended model has them put right."""
    drawn(tmp_path, "oven", 5, ("swapped_channels", ("inside", "outside")))
    call = ["diagnose", str(tmp_path / "oven.toml"), "--data", str(tmp_path / "r.csv"), "-o", str(tmp_path / "out"), "--json"]
    found = json.loads(CliRunner().invoke(cli, call, catch_exceptions=False).stdout)
    first = found["causes"][0]
    assert (first["kind"], first["where"]) == ("swapped_channels", "inside,outside") and found["verdict"] != "no_discrepancy"
    extended = penode_gen.load(tmp_path / "out" / "model_extended.toml")
    assert [s.expression[0] for s in extended.sensors] == ["W", "T"]
    assert all(f["extended"] < 0.5 * f["nominal"] for f in found["figures"])
