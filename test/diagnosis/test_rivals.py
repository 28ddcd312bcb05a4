# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the rivals stand on simulates the plants that the campaign has, those without a state too."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent / "rivals"))
import rig

HEAD = """
[model]
name = "plant"
sample_time = "1 ms"
[parameters]
k = { value = 900, unit = "N/m" }
d = { value = 30, unit = "N*s/m" }
m = { value = 4, unit = "kg" }
[inputs]
x = { unit = "m" }
[elements]
spring = { between = ["%s", "%s"], law = "linear_spring", stiffness = "k" }
damper = { between = ["%s", "%s"], law = "linear_damper", damping = "d" }
[sensors]
force = { value = "%s", unit = "N", noise = 0.1 }
"""
MASS = '[bodies]\nmass = { mass = "m", position = "z", velocity = "v" }\n'


@pytest.fixture
def told(tmp_path):
    """told(ends, sensor, more): a Rig and a recording of one second in which x is a sine."""

    def make(ends: tuple[str, str], sensor: str, more: str = "") -> tuple[rig.Rig, rig.Recording]:
        (tmp_path / "model.toml").write_text(HEAD % (*ends, *ends, sensor) + more)
        t = np.arange(1001) * 1e-3
        given = np.column_stack([0.01 * np.sin(9.0 * t), 0.09 * np.cos(9.0 * t)])
        return rig.Rig(tmp_path / "model.toml"), rig.Recording(1e-3, given, {"force": np.zeros(len(t))})

    return make


def test_a_law_under_prescribed_motion_has_no_state(told):
    plant, r = told(("x", "ground"), "F_spring + F_damper")
    start = plant.start(r)
    said = plant.simulate(r, start, lambda s, v: 5.0 * s)[2]
    assert start.shape == (0, 1)
    assert np.allclose(said[:, 0, 0], 905.0 * r.given[:, 0] + 30.0 * r.given[:, 1], rtol=1e-12)
    assert plant.fitted([r]).keys() == {"k", "d", "m"}


def test_a_mass_moves_as_the_exact_solution(told):
    """From the steady state, m z'' = k (x - z) + d (x' - z'). Straight lines between samples make a sine smaller by (w h)^2 / 12,
    and with it z, which starts that much off as well."""
    plant, r = told(("mass", "x"), "F_spring", MASS)
    transfer = (900.0 + 30.0 * 9j) / (900.0 + 30.0 * 9j - 4.0 * 81.0)
    z = 0.01 * transfer * np.exp(9j * np.arange(1001) * 1e-3)
    start = np.array([[z[0].imag], [(9j * z[0]).imag]])
    said = plant.simulate(r, start)[2][:, 0, 0]
    exact = 900.0 * (z.imag - r.given[:, 0])
    assert np.max(np.abs(said - exact)) < 900.0 * 2.0 * 0.009**2 / 12.0 * np.max(np.abs(z))
