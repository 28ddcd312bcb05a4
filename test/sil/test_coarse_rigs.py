# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rigs as laboratories have them: few samples a period, sensors finer than any model, parameters that are guessed, tanks. The plants here
are integrated in steps of a fortieth of a sample, and share nothing with the diagnosis."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

HEAD = """
[model]
name = "rig"
sample_time = "{step} ms"
[parameters]
{parameters}
[inputs]
u = {{ unit = "N" }}
[bodies]
mass = {{ mass = "m", position = "x", velocity = "v" }}
[elements]
{spring}damper = {{ between = ["mass", "ground"], law = "linear_damper", damping = "d" }}
drive = {{ between = ["mass", "ground"], law = "expression", force = "-u" }}
[outputs]
x = {{ value = "x", unit = "m" }}
[sensors]
{sensor}
"""
SPRING = 'spring = { between = ["mass", "ground"], law = "linear_spring", stiffness = "k" }\n'
FINE = 40  # steps a sample


def file(step: float, guesses: dict[str, tuple[float, str]], spring: str = SPRING, sensor: str = 'x = { value = "x", unit = "m" }') -> str:
    """A model file with a sample every `step` [ms] that only guesses its parameters."""
    parameters = "\n".join(f'{k} = {{ value = {v}, unit = "{u}", tolerance = "unknown" }}' for k, (v, u) in guesses.items())
    return HEAD.format(step=step, parameters=parameters, spring=spring, sensor=sensor)


def simulate(acceleration, u, h: float):
    """Position and rate [n] of a mass from rest under inputs u [n FINE], in steps of h/FINE; by Heun, whose error goes with its square."""
    dt, x, v, rows, inputs = h / FINE, 0.0, 0.0, [], u.tolist()
    for i, (now, after) in enumerate(zip(inputs, [*inputs[1:], inputs[-1]], strict=True)):
        if i % FINE == 0:
            rows.append((x, v))
        a = acceleration(x, v, now)
        w = v + dt * a
        x, v = x + 0.5 * dt * (v + w), v + 0.5 * dt * (a + acceleration(x + dt * v, w, after))
    return np.array(rows)


def write(path, h: float, u, sensor: str, z, drive: str = "u [N]") -> None:
    t = np.arange(len(z)) * h
    np.savetxt(path, np.column_stack([t, u[::FINE], z]), delimiter=",", header=f"time [s],{drive},{sensor}", comments="", fmt="%.10g")


def diagnosed(folder, penode, model: str, records) -> dict:
    """What the command says of a model and two recordings, for training and hold-out."""
    (folder / "model.toml").write_text(model)
    for name, arguments in zip(("train.csv", "hold.csv"), records, strict=True):
        write(folder / name, *arguments)
    penode("diagnose", folder / "model.toml", "--data", folder / "train.csv", "--holdout", folder / "hold.csv", "-o", folder / "out")
    return json.loads((folder / "out" / "diagnosis.json").read_text())


def waves(rng, count: int, low: float, high: float, n: int, h: float):
    """A sum of `count` sines between two frequencies [Hz] of rms 1, at every fine step [n FINE]."""
    t = np.arange(n * FINE) * h / FINE
    return sum(
        np.sin(2 * math.pi * f * t + p) for f, p in zip(rng.uniform(low, high, count), rng.uniform(0, 7, count), strict=True)
    ) / math.sqrt(0.5 * count)


def kinds(found: dict) -> list[str]:
    return [c["kind"] for c in found["causes"]]


