# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Two rigs that swing: a released pendulum, and a laboratory crane under position control."""

from __future__ import annotations

import numpy as np

from .rig import Input, Parameter, Rig, digits, sensor, sheet
from .signals import begun, none, sines, smooth

PENDULUM = """# Free pendulum on a ball bearing: gravity and the maker's viscous loss.
[model]
name = "pendulum"
sample_time = "@SAMPLE"

[parameters]
@PARAMETERS

[bodies]
arm = { inertia = "J", position = "phi", velocity = "omega" }

[elements]
gravity = { between = ["arm", "ground"], law = "expression", force = "mgl*sin(phi)" }
bearing = { between = ["arm", "ground"], law = "linear_damper", damping = "d" }

[outputs]
rate = { value = "omega", unit = "rad/s" }

[sensors]
@SENSORS
"""
CRANE = """# Laboratory crane, small angles: cart on a rail, load on a rope as a pendulum, both by their horizontal position.
[model]
name = "crane"
sample_time = "@SAMPLE"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[bodies]
cart = { mass = "m_cart", position = "x", velocity = "v" }
load = { mass = "m_load", position = "xl", velocity = "vl" }

[elements]
rail = { between = ["cart", "ground"], law = "linear_damper", damping = "b" }
rope = { between = ["load", "cart"], law = "expression", force = "m_load*g/l*s" }
air = { between = ["load", "cart"], law = "linear_damper", damping = "dr" }
drive = { between = ["cart", "ground"], law = "expression", force = "-force" }

[outputs]
speed = { value = "v", unit = "m/s" }

[sensors]
@SENSORS
"""
CABLE = ("missing_spring", "asymmetric_spring", "cubic_spring")  # what the stiffness of a cable may be called
GAINS = {"kp": 120.0, "kd": 16.0}  # N/m, N*s/m of the crane's controller


def pendulum(rng: np.random.Generator, _variant: int, null: bool, size: float) -> Rig:
    """Hidden: dry friction of the bearing. Small: drag of the air, stiffness of the encoder's cable."""
    length, m = rng.uniform(0.15, 0.3), rng.uniform(0.08, 0.3)
    inertia, mgl = m * length * length * 1.2, m * 9.81 * length
    parameters = [
        Parameter("J", digits(inertia, 3), "kg*m^2", exact=True),
        Parameter("mgl", digits(mgl, 3), "N*m", sheet(rng, 0.03)),
        Parameter("d", digits(0.006 * inertia * np.sqrt(mgl / inertia), 2), "N*m*s/rad", 0.15),
    ]
    count = 2 * np.pi / float(rng.choice([4096, 8192, 16384]))
    rig = Rig(
        *("pendulum", "pendulum", 2e-3, 8),
        order=["J", "mgl", "d", "Tc", "vs", "drag", "kc"],
        parameters=parameters,
        absent={"Tc": 0.0, "vs": 0.01, "drag": 0.0, "kc": 0.0},
        model=PENDULUM,
        sensors=[sensor(rng, "phi", "phi", "rad", 0.05 * count, count)],
        inputs=[],
        shown=lambda x, _: {"phi": x[:, 0]},
        null=null,
        start=lambda y, t: [y["phi"][0], np.polyfit(t[:12], y["phi"][:12], 2)[1]],
        scatter=(2e-3, 2e-2),
    ).settle(rng)
    if not null:
        friction = size * rng.uniform(0.008, 0.02) * rig.true["mgl"]
        rig.true |= {"Tc": friction, "vs": 0.004, "drag": rng.uniform(0, 0.001) * inertia, "kc": rng.uniform(-0.002, 0.004) * mgl}
        rig.hidden = {"Tc": 0.01 * mgl}
        rig.accepted = [[["coulomb_friction", "gravity|bearing|arm"]]]
        rig.tolerated = [["quadratic_damper", "*"], *([kind, "gravity|bearing|arm"] for kind in CABLE)]
        rig.what = f"dry friction of the bearing, {friction:.3g} N*m ({100 * friction / rig.true['mgl']:.1f} % of m g l)"
    for held_out, angle in ((False, 2.1), (False, 1.2), (False, 0.55), (True, 1.6), (True, 0.8)):
        start = [angle * rng.uniform(0.9, 1.1) * rng.choice([-1, 1]), rng.uniform(-0.5, 0.5)]
        rig.plan(held_out, 10.0, none, start, free=True)
    return rig


def crane(rng: np.random.Generator, _variant: int, null: bool, size: float) -> Rig:
    """Hidden: friction of the rail, more of it in one direction. Small: stiffness of the cable, sines of the angle."""
    cart, load, rope = rng.uniform(1.5, 3), rng.uniform(0.4, 0.9), rng.uniform(0.3, 0.5)
    parameters = [
        Parameter("m_cart", digits(cart, 3), "kg", 0.02),
        Parameter("m_load", digits(load, 3), "kg", sheet(rng, 0.01, 0.5)),
        Parameter("l", digits(rope, 3), "m", 0.01),
        Parameter("b", 3.0, "N*s/m", 0.2),
        Parameter("dr", 0.03, "N*s/m", 0.5),
        Parameter("g", 9.81, "m/s^2", exact=True),
    ]
    rig = Rig(
        *("crane", "crane", 4e-3, 10),
        order=["m_cart", "m_load", "l", "b", "dr", "Fc", "dF", "vs", "closed", "kp", "kd", "kc"],
        parameters=parameters,
        absent={"Fc": 0.0, "dF": 0.0, "vs": 0.005, "closed": 0.0, "kc": 0.0, **GAINS},
        model=CRANE,
        sensors=[sensor(rng, "x", "x", "mm", 0.05, 0.05, 0.001), sensor(rng, "angle", "(xl - x)/l", "rad", 0.0004, 2 * np.pi / 4096)],
        inputs=[Input("force", "N", lambda x, u: GAINS["kp"] * (u[:, 0] - x[:, 0]) - GAINS["kd"] * x[:, 1], 0.02, 0.005)],
        shown=lambda x, _: {"x": 1e3 * x[:, 0], "angle": x[:, 2]},
        null=null,
    ).settle(rng)
    rig.true["closed"] = 1.0
    rail = "rail|drive|cart"
    if not null:
        friction = size * rng.uniform(1.2, 2.2)
        more = friction * rng.uniform(0.3, 0.5) * rng.choice([-1, 1])
        rig.true |= {"Fc": friction, "dF": more, "vs": 0.003, "kc": rng.uniform(0, 0.1)}
        rig.hidden, rig.linear = {"Fc": 1.0, "dF": 0.3}, {"dF"}
        one_sided = (("constant_force", rail), ("input_offset", "force"), ("asymmetric_damper", rail), ("asymmetric_spring", rail))
        rig.accepted = [[["coulomb_friction", rail], [kind, place]] for kind, place in one_sided]
        rig.tolerated = [[kind, rail] for kind in CABLE]
        rig.what = f"rail friction {friction + more:.2f} N to the right, {friction - more:.2f} N to the left"
    for held_out in (False, False, True):
        rig.plan(held_out, 20.0, smooth(begun(sines(rng, 6, (0.08, 0.5), 0.06, 0.4), 1.0)), [0, 0, 0, 0])
    return rig
