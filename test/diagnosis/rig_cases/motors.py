# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Two rigs with a motor at a held voltage: a throttle valve and a DC motor with a disc."""

from __future__ import annotations

import numpy as np

from .rig import Input, Parameter, Rig, digits, sensor, sheet, varied
from .signals import Wave, held, in_turn, sines, stairs

THROTTLE = """# Throttle valve: motor, gear and return spring as one inertia about the limp-home position; b includes the back EMF.
[model]
name = "throttle"
sample_time = "@SAMPLE"
input = "held"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[bodies]
flap = { inertia = "J", position = "phi", velocity = "omega" }

[elements]
spring = { between = ["flap", "ground"], law = "linear_spring", stiffness = "k" }
loss = { between = ["flap", "ground"], law = "linear_damper", damping = "b" }
motor = { between = ["flap", "ground"], law = "expression", force = "-Kt*u" }

[outputs]
rate = { value = "omega", unit = "rad/s" }

[sensors]
@SENSORS
"""
MOTOR = """# DC motor with a disc; the inductance is negligible.
[model]
name = "dcmotor"
sample_time = "@SAMPLE"
input = "held"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[bodies]
rotor = { inertia = "J", position = "phi", velocity = "omega" }

[elements]
bearing = { between = ["rotor", "ground"], law = "linear_damper", damping = "b" }
winding = { between = ["rotor", "ground"], law = "expression", force = "-kt*(u - ke*omega)/R" }

[outputs]
angle = { value = "phi", unit = "rad" }

[sensors]
@SENSORS
"""
SPAN = 1.5  # rad of the throttle, shown as 100 %


def throttle(rng: np.random.Generator, variant: int, null: bool, size: float) -> Rig:
    """Hidden: Coulomb friction, an asymmetric return spring, or preload at the limp-home position. Small: cogging."""
    inertia, k = varied(rng, 2.2e-3), varied(rng, 0.3, 0.1)
    limp = digits(rng.uniform(0.28, 0.36), 2)
    parameters = [
        Parameter("J", digits(inertia, 2), "kg*m^2", 0.05),
        Parameter("k", digits(k, 2), "N*m/rad", 0.05),
        Parameter("b", 0.035, "N*m*s/rad", 0.2),
        Parameter("Kt", 0.06, "N*m/V", sheet(rng, 0.03)),
        Parameter("limp", limp, "rad", exact=True),
        Parameter("span", SPAN, "rad", exact=True),
    ]
    rig = Rig(
        *("throttle", "throttle", 2e-3, 10),
        order=["J", "k", "b", "Kt", "Tc", "vs", "klow", "preload", "rounding", "cogging"],
        parameters=parameters,
        absent={"Tc": 0.0, "vs": 0.03, "klow": 0.0, "preload": 0.0, "rounding": 0.01, "cogging": 0.0},
        model=THROTTLE,
        sensors=[sensor(rng, "opening", "(phi + limp)/span", "%", 0.08, 0.05, 0.003)],
        inputs=[Input("u", "V", lambda _, u: u[:, 0], step=0.01, held=True)],
        shown=lambda x, _: {"opening": 100 * (x[:, 0] + limp) / SPAN},
        null=null,
    ).settle(rng)
    if not null:
        hide_in_throttle(rig, rng, variant, size, k)
    for held_out in (False, False, True):
        steps = stairs(rng, 12.0, (0.25, 0.7), 3.0, 1.1)
        waves = sines(rng, 5, (0.15, 1.2), 1.4)
        rig.plan(held_out, 12.0, held(voltage(steps, waves, held_out), 0.01), [0, 0])
    return rig


def voltage(steps: Wave, waves: Wave, held_out: bool) -> Wave:
    """Steps, then sines; in the hold-out sines, then steps. The flap stays off its end stops."""
    parts, end = ((lambda t: 0.9 + 1.2 * waves(t), steps), 4.2) if held_out else ((steps, lambda t: 0.8 + waves(t)), 6.2)
    return in_turn(0.1, parts, (end,), (-1.05, 4.2))