@pytest.mark.long
def test_an_oscillator_with_nine_samples_a_period(tmp_path, penode):
    """A hardening spring whose cube is 19 % of the force, under waves up to a third of the sampling rate, with a load: straight lines
    between samples, or one step a sample, would err by more than the cube, and a scale of the sensor would do what a filter does."""
    h, records = 2e-3, []
    for seed in (1, 2):
        rng = np.random.default_rng(seed)
        u = 10.0 * waves(rng, 60, 2.0, 150.0, 1200, h)
        x = simulate(lambda x, v, u: (u - 0.6 - 40.0 * v - 1.2e5 * x - 4e11 * x**3) / 1.0, u, h)[:, 0]
        records.append((h, u, "x [m]", x + 2e-7 * rng.standard_normal(len(x))))
    found = diagnosed(tmp_path, penode, file(2, {"m": (0.8, "kg"), "d": (60, "N*s/m"), "k": (1e5, "N/m")}), records)
    assert sorted(kinds(found)) == ["cubic_spring", "integration_error"]
    gain = found["gain"]["x"]
    assert gain["after_rmse"] < 0.05 * gain["before_rmse"]  # the C knows no sample to come, so that waves of three samples stay 4 % off
    assert "substeps = " in (tmp_path / "out" / "model_extended.toml").read_text()


def carriage(rng, seconds: float, friction: float):
    """Positions [m] of a carriage of 20 kg with 80 N*s/m, dry friction, and 3 N of its cables, that is driven to and fro; its encoder
    counts micrometres."""
    h, n = 1e-3, int(1000 * seconds)
    t = np.arange(n * FINE) * h / FINE
    u = 3.0 + 28.0 * np.sign(np.sin(2 * math.pi * 0.4 * t)) + 12.0 * waves(rng, 12, 0.3, 2.0, n, h)
    x = simulate(lambda x, v, u: (u - 3.0 - 80.0 * v - friction * math.tanh(v / 4e-4)) / 20.0, u, h)[:, 0]
    return h, u, "x [m]", np.round(x, 6)


@pytest.mark.long
def test_a_carriage_with_an_encoder_of_a_micrometre(tmp_path, penode):
    """Friction and load have their names and sizes, though the friction turns round within 0.4 mm/s and the encoder shows any error."""
    records = [carriage(np.random.default_rng(seed), 4.0, 15.0) for seed in (3, 4)]
    model = file(1, {"m": (12, "kg"), "d": (50, "N*s/m")}, "", 'x = { value = "x", unit = "m", noise = 1e-6 }')
    found = diagnosed(tmp_path, penode, model, records)
    assert sorted(kinds(found)) == ["constant_force", "coulomb_friction"]
    sizes = {c["kind"]: c["parameters"]["force"]["value"] for c in found["causes"]}
    assert abs(sizes["coulomb_friction"] - 15.0) < 0.3 and abs(sizes["constant_force"] + 3.0) < 0.06  # 2 %, of data exact to 1e-5


def test_a_model_that_is_right_but_guessed(tmp_path, penode):
    """Nothing is wrong but the parameters, of which the file says that it does not know them: no discrepancy, and they are given."""
    records = []
    for seed in (5, 6):
        rng = np.random.default_rng(seed)
        u = 10.0 * waves(rng, 20, 0.2, 4.0, 3000, 5e-3)
        x = simulate(lambda x, v, u: (u - 12.0 * v - 900.0 * x) / 2.0, u, 5e-3)[:, 0]
        records.append((5e-3, u, "x [m]", x + 2e-5 * rng.standard_normal(len(x))))
    sensor = 'x = { value = "x", unit = "m", noise = 2e-5 }'
    found = diagnosed(tmp_path, penode, file(5, {"m": (3, "kg"), "d": (5, "N*s/m"), "k": (1500, "N/m")}, sensor=sensor), records)
    assert found["verdict"] == "no_discrepancy" and not found["causes"]
    assert any(
        re.fullmatch(r"fitted, because the file gives only a guess: m = (2|2\.00\d|1\.99\d) kg \+- .*", note) for note in found["notes"]
    )
    assert found["advice"][0].startswith("use model_extended.toml")
    assert found["gain"]["x"]["after_rmse"] < 1.05 * 2e-5


