# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Every named force law, in the generated C, against the same plant written down by hand and integrated by SciPy."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import penode_gen
from penode_gen.laws import LAWS
from penode_sil.targets import Sil

E = 2.718281828459045
STEP, SAMPLES = 2e-4, 5000
MODEL = """
[model]
name = "law"
sample_time = "0.2 ms"
[inputs]
F = {{ unit = "N" }}
[bodies]
mass = {{ mass = "2 kg", position = "z", velocity = "v_z", start_position = "0 m" }}
[elements]
spring = {{ between = ["mass", "ground"], law = "linear_spring", stiffness = "400 N/m" }}
push = {{ between = ["mass", "ground"], law = "expression", force = "-F" }}
extra = {{ between = ["mass", "ground"], law = "{law}", {arguments} }}
[outputs]
z = {{ value = "z", unit = "m" }}
force = {{ value = "F_extra", unit = "N" }}
"""
Law = Callable[[float, float, np.ndarray], tuple[float, list[float]]]  # s, v, own states -> force, their rates


def plain(force: Callable[[float, float], float]) -> Law:
    return lambda s, v, own: (force(s, v), [])


def bouc_wen(s: float, v: float, own: np.ndarray) -> tuple[float, list[float]]:
    """Stiff after a reversal (slip against the motion), yielding with 1 - slip^2 along it."""
    slip = own[0]
    return 9.0 * slip, [v / 0.01 * (1.0 - (slip**2 if v * slip > 0.0 else 0.0))]


def loose_damper(s: float, v: float, own: np.ndarray) -> tuple[float, list[float]]:
    """The damper slides only while its eye is beyond the play of 2 mm."""
    slide = np.sign(own[0]) * max(abs(own[0]) - 0.002, 0.0) / 0.03
    return 6.0 * (slide - v), [v - slide]


def aerated_damper(s: float, v: float, own: np.ndarray) -> tuple[float, list[float]]:
    """Gas that 0.5 m/s press by 3 mm, ever stiffer."""
    slide = 0.5 * (own[0] / 0.003) ** 3
    return 6.0 * (slide - v), [v - slide]


def absorber(s: float, v: float, own: np.ndarray) -> tuple[float, list[float]]:
    force = 90.0 * (s - own[0]) + 2e4 * (s - own[0]) ** 3 + 0.8 * (v - own[1])
    return force, [own[1], force / 0.4]


def tuned_mass(s: float, v: float, own: np.ndarray) -> tuple[float, list[float]]:
    pulls = 14.0**2 * (s - own[0]) + 2.0 * 0.1 * 14.0 * (v - own[1])
    return 0.3 * pulls, [own[1], pulls]