def hide_in_throttle(rig: Rig, rng: np.random.Generator, variant: int, size: float, k: float) -> None:
    """Adds what the model file lacks."""
    place = "spring|loss|motor|flap"
    rig.true |= {"cogging": rng.uniform(0, 0.002), "vs": 0.02}
    if variant == 0:
        rig.true["Tc"] = size * rng.uniform(0.03, 0.05)
        rig.hidden, rig.accepted = {"Tc": 0.03}, [[["coulomb_friction", place]]]
        rig.what = f"Coulomb friction of the shaft, {rig.true['Tc']:.3g} N*m"
    elif variant == 1:
        rig.true["klow"] = size * rng.uniform(1.0, 1.6) * k
        rig.hidden = {"klow": k}
        rig.accepted = [[["asymmetric_spring", place]], [["asymmetric_spring", place], ["wrong_parameter", "k"]]]
        rig.what = f"return spring {1 + rig.true['klow'] / rig.true['k']:.2f} times stiffer below the limp-home position"
    else:
        rig.true["preload"] = size * rng.uniform(0.04, 0.06)
        rig.hidden, rig.accepted = {"preload": 0.03}, [[["outside_taxonomy", "*"]]]
        rig.verdicts = ["unexplained", "partly_explained"]
        rig.what = f"springs preloaded against each other: a step of {2 * rig.true['preload']:.3g} N*m at the limp-home position"


def motor(rng: np.random.Generator, variant: int, null: bool, size: float) -> Rig:
    """Hidden: Coulomb friction, saturation of the supply, or both. Small: cogging."""
    inertia, kt = 3e-4 * rng.uniform(0.8, 1.3), 0.05
    parameters = [
        Parameter("J", digits(inertia, 3), "kg*m^2", exact=True),
        Parameter("kt", kt, "N*m/A", sheet(rng, 0.03)),
        Parameter("ke", kt, "V*s/rad", 0.03),
        Parameter("R", 1.2, "V/A", 0.05),
        Parameter("b", 1.5e-4, "N*m*s/rad", 0.2),
    ]
    rig = Rig(
        *("dc_motor", "motor", 5e-3, 20),
        order=["J", "kt", "ke", "R", "b", "umax", "Tc", "vs", "cogging"],
        parameters=parameters,
        absent={"umax": 1e6, "Tc": 0.0, "vs": 0.5, "cogging": 0.0},
        model=MOTOR,
        sensors=[sensor(rng, "tacho", "omega", "rad/s", 0.6, 0.1, 0.003)],
        inputs=[Input("u", "V", lambda _, u: u[:, 0], step=0.01, held=True)],
        shown=lambda x, _: {"tacho": x[:, 1]},
        null=null,
    ).settle(rng)
    if not null:
        hide_in_motor(rig, rng, variant, size)
    for held_out in (False, False, True):
        steps = stairs(rng, 12.0, (0.2, 0.8), 16.0)
        waves = sines(rng, 5, (0.1, 1.5), 6.0)
        parts = (waves, steps) if held_out else (steps, waves)
        rig.plan(held_out, 12.0, held(in_turn(0.1, parts, (6.0,), (-16.0, 16.0)), 0.01), [0, 0])
    return rig


def hide_in_motor(rig: Rig, rng: np.random.Generator, variant: int, size: float) -> None:
    """Adds what the model file lacks: 0 both, 1 friction, 2 saturation."""
    friction, saturation = ["coulomb_friction", "bearing|winding|rotor"], ["input_saturation", "u"]
    words = []
    rig.true |= {"cogging": rng.uniform(0, 0.004), "vs": 0.3}
    if variant in (0, 1):
        rig.true["Tc"] = size * rng.uniform(0.06, 0.09)
        rig.hidden["Tc"] = 0.05
        words.append(f"Coulomb friction {rig.true['Tc']:.3f} N*m")
    if variant in (0, 2):
        rig.true["umax"] = rng.uniform(9.5, 11) / (1.15 if size > 1 else 1)
        rig.hidden["umax"] = 10.5
        words.append(f"supply saturates at {rig.true['umax']:.2f} V")
    rig.accepted = [[[friction, saturation], [friction], [saturation]][variant]]
    rig.what = " and ".join(words)
