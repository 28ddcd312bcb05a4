# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a model file means: rates, outputs and sensors of several models against equations written down by hand, first in
the float64 functions of the reference, then in the generated C."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import models
import numpy as np
import pytest

import penode_gen
from penode_sil.targets import Sil

Vector = np.ndarray


@dataclass(frozen=True)
class Case:
    """A model file, and its rates, outputs and sensors by hand, all as f(x, u, du/dt); a set that must be known."""

    text: str
    rates: Callable[..., list[float]]
    outputs: Callable[..., list[float]]
    sensors: Callable[..., list[float]]
    states: tuple[str, ...]
    chosen: str = "default"


HEAD = '[model]\nname = "case"\nsample_time = "1 ms"\nmethod = "{method}"\n'

# Three masses in a row between a moving wall and ground; two elements share their ends, one has them exchanged.
CHAIN = Case(
    """
[parameters]
k = { value = 2, unit = "kN/mm" }
big = { value = 3000, unit = "g" }
[inputs]
wall = { unit = "m" }
push = { unit = "N" }
[bodies]
a = { mass = "big", position = "z_a", velocity = "v_a", start_position = "-3 mm", start_velocity = "2 km/h" }
b = { mass = "2 kg", position = "z_b", velocity = "v_b" }
c = { mass = "0.5 kg", position = "z_c", velocity = "v_c" }
[elements]
first = { between = ["wall", "a"], law = "linear_spring", stiffness = "k" }
spring = { between = ["a", "b"], law = "cubic_spring", cubic = "7 N/mm^3" }
damper = { between = ["a", "b"], law = "quadratic_damper", coefficient = "11 N*s^2/m^2" }
back = { between = ["b", "a"], law = "linear_damper", damping = "13 N*s/m" }
last = { between = ["b", "c"], law = "bump_stop", stiffness = "17 N/m", gap = "100 mm" }
stop = { between = ["c", "ground"], law = "rebound_stop", stiffness = "19 N/m", gap = "0.2 m" }
drag = { between = ["c", "ground"], law = "expression", force = "F_first*v/(v_first + v) - push" }
[outputs]
z_c = { value = "z_c", unit = "m" }
stretch = { value = "s_back", unit = "mm" }
speed = { value = "v_back", unit = "m/s" }
[sensors]
a_a = { value = "der(v_a)", unit = "m/s^2" }
F_drag = { value = "F_drag", unit = "N" }
rate = { value = "der(z_b) - der(wall)", unit = "m/s" }
""",
    lambda x, u, r: _chain(x, u, r)[0],
    lambda x, u, r: [x[2], x[1] - x[0], x[4] - x[3]],
    lambda x, u, r: [_chain(x, u, r)[0][3], _chain(x, u, r)[1], x[4] - r[0]],
    ("z_a", "z_b", "z_c", "v_a", "v_b", "v_c"),
)


def _chain(x: Vector, u: Vector, r: Vector) -> tuple[list[float], float]:
    """Rates, and the force of the drag. A spring between p and q pulls p down and q up with F(z_p - z_q)."""
    z_a, z_b, z_c, v_a, v_b, v_c = x
    first = 2e6 * (u[0] - z_a)
    spring = 7e9 * (z_a - z_b) ** 3
    damper = 11.0 * (v_a - v_b) * abs(v_a - v_b)
    back = 13.0 * (v_b - v_a)
    last = 17.0 * max(z_b - z_c - 0.1, 0.0)
    stop = 19.0 * min(z_c + 0.2, 0.0)
    drag = first * v_c / ((r[0] - v_a) + v_c) - u[1]
    a = (first - spring - damper + back) / 3.0
    b = (spring + damper - back - last) / 2.0
    return [v_a, v_b, v_c, a, b, (last - stop - drag) / 0.5], drag


