# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Two rigs with springs: a mass on leaf springs with a voice coil, and a quarter car on a shaker."""

from __future__ import annotations

import numpy as np

from .rig import Input, Parameter, Rig, digits, sensor, sheet
from .signals import begun, chirp, sines, smooth

OSCILLATOR = """# Mass on leaf springs with an eddy-current brake, driven by a voice coil.
[model]
name = "oscillator"
sample_time = "@SAMPLE"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[bodies]
mass = { mass = "m", position = "x", velocity = "v" }

[elements]
leaves = { between = ["mass", "ground"], law = "linear_spring", stiffness = "k" }
brake = { between = ["mass", "ground"], law = "linear_damper", damping = "d" }
voice = { between = ["mass", "ground"], law = "expression", force = "-coil" }

[outputs]
speed = { value = "v", unit = "m/s" }

[sensors]
@SENSORS
"""
QUARTER = """# Bench quarter car: the platen of the shaker is the road, measured by an LVDT.
[model]
name = "bench"
sample_time = "@SAMPLE"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[bodies]
body = { mass = "m_b", position = "z_b", velocity = "v_b" }
wheel = { mass = "m_w", position = "z_w", velocity = "v_w" }

[elements]
spring = { between = ["body", "wheel"], law = "linear_spring", stiffness = "c" }
damper = { between = ["body", "wheel"], law = "linear_damper", damping = "d" }
tyre = { between = ["wheel", "road"], law = "linear_spring", stiffness = "c_t" }

[outputs]
z = { value = "z_b", unit = "m" }

[sensors]
@SENSORS
"""
TRAVEL = 0.02  # m of the oscillator
RATIO = 0.03  # its damping ratio


def oscillator(rng: np.random.Generator, variant: int, null: bool, size: float) -> Rig:
    """Hidden: hardening springs, or a wrong damping of the brake. Small: friction."""
    m, f0 = rng.uniform(0.4, 1.2), rng.uniform(2, 4)
    w0 = 2 * np.pi * f0
    k, d = m * w0 * w0, 2 * RATIO * m * w0
    rig = Rig(
        *("oscillator", "oscillator", 2e-3, 8),
        order=["m", "k", "d", "k3", "Fs", "vs"],
        parameters=[
            Parameter("m", digits(m, 3), "kg", 0.01),
            Parameter("k", digits(k, 3), "N/m", sheet(rng, 0.03)),
            Parameter("d", digits(d, 2), "N*s/m", 0.1),
        ],
        absent={"k3": 0.0, "Fs": 0.0, "vs": 0.01},
        model=OSCILLATOR,
        sensors=[sensor(rng, "laser", "x", "mm", 0.02, 0.01, 0.002)],
        inputs=[Input("coil", "N", lambda _, u: u[:, 0], 0.002 * k * TRAVEL)],
        shown=lambda x, _: {"laser": 1e3 * x[:, 0]},
        null=null,
    ).settle(rng)
    if not null:
        hide_in_oscillator(rig, rng, variant, size, k)
    for n, held_out in enumerate((False, False, True)):
        band = (f0 * rng.uniform(0.4, 0.6), f0 * rng.uniform(1.6, 2.2))
        amplitude = k * TRAVEL * (0.1 if held_out else (0.11, 0.11 * 0.6)[n])
        wave = sines(rng, 6, band, amplitude * 0.8) if held_out else chirp(band, amplitude, 20.0)
        rig.plan(held_out, 20.0, smooth(begun(wave, 0.5)), [0, 0])
    return rig