def converters(seeds, noise: float):
    """Recordings of a rotor of 2 kg and 12 N*s/m whose input is held from sample to sample, and the model file of it, guessed."""
    records = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        u = np.repeat((10.0 * waves(rng, 8, 0.2, 1.2, 2000, 10e-3))[::FINE], FINE)
        v = simulate(lambda x, v, u: (u - 12.0 * v) / 2.0, u, 10e-3)[:, 1]
        records.append((10e-3, u, "v [m/s]", v + noise * rng.standard_normal(len(v))))
    model = file(10, {"m": (3, "kg"), "d": (5, "N*s/m")}, "", f'v = {{ value = "v", unit = "m/s", noise = {noise} }}')
    return records, model.replace('x = { value = "x", unit = "m" }', 'v = { value = "v", unit = "m/s" }')


def later(rate: float, step: float) -> float:
    """How much later [s] the samples of v' = u - rate v follow a held u than one that runs straight, at low frequencies: the numerator of
    the first delays by a sample, that of the second, b0 + b1/z, by b1/(b0 + b1) of one (Franklin, Powell, Workman, Digital Control, 1998,
    6.3). Less half of the fine step in which the steps rise."""
    decay = np.exp(-rate * step)
    whole = (1.0 - decay) / (rate * step)
    b0, b1 = 1.0 - whole, whole - decay
    return step * (1.0 - b1 / (b0 + b1)) - 0.5 * step / FINE


def test_a_converter_that_holds_its_output_is_a_delay(tmp_path, penode):
    """About half a sample of delay, 2 % of the force there and all that is missed. No bushing, of which a third of the force would be
    needed for the like of it."""
    records, model = converters((7, 8), 1e-3)
    found = diagnosed(tmp_path, penode, model, records)
    assert kinds(found) in (["sensor_delay"], ["input_delay"])  # the same to a plant that does not change
    assert abs(found["causes"][0]["parameters"]["delay"]["value"] / later(12.0 / 2.0, 10e-3) - 1.0) < 0.01
    assert {found["causes"][0]["kind"], found["causes"][0]["alternatives"][0]["kind"]} == {"sensor_delay", "input_delay"}


def test_a_converter_in_the_model_file(tmp_path, penode):
    """With `input = "held"` the model is right: nothing has a name, and the hold-out is met to its noise; but for the fine step in which an
    input rises here, an eightieth of a sample, of 0.2 m/s at most."""
    records, model = converters((13, 14), 5e-3)
    found = diagnosed(tmp_path, penode, model.replace('"10 ms"', '"10 ms"\ninput = "held"'), records)
    assert found["verdict"] == "no_discrepancy" and found["gain"]["v"]["after_rmse"] < 1.1 * 5e-3


TANKS = """
[model]
name = "tanks"
sample_time = "4 s"
[parameters]
k1 = { value = 0.05, unit = "m^0.5/s", tolerance = "unknown" }
k2 = { value = 0.05, unit = "m^0.5/s", tolerance = "unknown" }
k3 = { value = 0.05, unit = "1/s", tolerance = "unknown" }
dry = { value = 0.01, unit = "m", exact = true }
[inputs]
u = { unit = "m" }
[states]
upper = { unit = "m", start = 4 }
lower = { unit = "m", start = 5 }
[equations]
one = "der(upper) = k3*u - k1*sqrt(max(upper, dry))"
two = "der(lower) = k1*sqrt(max(upper, dry)) - k2*sqrt(max(lower, dry))"
[outputs]
level = { value = "lower", unit = "m" }
[sensors]
level = { value = "lower", unit = "m" }
"""


def tanks(rng, leak: float):
    """The level [m] of the second of two tanks in a row, 450 samples of 4 s; of the first a share of what is above 4 m is lost."""
    u = 3.0 + 1.2 * waves(rng, 15, 0.001, 0.02, 450, 4.0)
    a, b, dt, level = 3.0, 4.0, 4.0 / FINE, []
    for i, pump in enumerate(u.tolist()):
        if i % FINE == 0:
            level.append(b)
        out = 0.09 * math.sqrt(max(a, 0.0))
        a, b = a + dt * (0.055 * pump - out - leak * max(a - 4.0, 0.0)), b + dt * (out - 0.08 * math.sqrt(max(b, 0.0)))
    return 4.0, u, "level [m]", np.array(level) + 0.005 * rng.standard_normal(len(level)), "u [m]"