# No state at all: what force a given motion takes.
MOTION = Case(
    """
[parameters]
lead = { value = 4, unit = "cm" }
[inputs]
z = { unit = "m" }
[bodies]
[elements]
curve = { between = ["z", "ground"], law = "progressive_spring", root = "30 N^0.5/m", lead = "lead" }
rub = { between = ["z", "ground"], law = "coulomb_friction", force = "3 N", transition = "20 mm/s" }
rise = { between = ["z", "ground"], law = "rebound_damper", damping = "5 N*s/m" }
fall = { between = ["z", "ground"], law = "compression_damper", damping = "8 N*s/m" }
load = { between = ["z", "ground"], law = "constant_force", force = "-0.25 kN" }
[variables]
total = { unit = "N" }
[equations]
sum = "total = F_curve + F_rub + F_rise + F_fall + F_load"
[outputs]
F = { value = "total", unit = "N" }
[sensors]
rub = { value = "F_rub", unit = "kN" }
""",
    lambda x, u, r: [],
    lambda x, u, r: [(30 * (u[0] + 0.04)) ** 2 - (30 * 0.04) ** 2 + 3 * np.tanh(r[0] / 0.02) + 5 * max(r[0], 0) + 8 * min(r[0], 0) - 250.0],
    lambda x, u, r: [3 * np.tanh(r[0] / 0.02)],
    (),
)

# Plain equations: two rooms and a heater with a thermostat, and functions of all kinds.
THERMAL = Case(
    """
[parameters]
C = { value = 0.5, unit = "kJ/K", tunable = true }
G = { value = 3, unit = "W/K" }
K1 = { value = 1, unit = "K" }
a1 = { value = 2, unit = "1", tunable = true }
a0 = { value = 5, unit = "1", tunable = true }
[inputs]
T_out = { unit = "K" }
P = { unit = "kW" }
[states]
T1 = { unit = "K", start = 293 }
T2 = { unit = "K", start = 291 }
[variables]
Q = { unit = "W" }
x1 = { unit = "1" }
[equations]
flow = "Q = G*(T1 - T2)"
room = "C*der(T1) = where(T1 <= T2 + 2*K1, P, P/4) - Q"
other = "der(T2)*C/(a0 - a1) = Q + G*(T_out - T2)"
mix = "x1 = softplus(T1/(10*K1)) - sigmoid(-T2/K1) + exp(-(T_out/K1)^2)/3 + sign(T1 - T2)*max(min(T1/K1, 2), -1)^3"
[outputs]
Q = { value = "Q", unit = "W" }
x1 = { value = "a1*x1 - a0", unit = "1" }
[sensors]
slope = { value = "der(T1) - 2*der(T2)", unit = "K/s" }
[sets.default]
[sets.other]
C = "2 kJ/K"
a0 = "7"
""",
    lambda x, u, r: _thermal(x, u),
    lambda x, u, r: [3.0 * (x[0] - x[1]), 2.0 * _mix(x, u) - 7.0],
    lambda x, u, r: [_thermal(x, u)[0] - 2.0 * _thermal(x, u)[1]],
    ("T1", "T2"),
    "other",
)


def _thermal(x: Vector, u: Vector) -> list[float]:
    flow = 3.0 * (x[0] - x[1])
    heat = u[1] if x[0] <= x[1] + 2.0 else u[1] / 4.0
    return [(heat - flow) / 2000.0, (flow + 3.0 * (u[0] - x[1])) * (7.0 - 2.0) / 2000.0]


def _mix(x: Vector, u: Vector) -> float:
    return (
        np.log1p(np.exp(x[0] / 10.0))
        - 1.0 / (1.0 + np.exp(x[1]))
        + np.exp(-(u[0] ** 2)) / 3.0
        + np.sign(x[0] - x[1]) * max(min(x[0], 2.0), -1.0) ** 3
    )


# Algebraic loops: a network of resistors with a switch (three unknowns), and an acceleration that acts on itself.
LOOP = Case(
    """
[parameters]
R = { value = 2, unit = "ohm" }
[inputs]
U = { unit = "V" }
F = { unit = "N" }
[bodies]
cart = { mass = "4 kg", position = "z", velocity = "v" }
[elements]
own = { between = ["cart", "ground"], law = "expression", force = "m_more*der(v) - F" }
[parameters.m_more]
value = 1.5
unit = "kg"
[variables]
i1 = { unit = "A" }
i2 = { unit = "A" }
i3 = { unit = "A" }
[equations]
knot = "i1 = i2 + i3"
left = "U = R*i1 + 3*R*i2*where(U > 0, 1, 2)"
right = "3*R*where(U > 0, 1, 2)*i2 = R*i3/tanh(U^2*G2 + 1)"
[parameters.G2]
value = 1
unit = "1/V^2"
[outputs]
i3 = { value = "i3", unit = "A" }
[sensors]
a = { value = "der(v)", unit = "m/s^2" }
power = { value = "U*i1", unit = "W" }
""",
    lambda x, u, r: [x[1], u[1] / (4.0 + 1.5)],
    lambda x, u, r: [_currents(u[0])[2]],
    lambda x, u, r: [u[1] / 5.5, u[0] * _currents(u[0])[0]],
    ("z", "v"),
)


