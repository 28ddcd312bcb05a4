# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Actuators that delay and hold samples, through `penode simulate` and the diagnosis: a rotor behind a slow bus and a converter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import penode_gen
from penode_sil import diagnosis
from penode_sil.cli import cli
from penode_sil.late import Delayed, Held
from penode_sil.recordings.measured import load
from penode_sil.signals import Samples

ROTOR = """
[model]
name = "rotor"
sample_time = "1 ms"
[parameters]
J = { value = 0.02, unit = "kg*m^2", tolerance = 0.02 }
d = { value = 0.05, unit = "N*m*s/rad", tolerance = 0.05 }
[inputs]
tau = { unit = "N*m" }
[actuators]
bus = { input = "tau", law = "delay", samples = 5 }
drive = { input = "bus", law = "held", samples = 10 }
[bodies]
rotor = { inertia = "J", position = "phi", velocity = "omega" }
[elements]
bearing = { between = ["rotor", "ground"], law = "linear_damper", damping = "d" }
torque = { between = ["rotor", "ground"], law = "expression", force = "-drive" }
[outputs]
drive = { value = "drive", unit = "N*m" }
[sensors]
speed = { value = "omega", unit = "rad/s", noise = 0.01 }
"""


def measured(path: Path, friction: float, seed: int, n: int = 4000) -> np.ndarray:
    """A recording of that rotor, with friction or without, in 20 steps of RK4 a sample; its speed without noise."""
    draw = np.random.default_rng(seed)
    t = np.arange(n) * 1e-3
    waves = zip(draw.uniform(0.2, 0.6, 12), np.linspace(0.4, 9.0, 12), draw.uniform(0.0, 6.28, 12), strict=True)
    tau = sum(a * np.sin(2.0 * np.pi * f * t + p) for a, f, p in waves)
    speed, w, level = np.zeros(n), 0.0, 0.0
    for k in range(n):
        speed[k] = w
        level = tau[max(k - 5, 0)] if k % 10 == 0 else level
        for _ in range(20):
            slopes, h = [0.0], 1e-3 / 20.0
            for share in (0.0, 0.5, 0.5, 1.0):
                v = w + share * h * slopes[-1]
                slopes.append((level - 0.05 * v - friction * np.tanh(v / 0.3)) / 0.02)
            w += h / 6.0 * (slopes[1] + 2.0 * slopes[2] + 2.0 * slopes[3] + slopes[4])
    table = np.column_stack([t, tau, speed + 0.01 * draw.standard_normal(n)])
    np.savetxt(path, table, "%.9g", ",", header="time [s],tau [N*m],speed [rad/s]", comments="")
    return speed


@pytest.fixture
def model(tmp_path) -> Path:
    path = tmp_path / "rotor.toml"
    path.write_text(ROTOR)
    return path


@pytest.mark.parametrize("on", ["sil", "mil"])
def test_simulate(model, tmp_path, on):
    """The speed is that of the loop, in float 1e-5 of some 20 rad/s; a sample more or less of delay would be off by 0.1."""
    speed = measured(tmp_path / "a.csv", 0.0, 1)
    found = CliRunner().invoke(
        cli, ["simulate", str(model), "--input", str(tmp_path / "a.csv"), "--on", on, "-o", str(tmp_path / "out.csv")]
    )
    assert found.exit_code == 0, found.output
    rows = np.genfromtxt(tmp_path / "out.csv", delimiter=",", names=True)
    assert np.max(np.abs(rows["speed_rads"] - speed)) < 1e-3


@pytest.mark.parametrize("friction, kind", [(0.0, None), (0.08, "coulomb_friction")])
def test_diagnosis(model, tmp_path, friction, kind):
    """Nothing is found behind the delay where nothing hides, and friction with its force: 3 % is ten times its interval."""
    measured(tmp_path / "a.csv", friction, 2)
    loaded = penode_gen.load(model)
    found = diagnosis.diagnose(loaded, load([tmp_path / "a.csv"], loaded))
    if kind is None:
        assert found.verdict == "no_discrepancy"
    else:
        assert [(c.kind, c.where) for c in found.causes] == [(kind, "bearing")]
        assert found.causes[0].parameters["force"].value == pytest.approx(friction, rel=0.03)


def test_signals():
    """At steps, the value from then on; a delay before its time is the first sample."""
    time = np.arange(11) * 0.1
    signal = Samples(time, time**2)
    held, late = Held(signal, 0.3, 1.0), Delayed(signal, 0.2)
    assert held.value(np.array([0.0, 0.29, 0.3, 0.6 - 1e-16, 0.89])) == pytest.approx([0.0, 0.0, 0.09, 0.36, 0.36])
    assert not held.slope(time).any() and held.knots() == pytest.approx([0.0, 0.3, 0.6, 0.9])
    assert late.value(np.array([0.0, 0.1, 0.25, 0.9])) == pytest.approx([0.0, 0.0, 0.005, 0.49])
    assert late.slope(np.array([0.1, 0.25])) == pytest.approx([0.0, 0.1])
    assert late.knots()[:3] == pytest.approx([0.2, 0.2, 0.3])


@pytest.mark.parametrize(
    "header, channel, what",
    [
        (
            "time [s];Winkel (deg)",
            [],
            '"penode inspect a.csv swing.toml" lists its columns, then name them, such as --channel angle=COLUMN',
        ),
        (
            "t;Winkel (deg)",
            ["--channel", "angle=Winkel"],
            'channel time has no unit; write "t [s]" in the header, or say --channel "time=t [s]"\n',
        ),
    ],
)
def test_a_model_without_inputs_names_missing_channels(tmp_path, header, channel, what):
    """The first problem of the only sensor, not that there is none."""
    swing = ROTOR.replace('tau = { unit = "N*m" }', "").replace("[inputs]", "").split("[actuators]")[0]
    swing += '[bodies]\nrotor = { inertia = "J", position = "phi", velocity = "omega" }\n[outputs]\nphi = { value = "phi", unit = "rad" }\n'
    (tmp_path / "swing.toml").write_text(swing.replace("d = {", "# ") + '[sensors]\nangle = { value = "phi", unit = "rad" }\n')
    (tmp_path / "a.csv").write_text("\n".join([header, *(f"{0.001 * k:.3f};{k}" for k in range(50))]))
    found = CliRunner().invoke(
        cli, ["simulate", str(tmp_path / "swing.toml"), "--input", str(tmp_path / "a.csv"), *channel, "-o", str(tmp_path / "o.csv")]
    )
    said = "".join(getattr(found.exception, "problems", [str(found.exception)])) + "\n"
    assert found.exit_code != 0 and what in said and not (tmp_path / "o.csv").exists()
