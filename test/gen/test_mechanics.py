# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Points, bodies that turn, actuators, and models without inputs: against laws of mechanics and solutions written down by hand."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_gen import units
from penode_gen.laws import LAWS, for_angles
from penode_sil.batch import Batch
from penode_sil.targets import Sil

ROOT = Path(__file__).resolve().parents[2]

CAR = """
[model]
name = "car"
sample_time = "1 ms"
[parameters]
a = { value = 1.2, unit = "m" }
b = { value = 1.5, unit = "m" }
ratio = { value = 3, unit = "1" }
[inputs]
road = { unit = "m" }
steer = { unit = "deg" }
[bodies]
heave = { mass = "600 kg", position = "z", velocity = "v" }
pitch = { inertia = "900 kg*m^2", position = "theta", velocity = "omega" }
wheel = { mass = "40 kg" }
shaft = { inertia = "0.3 kg*m^2" }
[points]
front = "z - a*theta"
rear = "z + b*theta"
middle = "front/2 + rear/2"
out = "ratio*phi_shaft - theta"
[elements]
spring = { between = ["front", "wheel"], law = "linear_spring", stiffness = "20 kN/m" }
damper = { between = ["rear", "ground"], law = "quadratic_damper", coefficient = "300 N*s^2/m^2" }
tie = { between = ["wheel", "middle"], law = "cubic_spring", cubic = "3e5 N/m^3" }
tyre = { between = ["wheel", "road"], law = "linear_spring", stiffness = "200 kN/m" }
gear = { between = ["out", "ground"], law = "coulomb_friction", force = "7 N*m", transition = "2 deg/s" }
bar = { between = ["steer", "out"], law = "linear_spring", stiffness = "50 N*m/rad" }
[outputs]
height = { value = "middle", unit = "m" }
[sensors]
F_spring = { value = "F_spring", unit = "N" }
F_damper = { value = "F_damper", unit = "N" }
F_tie = { value = "F_tie", unit = "N" }
F_tyre = { value = "F_tyre", unit = "N" }
F_gear = { value = "F_gear", unit = "N*m" }
F_bar = { value = "F_bar", unit = "N*m" }
rate = { value = "der(middle)", unit = "m/s" }
"""

SWING = """
[model]
name = "swing"
sample_time = "1 ms"
method = "{method}"
[bodies]
arm = {{ inertia = "0.1 kg*m^2", start_position = "20 deg" }}
[elements]
gravity = {{ between = ["arm", "ground"], law = "linear_spring", stiffness = "6.4 N*m/rad" }}
bearing = {{ between = ["arm", "ground"], law = "linear_damper", damping = "0.02 N*m*s/rad" }}
[outputs]
phi = {{ value = "phi_arm", unit = "rad" }}
[sensors]
phi = {{ value = "phi_arm", unit = "rad" }}
"""


@pytest.fixture
def load(tmp_path):
    def one(text: str) -> penode_gen.Model:
        path = tmp_path / "model.toml"
        path.write_text(text)
        return penode_gen.load(path)

    return one


def car_rates(x: np.ndarray, road: float, steer: float) -> tuple[np.ndarray, np.ndarray]:
    """Accelerations [heave, pitch, wheel, shaft] and forces of CAR, by hand: each force with its lever arm."""
    z, theta, z_w, phi, v, omega, _v_w, omega_s = x
    a, b, ratio = 1.2, 1.5, 3.0
    s_tie = z_w - (z + 0.5 * (b - a) * theta)
    v_rear, v_out, s_out = v + b * omega, ratio * omega_s - omega, ratio * phi - theta
    spring, damper, tie, tyre = 2e4 * (z - a * theta - z_w), 300.0 * v_rear * abs(v_rear), 3e5 * s_tie**3, 2e5 * (z_w - road)
    gear, bar = 7.0 * np.tanh(v_out / np.deg2rad(2.0)), 50.0 * (steer - s_out)
    heave = -spring - damper + tie
    pitch = a * spring - b * damper + 0.5 * (b - a) * tie + gear - bar
    rates = [heave / 600.0, pitch / 900.0, (spring - tie - tyre) / 40.0, ratio * (bar - gear) / 0.3]
    return np.array(rates), np.array([spring, damper, tie, tyre, gear, bar])


def test_forces_on_points_act_by_the_transposed_combination(load):
    model, rng = load(CAR), np.random.default_rng(3)
    system = penode_gen.numeric(model)
    for _ in range(20):
        x = rng.standard_normal(8) * np.repeat((0.02, 0.3), 4)
        u = rng.standard_normal(2) * 0.01
        rates, forces = car_rates(x, *u)
        found = system.rates(x, u, np.zeros(2))
        # the same double arithmetic in another order: a few roundings of the largest term
        assert np.allclose(found[4:], rates, rtol=1e-12, atol=1e-12 * np.max(np.abs(rates)))
        assert np.array_equal(found[:4], x[4:])
        assert np.allclose(system.sensors(x, u, np.zeros(2))[:6], forces, rtol=1e-11)