def _currents(voltage: float) -> Vector:
    """Kirchhoff's equations as a matrix."""
    r2 = 6.0 * (1.0 if voltage > 0.0 else 2.0)
    r3 = 2.0 / np.tanh(voltage**2 + 1.0)
    return np.linalg.solve([[1.0, -1.0, -1.0], [2.0, r2, 0.0], [0.0, r2, -r3]], [0.0, voltage, 0.0])


CASES = {"chain": CHAIN, "motion": MOTION, "thermal": THERMAL, "loop": LOOP}


def loaded(folder: Path, name: str, method: str = "rk4") -> penode_gen.Model:
    path = folder / f"{name}.toml"
    path.write_text(HEAD.format(method=method) + CASES[name].text)
    return penode_gen.load(path)


def points(case: Case, model: penode_gen.Model, n: int) -> list[tuple[Vector, Vector, Vector]]:
    """Random states, inputs and input rates, of all signs and of the size of 1."""
    draw = np.random.default_rng(3)
    return [
        (draw.normal(size=len(case.states)), draw.normal(size=len(model.inputs)), draw.normal(size=len(model.inputs))) for _ in range(n)
    ]


@pytest.mark.parametrize("name", CASES)
def test_reference_follows_the_file(tmp_path, name):
    case, model = CASES[name], loaded(tmp_path, name)
    assert model.states == case.states
    numeric = penode_gen.numeric(model, case.chosen)
    for x, u, r in points(case, model, 50):
        # a few dozen operations, each within 1.1e-16, and sums that lose two digits to cancellation
        close = {"rtol": 1e-12, "atol": 1e-12}
        for found, expected in ((numeric.rates, case.rates), (numeric.outputs, case.outputs), (numeric.sensors, case.sensors)):
            np.testing.assert_allclose(found(x, u, r), expected(x, u, r), **close)


