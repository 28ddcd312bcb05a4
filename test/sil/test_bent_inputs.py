# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Actuators that are not linear, and friction that changes along the travel or with the load: hidden in a slide with a return spring and in
a link with gravity, by forms that no law of the catalogue has, and named by the command's own search."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from click.testing import CliRunner
from samples import sample
from scipy.linalg import expm

from penode_sil.cli import cli

STEP, FINE = 0.002, 4
SLIDE = """
[model]
name = "slide"
sample_time = "2 ms"
[parameters]
m = { value = 2.0, unit = "kg", tolerance = 0.01 }
c = { value = 800.0, unit = "N/m", tolerance = 0.03 }
d = { value = 12.0, unit = "N*s/m", tolerance = 0.1 }
[inputs]
push = { unit = "N" }
[bodies]
slide = { mass = "m", position = "x", velocity = "v" }
[elements]
spring = { between = ["slide", "ground"], law = "linear_spring", stiffness = "c" }
guide = { between = ["slide", "ground"], law = "linear_damper", damping = "d" }
drive = { between = ["slide", "ground"], law = "expression", force = "-push" }
[outputs]
out = { value = "x", unit = "m" }
[sensors]
x = { value = "x", unit = "m", noise = 2e-5 }
a = { value = "der(v)", unit = "m/s^2", noise = 0.05 }
"""
LINK = """
[model]
name = "link"
sample_time = "2 ms"
[parameters]
J = { value = 0.2, unit = "kg*m^2", tolerance = 0.01 }
mgl = { value = 6.0, unit = "N*m", tolerance = 0.02 }
d = { value = 0.15, unit = "N*m*s/rad", tolerance = 0.1 }
[inputs]
push = { unit = "N*m" }
[bodies]
arm = { inertia = "J", position = "x", velocity = "v" }
[elements]
gravity = { between = ["arm", "ground"], law = "expression", force = "mgl*sin(s)" }
bearing = { between = ["arm", "ground"], law = "linear_damper", damping = "d" }
motor = { between = ["arm", "ground"], law = "expression", force = "-push" }
[outputs]
out = { value = "x", unit = "rad" }
[sensors]
x = { value = "x", unit = "rad", noise = 3e-4 }
w = { value = "v", unit = "rad/s", noise = 5e-3 }
"""


def tones(n, size, seed):
    """Tones of 0.3 to 5 Hz [n] of an rms, slowly louder and softer."""
    rng = np.random.default_rng(seed)
    t, f = np.arange(n) * STEP / FINE, np.linspace(0.3, 5.0, 23)
    u = np.sum(np.sin(2.0 * np.pi * f[:, None] * t + rng.uniform(0.0, 2.0 * np.pi, (len(f), 1))), axis=0)
    return size * u / np.std(u) * (1.0 + 0.5 * np.sin(2.0 * np.pi * 0.11 * t))


def run(path, acts, force, mass, size, columns, seed):
    """A recording of 6 s: mass x'' = acts(u) - force(x, x'), by the midpoint rule at 2 kHz; `acts` makes of the whole input what
    drives."""
    n, h = int(6.0 / STEP) * FINE, STEP / FINE
    knots = tones(n + 1, size, seed)
    t = np.arange(n + 1)
    u = np.interp(t, t[::FINE], knots[::FINE])
    driving = acts(u).tolist()
    x = v = 0.0
    rows = []
    for i in range(n):
        if i % FINE == 0:
            rows.append((i * h, u[i], x, v, (driving[i] - force(x, v)) / mass))
        mid = 0.5 * (driving[i] + driving[i + 1])
        xm, vm = x + 0.5 * h * v, v + 0.5 * h * (driving[i] - force(x, v)) / mass
        x, v = x + h * vm, v + h * (mid - force(xm, vm)) / mass
    rows = np.array(rows)
    rng = np.random.default_rng(seed + 100)
    noise = {"x": 2e-5, "a": 0.05} if "a" in columns else {"x": 3e-4, "w": 5e-3}
    seen = {"x": rows[:, 2], "w": rows[:, 3], "a": rows[:, 4]}
    table = [rows[:, 0], rows[:, 1], *(seen[k] + s * rng.standard_normal(len(rows)) for k, s in noise.items())]
    units = {"x": "m" if "a" in columns else "rad", "a": "m/s^2", "w": "rad/s"}
    head = ",".join(["time [s]", f"push [{'N' if 'a' in columns else 'N*m'}]", *(f"{k} [{units[k]}]" for k in noise)])
    np.savetxt(path, np.column_stack(table), "%.9g", ",", header=head, comments="")


def diagnosed(folder, text, acts, force, mass, size, columns):
    """What the command says of one recording, with another one to measure the gain on."""
    for seed, name in ((1, "train.csv"), (2, "hold.csv")):
        run(folder / name, acts, force, mass, size, columns, seed)
    return found(folder, text)


def found(folder, text):
    """What it says of the recordings in a folder."""
    (folder / "model.toml").write_text(text)
    call = ["diagnose", str(folder / "model.toml"), "--data", str(folder / "train.csv"), "--holdout", str(folder / "hold.csv")]
    done = CliRunner().invoke(cli, [*call, "-o", str(folder / "out")])
    assert done.exit_code == 0, done.output
    return json.loads((folder / "out" / "diagnosis.json").read_text())


def plain(x, v):
    return 800.0 * x + 12.0 * v


def dead(u, width=6.0, round_off=0.6):
    """A dead zone whose ends are round: a valve's overlap."""
    return round_off * (np.logaddexp(0.0, (u - width) / round_off) - np.logaddexp(0.0, -(u + width) / round_off))