CASES: dict[str, tuple[dict[str, str], Law]] = {
    "linear_spring": ({"stiffness": "100 N/m"}, plain(lambda s, v: 100.0 * s)),
    "linear_damper": ({"damping": "3 N*s/m"}, plain(lambda s, v: 3.0 * v)),
    "constant_force": ({"force": "4 N"}, plain(lambda s, v: 4.0)),
    "cubic_spring": ({"cubic": "5 N/cm^3"}, plain(lambda s, v: 5e6 * s**3)),
    "quadratic_spring": ({"quadratic": "0.1 N/cm^2"}, plain(lambda s, v: 1e3 * s * s)),
    "progressive_spring": ({"root": "30 N^0.5/m", "lead": "0.1 m"}, plain(lambda s, v: 900.0 * ((s + 0.1) ** 2 - 0.01))),
    "asymmetric_spring": ({"stiffness": "300 N/m"}, plain(lambda s, v: 300.0 * s if s > 0.0 else 0.0)),
    "bump_stop": ({"stiffness": "1500 N/m", "gap": "20 mm"}, plain(lambda s, v: 1500.0 * (s - 0.02) if s > 0.02 else 0.0)),
    "rebound_stop": ({"stiffness": "1500 N/m", "gap": "20 mm"}, plain(lambda s, v: 1500.0 * (s + 0.02) if s < -0.02 else 0.0)),
    "backlash": ({"stiffness": "400 N/m", "gap": "8 mm"}, plain(lambda s, v: -400.0 * np.clip(s, -0.008, 0.008))),
    "liftoff": ({"stiffness": "400 N/m", "static": "10 mm"}, plain(lambda s, v: -400.0 * (s - 0.01) if s > 0.01 else 0.0)),
    "quadratic_damper": ({"coefficient": "8 N*s^2/m^2"}, plain(lambda s, v: 8.0 * v * abs(v))),
    "rebound_damper": ({"damping": "6 N*s/m"}, plain(lambda s, v: 6.0 * v if v > 0.0 else 0.0)),
    "compression_damper": ({"damping": "6 N*s/m"}, plain(lambda s, v: 6.0 * v if v < 0.0 else 0.0)),
    "degressive_damper": ({"damping": "-9 N*s/m", "knee": "0.2 m/s"}, plain(lambda s, v: 9.0 * v * (1.0 - 1.0 / (1.0 + abs(v) / 0.2)))),
    "fading_damper": ({"damping": "12 N*s/m", "time": "0.4 s"}, lambda s, v, own: (12.0 * own[0] * v, [(1.0 - own[0]) / 0.4])),
    "heating_damper": (
        {"damping": "12 N*s/m", "work": "30 cm^2/s", "cooling": "3 s"},
        lambda s, v, own: (12.0 * own[0] * v, [(1.0 - own[0]) * v * v / 0.003 - own[0] / 3.0]),
    ),
    "coulomb_friction": ({"force": "2 N", "transition": "0.05 m/s"}, plain(lambda s, v: 2.0 * np.tanh(v / 0.05))),
    "stribeck_friction": (
        {"breakaway": "3 N", "coulomb": "2 N", "stribeck": "0.1 m/s", "transition": "0.05 m/s"},
        plain(lambda s, v: np.sqrt(2.0 * E) * np.exp(-((v / 0.1) ** 2)) * v / 0.1 + 2.0 * np.tanh(v / 0.05)),
    ),
    "bouc_wen": ({"force": "9 N", "presliding": "10 mm"}, bouc_wen),
    "dahl_friction": ({"force": "9 N", "presliding": "10 mm"}, lambda s, v, own: (9.0 * own[0], [(v - abs(v) * own[0]) / 0.01])),
    "lugre_friction": (
        {"force": "9 N", "presliding": "10 mm", "rise": "0.8", "stribeck": "0.3 m/s"},
        lambda s, v, own: (9.0 * own[0], [(v - abs(v) * own[0] / (1.0 + 0.8 * np.exp(-((v / 0.3) ** 2)))) / 0.01]),
    ),
    "falling_friction": (
        {"force": "9 N", "presliding": "10 mm", "stribeck": "100 mm/s"},
        lambda s, v, own: (9.0 * own[0] / (1.0 + (v / 0.1) ** 2), [(v - abs(v) * own[0]) / 0.01]),
    ),
    "growing_force": (
        {"force": "4 N", "begin": "500 ms", "time": "300 ms"},
        lambda s, v, own: (4.0 / (1.0 + np.exp(-2.0 * (own[0] - 0.5) / 0.3)), [1.0]),
    ),
    "hardening_bushing": ({"cubic": "2e4 N/m^3", "relaxation": "60 ms"}, lambda s, v, own: (2e4 * own[0] ** 3, [v - own[0] / 0.06])),
    "bouc_wen_loop": (
        {"force": "9 N", "presliding": "10 mm", "bend": "0.7", "share": "0.6"},
        lambda s, v, own: (9.0 * own[0], [(v - (0.6 * abs(v) * own[0] + 0.4 * v * abs(own[0])) * (0.3 + 0.7 * abs(own[0]))) / 0.01]),
    ),
    "slack_friction": ({"force": "9 N", "presliding": "10 mm"}, lambda s, v, own: (9.0 * own[0] ** 5, bouc_wen(s, v, own)[1])),
    "aerated_damper": ({"damping": "6 N*s/m", "pocket": "3 mm", "rate": "0.5 m/s"}, aerated_damper),
    "loose_damper": ({"damping": "6 N*s/m", "gap": "2 mm", "relaxation": "30 ms"}, loose_damper),
    "maxwell_bushing": ({"stiffness": "300 N/m", "relaxation": "60 ms"}, lambda s, v, own: (own[0], [300.0 * v - own[0] / 0.06])),
    "absorber": ({"mass": "0.4 kg", "stiffness": "90 N/m", "cubic": "2e4 N/m^3", "damping": "0.8 N*s/m"}, absorber),
    "tuned_mass": ({"mass": "0.3 kg", "omega": "14 1/s", "loss": "0.1 1"}, tuned_mass),
}


def test_every_law_is_here():
    assert set(CASES) == set(LAWS)


@pytest.mark.parametrize("law", CASES)
def test_motion(tmp_path, law, show):
    """A mass on a spring, pushed near its resonance, for 1 s. The push is a straight line between samples for both."""
    arguments, by_hand = CASES[law]
    path = tmp_path / "law.toml"
    path.write_text(MODEL.format(law=law, arguments=", ".join(f'{k} = "{v}"' for k, v in arguments.items())))
    model = penode_gen.load(path)
    t = np.arange(SAMPLES + 1) * STEP
    push = 9.0 * np.sin(2.0 * np.pi * 2.3 * t) * (1.0 + 0.3 * np.sin(2.0 * np.pi * 11.0 * t))
    run = Sil(model, np.float64).run(push[:, None])

    def rates(time: float, x: np.ndarray) -> list[float]:
        force, own = by_hand(x[0], x[1], x[2:])
        return [x[1], (np.interp(time, t, push) - 400.0 * x[0] - force) / 2.0, *own]

    n_own = len(LAWS[law].states)
    exact = solve_ivp(rates, (0.0, t[-1]), np.zeros(2 + n_own), method="LSODA", rtol=1e-9, atol=1e-11, max_step=STEP, t_eval=t).y.T
    size, error = np.max(np.abs(exact), axis=0), np.max(np.abs(run.x - exact), axis=0)
    show(f"{law}: error {np.max(error / size):.1e} of the largest state")
    # RK4 errs by (h/tau)^5 a step where the law is smooth: below 1e-8. Where a step of 0.2 ms crosses a kink or the reversal
    # of a hysteresis, it sees a jump of the force's slope of at most 1500 N/m: an impulse error below slope v h^2/8 =
    # 1500*0.6*(2e-4)^2/8 = 4.5e-6 N s, 2.3e-6 m/s on the mass, or 4e-6 of its 0.6 m/s, at each of some 20 crossings.
    assert np.all(error < 1e-4 * size)
    force = [by_hand(x[0], x[1], x[2:])[0] for x in run.x]
    assert np.max(np.abs(run.y[:, 1] - force)) < 1e-9 * np.max(np.abs(force))