def hide_in_oscillator(rig: Rig, rng: np.random.Generator, variant: int, size: float, k: float) -> None:
    """Adds what the model file lacks."""
    rig.true |= {"Fs": 0.004 * k * TRAVEL * rng.random(), "vs": 0.005}
    rig.tolerated = [["coulomb_friction", "*"]]
    if variant == 0:
        rig.true["k3"] = size * rng.uniform(0.25, 0.5) * k / TRAVEL**2
        rig.hidden, rig.accepted = {"k3": 0.3 * k / TRAVEL**2}, [[["cubic_spring", "leaves|brake|voice|mass"]]]
        rig.what = f"hardening springs, {100 * rig.true['k3'] * TRAVEL**2 / k:.0f} % more force at {1e3 * TRAVEL:.0f} mm"
    else:
        factor = 1 + 0.3 * size if rng.random() < 0.5 else 1 - min(0.3 * size, 0.6)
        rig.true["d"] = rig.nominal()["d"] * factor
        rig.wide, rig.accepted = {"d"}, [[["wrong_parameter", "d"]]]
        rig.what = f"the damping of the brake is {factor:.2f} times the stated one"


def quarter(rng: np.random.Generator, variant: int, null: bool, size: float) -> Rig:
    """Hidden: a damper that is stiffer in rebound, or a bump stop. Small: friction of the guides."""
    body, wheel, d = rng.uniform(9, 14), rng.uniform(1.2, 2), 60.0
    parameters = [
        Parameter("m_b", digits(body, 3), "kg", 0.01),
        Parameter("m_w", digits(wheel, 3), "kg", sheet(rng, 0.03)),
        Parameter("c", 1500.0, "N/m", 0.05),
        Parameter("d", d, "N*s/m", 0.15),
        Parameter("c_t", 16000.0, "N/m", 0.1),
    ]
    sample = float(rng.choice([1e-3, 2e-3, 4e-3]))
    rig = Rig(
        *("quarter_bench", "quarter", sample, round(sample / 2e-4)),
        order=["m_b", "m_w", "c", "d", "c_t", "das", "ks", "gap", "Fs", "vs"],
        parameters=parameters,
        absent={"das": 0.0, "ks": 0.0, "gap": 1.0, "Fs": 0.0, "vs": 0.02},
        model=QUARTER,
        sensors=[
            sensor(rng, "a_body", "der(v_b)", "m/s^2", 0.04, 0.01, 0.002),
            sensor(rng, "a_wheel", "der(v_w)", "m/s^2", 0.15, 0.02),
            sensor(rng, "lvdt", "z_b - z_w", "mm", 0.03, 0.01, 0.002),
        ],
        inputs=[Input("road", "mm", lambda _, u: u[:, 0], 0.01, 0.002, si=1e-3)],
        shown=lambda x, v: {"a_body": v[:, 1], "a_wheel": v[:, 3], "lvdt": 1e3 * (x[:, 0] - x[:, 2])},
        null=null,
    ).settle(rng)
    if not null:
        hide_in_quarter(rig, rng, variant, size, d)
    for held_out in (False, False, True):
        rig.plan(held_out, 12.0, smooth(begun(sines(rng, 14, (0.6, 22), 0.004, 1.0), 0.4)), [0, 0, 0, 0])
    return rig


def hide_in_quarter(rig: Rig, rng: np.random.Generator, variant: int, size: float, d: float) -> None:
    """Adds what the model file lacks."""
    place = "spring|damper"
    rig.true |= {"Fs": rng.uniform(0, 0.3), "vs": 0.01}
    rig.tolerated = [["coulomb_friction", place]]
    if variant == 0:
        rig.true["das"] = size * rng.uniform(0.7, 1.2) * d
        rig.hidden = {"das": 0.6 * d}
        rig.accepted = [[["asymmetric_damper", place]], [["asymmetric_damper", place], ["wrong_parameter", "d"]]]
        rig.what = f"the damper is {1 + rig.true['das'] / rig.true['d']:.2f} times stiffer in rebound"
    else:
        rig.true |= {"ks": 9000 * rng.uniform(0.8, 1.2) * size, "gap": rng.uniform(0.004, 0.006)}
        rig.hidden, rig.accepted = {"ks": 8000.0, "gap": 0.005}, [[["bump_stop", place]]]
        rig.what = f"a bump stop of {rig.true['ks']:.0f} N/m beyond {1e3 * rig.true['gap']:.1f} mm of compression"