def test_points_stand_for_their_combination_in_expressions(load):
    system = penode_gen.numeric(load(CAR))
    x = np.array([0.01, 0.02, 0.0, 0.0, 0.3, 0.4, 0.0, 0.0])
    assert system.outputs(x, np.zeros(2), np.zeros(2))[0] == pytest.approx(0.01 + 0.15 * 0.02, rel=1e-14)
    assert system.sensors(x, np.zeros(2), np.zeros(2))[6] == pytest.approx(0.3 + 0.15 * 0.4, rel=1e-14)


LAW = """
[model]
name = "law"
sample_time = "1 ms"
[parameters]
{parameters}
[bodies]
body = {{ {mass}, position = "q", velocity = "w" }}
[elements]
extra = {{ between = ["body", "ground"], law = "{law}", {arguments} }}
[outputs]
q = {{ value = "q", unit = "{unit}" }}
[sensors]
F = {{ value = "F_extra", unit = "{force}" }}
"""


@pytest.mark.parametrize("law", LAWS)
def test_every_law_in_both_kinds(load, law):
    """Between ends that turn, the numbers are those of the same law between ends that move, in the units of angles."""
    values = {key: 0.3 + 0.2 * i for i, key in enumerate(LAWS[law].arguments)}
    arguments = ", ".join(f'{key} = "{key}_1"' for key in values)
    found = []
    for mass, turned in (('mass = "2 kg"', str), ('inertia = "2 kg*m^2"', for_angles)):
        parameters = "\n".join(f'{k}_1 = {{ value = {v}, unit = "{turned(LAWS[law].arguments[k])}" }}' for k, v in values.items())
        text = LAW.format(mass=mass, law=law, arguments=arguments, parameters=parameters, unit=turned("m"), force=turned("N"))
        model = load(text)
        system, rng = penode_gen.numeric(model), np.random.default_rng(1)
        x = rng.uniform(-1.0, 1.0, (10, len(model.states)))
        found.append([np.concatenate([system.rates(row, (), ()), system.sensors(row, (), ())]) for row in x])
        assert [units.si(s.unit) for s in model.extra_states] == [turned(s.unit) for s in LAWS[law].states.values()]
    assert np.array_equal(*found)


def expect_refused(path: Path, text: str, what: str) -> None:
    """A line for each problem, with place and remedy; one says `what`."""
    path.write_text(text)
    with pytest.raises(penode_gen.ModelError) as caught:
        penode_gen.load(path)
    assert any(what in p for p in caught.value.problems), caught.value.problems
    assert all(re.match(rf"{re.escape(str(path))}:\d+: .+; .+", p) for p in caught.value.problems)


@pytest.mark.parametrize(
    "old, new, what",
    [
        (
            '["front", "wheel"]',
            '["pitch", "wheel"]',
            "'pitch' turns and 'wheel' moves along a line; write a point with the lever arm in [points], such as",
        ),
        ('stiffness = "50 N*m/rad"', 'stiffness = "50 N/m"', "'50 N/m' is not measured in N*m/rad; give a quantity in N*m/rad"),
        ('inertia = "0.3 kg*m^2"', 'inertia = "0.3 kg"', "'0.3 kg' is not measured in kg*m^2"),
        ('inertia = "0.3 kg*m^2"', 'inertia = "-0.3 kg*m^2"', "inertia '-0.3 kg*m^2' is not above zero"),
        ('"z - a*theta"', '"z - theta"', "combines m with no unit; correct the units: an arm in m times an angle in rad is a length"),
        ('"z - a*theta"', '"z*theta"', "'z*theta' is not a linear combination of positions"),
        ('"z - a*theta"', '"z + a"', "'z + a' is not a linear combination of positions"),
        ('"z - a*theta"', '"z - a*tehta"', "uses 'tehta'"),
        ('"ratio*phi_shaft - theta"', '"a*a*phi_shaft"', "is measured in m^2; a point is a length or an angle"),
        ('front = "z', 'heave = "z', "'heave' is taken by the body of that name"),
        ('"steer", "out"', '"steer", "aout"', "end 'aout' is no body, point, input or ground; did you mean 'out'?"),
    ],
)
def test_what_is_refused_and_how_to_mend_it(tmp_path, old, new, what):
    expect_refused(tmp_path / "bad.toml", CAR.replace(old, new), what)