@pytest.mark.parametrize("method", ["rk4", "ros2"])
@pytest.mark.parametrize("name", CASES)
def test_generated_c_means_the_same(tmp_path, name, method):
    """The first sample gives outputs without integrating; an input that has just begun has no rate."""
    case, model = CASES[name], loaded(tmp_path, name, method)
    sil = Sil(model, np.float64)
    for x, u, _ in points(case, model, 50):
        instance = sil.instance(case.chosen)
        if case.states:
            assert instance.set_state(x) == 0
        state, y, status = instance.step(u)
        rate = np.zeros_like(u)
        assert status == 0 and np.array_equal(state, x)
        # as above, and 1 / constant is rounded once more before it multiplies; pen_exp and pen_tanh are within 2 ulp
        np.testing.assert_allclose(y, case.outputs(x, u, rate), rtol=1e-11, atol=1e-11)
        np.testing.assert_allclose(instance.sensors(), case.sensors(x, u, rate), rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("name", ["chain", "motion"])
def test_generated_c_knows_the_rate_of_an_input(tmp_path, name):
    """After two samples the rate is their difference over the sample time."""
    case, model = CASES[name], loaded(tmp_path, name)
    sil = Sil(model, np.float64)
    for x, u, r in points(case, model, 20):
        instance = sil.instance()
        instance.step(u - 1e-3 * r)
        if case.states:
            instance.set_state(x)
        x, y, status = instance.step(u)
        assert status == 0
        # the rate: rounding of two inputs of size 1 (1.1e-16) over 1 ms; relative to 2e6 N/m that is below 1e-6
        np.testing.assert_allclose(y, case.outputs(x, u, r), rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(instance.sensors(), case.sensors(x, u, r), rtol=1e-9, atol=1e-6)


def test_start_values_and_scaled_units(tmp_path):
    """Start values in mm and km/h, parameters in kN/mm, g and kJ/K are SI in the model, in the sets and in the C."""
    model = loaded(tmp_path, "chain")
    expected = [-3e-3, 0.0, 0.0, 2 / 3.6, 0.0, 0.0]
    np.testing.assert_allclose(model.start, expected, rtol=1e-15)
    np.testing.assert_allclose(penode_gen.numeric(model).initial_state(), expected, rtol=1e-15)
    np.testing.assert_allclose(Sil(model, np.float64).instance().step([0.0, 0.0])[0], expected, rtol=1e-15)
    thermal = loaded(tmp_path, "thermal")
    assert thermal.parameters["C"].value == 500.0 and thermal.sets["other"].parameters == {"C": 2000.0, "a1": 2.0, "a0": 7.0}
    assert list(penode_gen.set_values(thermal, "other", np.float64)) == [2000.0, 2.0, 7.0]
    header = penode_gen.render(model)["case.h"]
    assert "pen_real_t stretch; /* m */" in header  # shown in mm, but C is SI


def test_set_that_is_not_there(tmp_path):
    with pytest.raises(KeyError, match=r"thermal\.toml has no set 'cold'; it has default, other"):
        penode_gen.numeric(loaded(tmp_path, "thermal"), "cold")


def test_networks_in_equations(tmp_path):
    """A network of a network, one called twice, and names that look like those of the code."""
    data = models.network_file(tmp_path / "net.json", [1, 4, 1], ["tanh", "identity"], 2)
    path = tmp_path / "calls.toml"
    path.write_text(
        HEAD.format(method="heun")
        + """
[inputs]
u = { unit = "1" }
n_1 = { unit = "1" }
[networks]
n = { inputs = ["1"], output = "1" }
[variables]
y = { unit = "1" }
w = { unit = "1" }
[equations]
twice = "w = n(n(u) + n_1)"
both = "y = n(u)*n(2*u) - n(n_1)"
[outputs]
y = { value = "y", unit = "1" }
w = { value = "w", unit = "1" }
[sets.default]
n = "net.json"
"""
    )
    model = penode_gen.load(path)
    sil, numeric = Sil(model, np.float64), penode_gen.numeric(model)

    def n(x: float) -> float:
        return models.network_by_hand(data, np.array([x]))

    for u in np.random.default_rng(9).normal(size=(20, 2)):
        expected = [n(u[0]) * n(2 * u[0]) - n(u[1]), n(n(u[0]) + u[1])]
        np.testing.assert_allclose(numeric.outputs(np.zeros(0), u, np.zeros(2)), expected, rtol=1e-12, atol=1e-12)
        _, y, status = sil.instance().step(u)
        assert status & ~np.uint32(0x10) == 0  # outside of the trained range, perhaps
        np.testing.assert_allclose(y, expected, rtol=1e-11, atol=1e-11)


def test_other_values_of_parameters_are_those_of_another_file(tmp_path):
    """with_parameters does what a model file with these values does, and leaves the first one as it was."""
    model = loaded(tmp_path, "thermal")
    of_set = model.sets["default"].parameters if model.sets else {}  # values of a set go before those of the model
    name, p = next((n, p) for n, p in model.parameters.items() if p.value and n not in of_set)
    changed = replace(model, parameters={**model.parameters, name: replace(p, value=1.5 * p.value)})
    x, u = np.array(model.start, dtype=float) + 0.3, np.full(len(model.inputs), 0.7)
    first = penode_gen.numeric(model)
    before = first.rates(x, u, 0.0 * u)
    other = first.with_parameters({name: 1.5 * p.value}).rates(x, u, 0.0 * u)
    np.testing.assert_array_equal(other, penode_gen.numeric(changed).rates(x, u, 0.0 * u))
    np.testing.assert_array_equal(first.rates(x, u, 0.0 * u), before)
    assert not np.array_equal(other, before)
    with pytest.raises(KeyError, match="has no parameter nothing"):
        first.with_parameters({"nothing": 1.0})
