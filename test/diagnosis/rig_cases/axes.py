# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Two drives along an axis: a cart on a rail, and a positioning axis with a belt."""

from __future__ import annotations

import numpy as np

from .rig import Input, Parameter, Rig, digits, sensor, sheet, varied
from .signals import begun, held, in_turn, sines, smooth, stairs
from .swinging import CABLE

CART = """# Cart on a rail, driven by a DC motor through a belt; b includes the back EMF.
[model]
name = "cart"
sample_time = "@SAMPLE"
input = "held"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[bodies]
cart = { mass = "m", position = "x", velocity = "v" }

[elements]
rail = { between = ["cart", "ground"], law = "linear_damper", damping = "b" }
motor = { between = ["cart", "ground"], law = "expression", force = "-Km*u" }

[outputs]
place = { value = "x", unit = "m" }

[sensors]
@SENSORS
"""
AXIS = """# Positioning axis: motor and load joined by a toothed belt (all referred to the motor shaft).
[model]
name = "axis"
sample_time = "@SAMPLE"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[bodies]
motor = { inertia = "J1", position = "q1", velocity = "w1" }
load = { inertia = "J2", position = "q2", velocity = "w2" }

[elements]
belt = { between = ["motor", "load"], law = "linear_spring", stiffness = "k" }
belt_loss = { between = ["motor", "load"], law = "linear_damper", damping = "c" }
bearing = { between = ["motor", "ground"], law = "linear_damper", damping = "b1" }
guide = { between = ["load", "ground"], law = "linear_damper", damping = "b2" }
current = { between = ["motor", "ground"], law = "expression", force = "-torque" }

[outputs]
speed = { value = "w2", unit = "rad/s" }

[sensors]
@SENSORS
"""
GAINS = {"kp": 0.6, "kd": 0.02}  # N*m/rad, N*m*s/rad of the axis' controller


def cart(rng: np.random.Generator, _variant: int, null: bool, size: float) -> Rig:
    """Hidden: a dead zone of the power stage. Small: stiffness of the cable, friction."""
    m, km = rng.uniform(0.9, 1.8), 1.7
    rig = Rig(
        *("cart_motor", "cart", 1e-2, 20),
        order=["m", "Km", "b", "w", "kc", "Fs", "vs"],
        parameters=[Parameter("m", digits(m, 3), "kg", 0.02), Parameter("Km", km, "N/V", 0.05), Parameter("b", 6.0, "N*s/m", 0.15)],
        absent={"w": 0.0, "kc": 0.0, "Fs": 0.0, "vs": 0.01},
        model=CART,
        sensors=[sensor(rng, "v", "v", "m/s", 0.002, 0.005, stated=0.6)],
        inputs=[Input("u", "V", lambda _, u: u[:, 0], step=0.02, held=True)],
        shown=lambda x, _: {"v": x[:, 1]},
        null=null,
    ).settle(rng)
    if not null:
        rig.true |= {"w": size * rng.uniform(0.6, 1.1), "kc": rng.uniform(0, 0.05), "Fs": 0.01 * km * 6 * rng.random(), "vs": 0.01}
        rig.hidden, rig.accepted = {"w": 0.7}, [[["input_dead_zone", "u"]]]
        rig.tolerated = [["coulomb_friction", "*"], *([kind, "rail|motor|cart"] for kind in CABLE)]
        rig.what = f"dead zone of the power stage, {rig.true['w']:.3g} V of 6 V"
    for held_out in (False, False, True):
        waves = (stairs(rng, 25.0, (0.2, 0.7), 6.0), sines(rng, 4, (0.25, 0.8), 2.5), sines(rng, 4, (0.8, 3), 3.0))
        k = int(rng.integers(3))
        parts = (waves[k], waves[(k + 1) % 3], waves[(k + 2) % 3])
        rig.plan(held_out, 25.0, held(in_turn(0.3, parts, (9.0, 17.0), (-6.0, 6.0)), 0.02), [0, 0])
    return rig


def axis(rng: np.random.Generator, variant: int, null: bool, size: float) -> Rig:
    """Hidden: play of the belt's coupling, or friction of the guide. Small: cogging."""
    parameters = [
        Parameter("J1", digits(varied(rng, 4e-4), 3), "kg*m^2", 0.02),
        Parameter("J2", digits(varied(rng, 9e-4), 3), "kg*m^2", sheet(rng, 0.03)),
        Parameter("k", 18.0, "N*m/rad", 0.1),
        Parameter("c", 0.012, "N*m*s/rad", 0.5),
        Parameter("b1", 0.004, "N*m*s/rad", 0.3),
        Parameter("b2", 0.002, "N*m*s/rad", 0.3),
    ]
    count = 2 * np.pi / float(rng.choice([8000, 20000]))
    rig = Rig(
        *("axis", "axis", 1e-3, 10),
        order=["J1", "J2", "k", "c", "b1", "b2", "gap", "Tc", "vs", "closed", "kp", "kd", "cogging"],
        parameters=parameters,
        absent={"gap": 0.0, "Tc": 0.0, "vs": 0.05, "closed": 0.0, "cogging": 0.0, **GAINS},
        model=AXIS,
        sensors=[sensor(rng, "q1", "q1", "rad", 0.1 * count, count), sensor(rng, "twist", "q1 - q2", "rad", 0.2 * count, count)],
        inputs=[Input("torque", "N*m", lambda x, u: GAINS["kp"] * (u[:, 0] - x[:, 0]) - GAINS["kd"] * x[:, 1], 0.0005, 0.0005)],
        shown=lambda x, _: {"q1": x[:, 0], "twist": x[:, 0] - x[:, 2]},
        null=null,
    ).settle(rng)
    rig.true["closed"] = 1.0
    if not null:
        rig.true |= {"cogging": rng.uniform(0, 0.0008), "vs": 0.03}
        if variant == 0:
            rig.true["gap"] = size * rng.uniform(0.008, 0.015)
            rig.hidden, rig.accepted = {"gap": 0.008}, [[["backlash", "belt|belt_loss"]]]
            rig.what = f"play in the coupling of the belt, +-{rig.true['gap']:.4f} rad"
        else:
            rig.true["Tc"] = size * rng.uniform(0.03, 0.05)
            rig.hidden, rig.accepted = {"Tc": 0.03}, [[["coulomb_friction", "guide|load"]]]
            rig.what = f"dry friction of the load guide, {rig.true['Tc']:.3f} N*m"
    for held_out in (False, False, True):
        rig.plan(held_out, 6.0, smooth(begun(sines(rng, 7, (0.4, 5.0), 1.1, 0.7), 0.4)), [0, 0, 0, 0])
    return rig