ACTUATED = """
[model]
name = "act"
sample_time = "1 ms"
[parameters]
k_t = { value = 0.8, unit = "1" }
[inputs]
tau = { unit = "N*m" }
z = { unit = "m" }
[actuators]
behind = { input = "tau", law = "lag", time = "20 ms", start = "1 N*m" }
torque = { input = "behind", law = "gain", gain = "k_t" }
ram = { input = "z", law = "lag", time = "50 ms" }
[bodies]
drum = { inertia = "0.5 kg*m^2" }
load = { mass = "2 kg" }
[elements]
drive = { between = ["drum", "ground"], law = "expression", force = "-torque" }
spring = { between = ["load", "ram"], law = "linear_spring", stiffness = "300 N/m" }
damper = { between = ["load", "ram"], law = "linear_damper", damping = "9 N*s/m" }
[outputs]
torque = { value = "torque", unit = "N*m" }
[sensors]
alpha = { value = "der(omega_drum)", unit = "rad/s^2" }
rate = { value = "v_damper", unit = "m/s" }
"""


def test_actuators(load):
    """A step of 3 N*m through lag and gain is 0.8 (3 - 2 exp(-t/T)); a position behind a lag has the rate (z - ram)/T.
    RK4 errs by (h/T)^4/120 of the lag's change: 5e-8 of it; 1e-7 is allowed."""
    model = load(ACTUATED)
    run = Sil(model, np.float64).run(np.tile([3.0, 0.1], (500, 1)))
    t = np.arange(500) * 1e-3
    wanted = 0.8 * (3.0 - 2.0 * np.exp(-t / 0.02))
    assert np.max(np.abs(run.y[:, 0] - wanted)) < 1e-7 * 2.4
    assert np.max(np.abs(run.z[:, 0] - run.y[:, 0] / 0.5)) < 1e-12
    x = dict(zip(model.states, run.x.T, strict=True))
    assert np.max(np.abs(run.z[:, 1] - (x["v_load"] - (0.1 - x["ram"]) / 0.05))) < 1e-12


@pytest.mark.parametrize(
    "old, new, what",
    [
        (
            'law = "gain", gain = "k_t"',
            'law = "spring", gain = "k_t"',
            "law 'spring' is unknown; known are gain, lag, dead_zone, saturation, delay, held, slew_limit",
        ),
        ('law = "gain", gain = "k_t"', 'law = "gain"', "'gain' is missing"),
        ('law = "gain", gain = "k_t"', 'law = "gain", gain = "k_t", time = "1 s"', "the law 'gain' has no time"),
        ('input = "behind"', 'input = "nothing"', "'nothing' is no input or earlier actuator"),
        ('time = "20 ms"', 'time = "0 ms"', "is not above zero"),
    ],
)
def test_actuators_refused(tmp_path, old, new, what):
    expect_refused(tmp_path / "bad.toml", ACTUATED.replace(old, new), what)


@pytest.mark.parametrize("method", ["rk4", "ros2", "ros1", "euler"])
def test_free_swing_has_no_input_and_its_c_is_c99(load, tmp_path, method):
    model = load(SWING.format(method=method))
    assert model.inputs == ()
    penode_gen.generate(model, tmp_path)
    flags = "-std=c99 -pedantic -Wall -Wextra -Werror -ffp-contract=off -fsyntax-only".split()
    include = [f"-I{ROOT / folder}" for folder in ("inc", "port/gnu")]
    subprocess.run(["gcc", *flags, *include, f"-I{tmp_path}", str(tmp_path / "swing.c"), str(tmp_path / "swing_selftest.c")], check=True)


def test_free_swing(load):
    """SiL, batch, single steps and the Jacobian against exp(A t). RK4 of a linear system errs by (w h)^5/120 a step, w = 8 rad/s: 3e-13
    of the amplitude, or 6e-10 in 2000 steps."""
    model, n = load(SWING.format(method="rk4")), 2000
    sil = Sil(model, np.float64)
    run, batch = sil.run(np.zeros((n, 0))), Batch(model).run(np.zeros((n, 0)))
    w2, d = 64.0, 0.1
    w = np.sqrt(w2 - d * d)
    t, start = np.arange(n) * 1e-3, np.deg2rad(20.0)
    wanted = start * np.exp(-d * t) * (np.cos(w * t) + d / w * np.sin(w * t))
    assert np.max(np.abs(run.y[:, 0] - wanted)) < 1e-9 * start
    assert np.array_equal(batch.z[0], run.z)
    instance = sil.instance()
    instance.step([])
    jacobian = instance.step_jacobian([], 12)[1]  # x_x, x_u_before, x_u, y_x, y_u
    a = np.array([[0.0, 1.0], [-w2, -2.0 * d]]) * 1e-3
    power, expected = np.eye(2), np.eye(2)
    for k in range(1, 5):
        power = power @ a / k
        expected = expected + power
    assert np.max(np.abs(jacobian[:4].reshape(2, 2) - expected)) < 1e-14
    assert not jacobian[4:8].any()
    assert instance.get_input().size == 0
