# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A position servo, whose set point acts late or changes at a limited rate."""

from __future__ import annotations

import numpy as np

from .rig import Input, Parameter, Rig, digits, sensor
from .signals import held, in_turn, rounded, sines, stairs

SERVO = """# Position servo, identified by its maker as a rotating mass on a spring to the set point.
[model]
name = "servo"
sample_time = "@SAMPLE"
input = "held"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[bodies]
horn = { inertia = "J", position = "phi", velocity = "omega" }

[elements]
loop = { between = ["horn", "ground"], law = "expression", force = "k*(phi - ref)" }
loss = { between = ["horn", "ground"], law = "linear_damper", damping = "d" }

[outputs]
speed = { value = "omega", unit = "rad/s" }

[sensors]
@SENSORS
"""
DEGREE = np.pi / 180
STEP = 0.1  # degrees of the set point
INERTIA = 2e-3


def servo(rng: np.random.Generator, variant: int, null: bool, size: float) -> Rig:
    """Hidden: a delay of the set point, or a limit of its rate. Small: friction."""
    w0, ratio = rng.uniform(22, 32), 0.6
    k = INERTIA * w0 * w0
    rig = Rig(
        *("servo", "servo", 1e-2, 100),
        order=["J", "k", "d", "rate", "Tc", "vs"],
        parameters=[
            Parameter("J", INERTIA, "kg*m^2", 0.02),
            Parameter("k", digits(k, 3), "N*m/rad", 0.05),
            Parameter("d", digits(2 * ratio * INERTIA * w0, 2), "N*m*s/rad", 0.15),
        ],
        absent={"rate": 0.0, "Tc": 0.0, "vs": 0.05},
        model=SERVO,
        sensors=[sensor(rng, "phi", "phi", "deg", 0.12, 0.1, 0.002)],
        inputs=[Input("ref", "deg", lambda _, u: u[:, 0], step=STEP, held=True, si=DEGREE)],
        shown=lambda x, _: {"phi": np.rad2deg(x[:, 0])},
        null=null,
    ).settle(rng)
    delay = 0.0 if null else hide_in_servo(rig, rng, variant, size, k)
    for held_out in (False, False, True):
        steps = stairs(rng, 15.0, (0.25, 0.8), 0.7)
        waves = sines(rng, 5, (0.3, 3), 0.3)
        parts = (waves, steps) if held_out else (steps, waves)
        set_point = in_turn(0.1, parts, (8.0,), (-np.inf, np.inf))
        step = np.deg2rad(STEP)
        rig.plan(held_out, 15.0, held(set_point, step, delay), [0, 0, 0], command=rounded(set_point, step))
    return rig


def hide_in_servo(rig: Rig, rng: np.random.Generator, variant: int, size: float, k: float) -> float:
    """Adds what the model file lacks; returns the delay of the set point."""
    rig.true["Tc"] = 0.004 * k * 0.5 * rng.random()
    rig.tolerated = [["coulomb_friction", "*"]]
    if variant == 0:
        delay = 0.013 * (1.3 if size > 1 else 1)
        rig.hidden, rig.accepted = {"delay": 0.01}, [[["input_delay", "ref"]], [["sensor_delay", "phi"]]]
        rig.what = f"the set point acts {delay / rig.sample:.2f} samples late"
        return delay
    rig.true["rate"] = rng.uniform(3.0, 5.0) / size
    rig.hidden, rig.accepted = {"rate": 4.0}, [[["input_slew_limit", "ref"]]]
    rig.what = f"the servo limits the rate of its set point to {np.rad2deg(rig.true['rate']):.0f} deg/s"
    return 0.0