@pytest.mark.long
def test_tanks_of_states_and_equations_alone(tmp_path, penode):
    """Parameters alone are wrong: fitted, they leave the noise. With a leak that no cause of the catalogue is, nothing gets a name, and the
    refitted model still predicts far better than the guess."""
    for name, leak in (("right", 0.0), ("leaks", 0.02)):
        folder = tmp_path / name
        folder.mkdir()
        records = [tanks(np.random.default_rng(seed), leak) for seed in (9, 10)]
        found = diagnosed(folder, penode, TANKS, records)
        gain = found["gain"]["level"]
        if leak:
            assert found["verdict"] == "unexplained" and gain["after_rmse"] < 0.3 * gain["before_rmse"]
        else:
            assert found["verdict"] == "no_discrepancy" and gain["after_rmse"] < 1.1 * 0.005


def test_a_sensor_cut_off_in_front_of_its_noise(tmp_path, penode):
    """No sample repeats the limit, and the spring is bent by 3 % in waves of no law of the catalogue."""
    records = []
    for seed in (11, 12):
        rng = np.random.default_rng(seed)
        u = 10.0 * waves(rng, 20, 0.2, 4.0, 3000, 2e-3)
        x = simulate(lambda x, v, u: (u - 12.0 * v - 900.0 * (x + 6e-4 * math.sin(x / 3e-3))) / 2.0, u, 2e-3)[:, 0]
        records.append((2e-3, u, "x [m]", np.clip(x, -0.016, 0.016) + 2e-5 * rng.standard_normal(len(x))))
    model = file(2, {"m": (2, "kg"), "d": (12, "N*s/m"), "k": (900, "N/m")}, sensor='x = { value = "x", unit = "m", noise = 2e-5 }')
    found = diagnosed(tmp_path, penode, model.replace('tolerance = "unknown"', "tolerance = 0.03"), records)
    assert kinds(found) == ["sensor_clipping"]
    assert abs(found["causes"][0]["parameters"]["limit"]["value"] / 0.016 - 1.0) < 0.01


@pytest.mark.long
def test_a_limit_that_bends_the_fit(tmp_path, penode):
    """A limit at 1.3 of the rms, in a file without tolerances: the parameters that fit it best are far off, and their motion stays below
    it."""
    records, limit = [], 0.0
    for seed in (11, 12):
        rng = np.random.default_rng(seed)
        u = 10.0 * waves(rng, 20, 0.2, 4.0, 3000, 2e-3)
        states = simulate(lambda x, v, u: (u - 12.0 * v - 900.0 * (x + 6e-4 * math.sin(x / 3e-3))) / 2.0, u, 2e-3)
        x, v = states.T[:2]
        a = (u[::FINE] - 12.0 * v - 900.0 * (x + 6e-4 * np.sin(x / 3e-3))) / 2.0
        limit = limit or 1.3 * np.std(x)
        seen = np.column_stack([np.clip(x, -limit, limit) + 2e-5 * rng.standard_normal(len(x)), a + 0.02 * rng.standard_normal(len(x))])
        records.append((2e-3, u, "x [m],a [m/s^2]", seen))
    sensor = 'x = { value = "x", unit = "m", noise = 2e-5 }\na = { value = "der(v)", unit = "m/s^2", noise = 0.02 }'
    model = file(2, {"m": (2, "kg"), "d": (12, "N*s/m"), "k": (900, "N/m")}, sensor=sensor)
    found = diagnosed(tmp_path, penode, model.replace(', tolerance = "unknown"', ""), records)
    assert kinds(found) == ["sensor_clipping"]
    assert abs(found["causes"][0]["parameters"]["limit"]["value"] / limit - 1.0) < 0.01