def soft(u, most=24.0):
    """A saturation with a round shoulder: u over the eighth root of 1 + (u/most)^8."""
    return u / (1.0 + (u / most) ** 8) ** 0.125


def slow(u, rate=260.0):
    """A drive that follows within a rate, and slower as it comes near: by 2 ms behind."""
    found, now, h = [], float(u[0]), STEP / FINE
    for target in u.tolist():
        now += h * rate * math.tanh((target - now) / (0.002 * rate))
        found.append(now)
    return np.array(found)


ACTUATORS = [
    (dead, "input_dead_zone", "width", 6.0, 0.1),
    (soft, "input_saturation", "limit", 24.0, 0.1),
    (slow, "input_slew_limit", "rate", 260.0, 0.1),
]


@pytest.mark.parametrize("acts, kind, key, true, near", sample(ACTUATORS, ACTUATORS[0]))
def test_a_bent_actuator_is_named(tmp_path, acts, kind, key, true, near, show):
    """Its size to 10 %: rounded over a tenth of itself, the best sharp edge is within that of it."""
    d = diagnosed(tmp_path, SLIDE, acts, plain, 2.0, 15.0, "xa")
    show([(c["kind"], c["where"], c["parameters"]) for c in d["causes"]])
    assert [(c["kind"], c["where"]) for c in d["causes"]] == [(kind, "push")]
    assert abs(d["causes"][0]["parameters"][key]["value"] / true - 1.0) < near
    assert all(g["after_rmse"] < 0.5 * g["before_rmse"] for g in d["gain"].values())


def commanded(path, lag, delay, seed):
    """A recording of 6 s of the slide under a command that is held from row to row and reaches it behind a lag, so many quarters of a row
    late: exact, for the command is constant in each quarter."""
    n, size, quarter = int(6.0 / STEP), 4, STEP / 4
    u = tones(n * FINE, 15.0, seed)[::FINE]
    reaches = np.concatenate([np.full(delay, u[0]), np.repeat(u, 4)])[: 4 * n]
    whole = np.zeros((size, size))  # of x, v, the force, the command
    whole[0, 1], whole[1, :3], whole[2, 2:] = 1.0, (-400.0, -6.0, 0.5), (-1.0 / lag, 1.0 / lag)
    over, state, rows = expm(whole * quarter), np.array([0.0, 0.0, u[0], 0.0]), []
    for i, command in enumerate(reaches):
        state[3] = command
        if i % 4 == 0:
            rows.append((state[0], whole[1] @ state))
        state = over @ state
    rng = np.random.default_rng(seed + 100)
    seen = np.array(rows) + np.array([2e-5, 0.05]) * rng.standard_normal((n, 2))
    np.savetxt(path, np.column_stack([STEP * np.arange(n), u, seen]), "%.9g", ",", header="time [s],push [N],x [m],a [m/s^2]", comments="")


@pytest.mark.parametrize("lag, delay, kind, key", [(0.018, 0, "input_lag", "lag"), (1e-5, 11, "input_delay", "delay")])
def test_an_accelerometer_shows_what_a_held_command_does_between_rows(tmp_path, lag, delay, kind, key, show):
    """And is not late itself; a lag to a tenth of a row, a delay, which the model file has in rows, to half a row."""
    text = SLIDE.replace('"2 ms"', '"2 ms"\ninput = "held"')
    for seed, name in ((1, "train.csv"), (2, "hold.csv")):
        commanded(tmp_path / name, lag, delay, seed)
    d = found(tmp_path, text)
    show([(c["kind"], c["where"], c["parameters"]) for c in d["causes"]])
    assert [(c["kind"], c["where"]) for c in d["causes"]] == [(kind, "push")]
    assert abs(d["causes"][0]["parameters"][key]["value"] - max(lag, delay * STEP / 4)) < (0.5 if delay else 0.1) * STEP


def rubbed(level, transition):
    """Friction [N] of a level at a rate: an arc tangent."""
    return lambda v: level * 2.0 / math.pi * math.atan(v / transition)


FRICTIONS = [
    (SLIDE, lambda x, v: plain(x, v) + (4.0 + 120.0 * x) * rubbed(1.0, 0.004)(v), 2.0, 15.0, "xa", "position_dependent_friction", "guide"),
    (
        LINK,
        lambda x, v: 6.0 * math.sin(x) + 0.15 * v + (0.1 + 0.2 * abs(6.0 * math.sin(x))) * rubbed(1.0, 0.02)(v),
        0.2,
        3.0,
        "xw",
        "load_dependent_friction",
        "bearing",
    ),
]


@pytest.mark.parametrize("text, force, mass, size, columns, kind, where", sample(FRICTIONS, FRICTIONS[0]))
def test_a_friction_that_changes_is_named(tmp_path, text, force, mass, size, columns, kind, where, show):
    d = diagnosed(tmp_path, text, lambda u: u, force, mass, size, columns)
    show([(c["kind"], c["where"], c["parameters"]) for c in d["causes"]])
    assert [(c["kind"], c["where"]) for c in d["causes"]] == [(kind, where)]


@pytest.mark.parametrize("text, mass, size, columns", sample([(SLIDE, 2.0, 15.0, "xa"), (LINK, 0.2, 1.5, "xw")], (SLIDE, 2.0, 15.0, "xa")))
def test_nothing_hidden_nothing_named(tmp_path, text, mass, size, columns):
    force = plain if "a" in columns else lambda x, v: 6.0 * math.sin(x) + 0.15 * v
    d = diagnosed(tmp_path, text, lambda u: u, force, mass, size, columns)
    assert d["verdict"] == "no_discrepancy" and not d["causes"]
