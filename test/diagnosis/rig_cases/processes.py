# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Two rigs that are described by equations instead of bodies: coupled tanks, and a heated block on a carrier."""

from __future__ import annotations

import numpy as np

from .rig import Input, Parameter, Rig, sensor
from .signals import averaged, in_turn, sines, smooth, stairs
from .solver import Array

TANKS = """# Two coupled tanks, @LAW.
[model]
name = "tanks"
sample_time = "@SAMPLE"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[states]
h1 = { unit = "m", start = 0.3 }
h2 = { unit = "m", start = 0.2 }

[equations]
first = "der(h1)*A1 = pump - c12*(h1 - h2)"
second = "der(h2)*A2 = c12*(h1 - h2) - @OUTFLOW"

[outputs]
out = { value = "h2", unit = "m" }

[sensors]
@SENSORS
"""
THERMAL = """# Heated block on a carrier: two heat capacities, three conductances.
[model]
name = "thermal"
sample_time = "@SAMPLE"

[parameters]
@PARAMETERS

[inputs]
@INPUTS

[states]
T1 = { unit = "K", start = 295 }
T2 = { unit = "K", start = 295 }

[equations]
block = "der(T1)*C1 = heater - G12*(T1 - T2) - G1*(T1 - T_air)"
carrier = "der(T2)*C2 = G12*(T1 - T2) - G2*(T2 - T_air)"

[outputs]
T = { value = "T1", unit = "K" }

[sensors]
@SENSORS
"""
LEVEL, FLOW = 0.25, 1e-4  # m and m^3/s of the usual operation
PER_MINUTE = 1 / 6e4  # m^3/s of one l/min


def outflow(linear: bool) -> tuple[str, list[Parameter]]:
    """The text of a model file whose outflow is linear in the level or follows Torricelli's law, and the parameters of it."""
    if linear:
        text = TANKS.replace("@LAW", "the outflow linear in the level").replace("@OUTFLOW", "co*h2")
        return text, [Parameter("co", round(FLOW / LEVEL, 6), "m^2/s", 0.1)]
    text = TANKS.replace("@LAW", "the outflow by Torricelli").replace("@OUTFLOW", "co*h_ref*sqrt(h2/h_ref)")
    value = float(f"{FLOW / np.sqrt(LEVEL):.3g}")
    return text, [Parameter("co", value, "m^2/s", 0.08), Parameter("h_ref", 1.0, "m", exact=True)]


def tanks(rng: np.random.Generator, variant: int, null: bool, size: float) -> Rig:
    """Hidden: an outflow by Torricelli in a linear model, or a wrong coefficient. Small: a connection that is not quite linear."""
    linear = variant == 0
    text, law = outflow(linear)
    rig = Rig(
        *("tanks", "tanks", 1.0, 4),
        order=["A1", "A2", "c12", "co", "root", "bend"],
        parameters=[Parameter("A1", 0.0154, "m^2", 0.02), Parameter("A2", 0.0154, "m^2", 0.02), Parameter("c12", 8e-4, "m^2/s", 0.1), *law],
        absent={"root": 0.0 if linear else 1.0, "bend": 0.0},
        model=text,
        sensors=[sensor(rng, "level1", "h1", "mm", 0.7, 0.5, 0.003), sensor(rng, "level2", "h2", "mm", 0.7, 0.5, 0.003)],
        inputs=[Input("pump", "l/min", lambda _, u: u[:, 0], 0.01, 0.01, si=PER_MINUTE)],
        shown=lambda x, _: {"level1": 1e3 * x[:, 0], "level2": 1e3 * x[:, 1]},
        null=null,
        start=lambda y, _: [float(np.mean(y[s][:5])) / 1e3 for s in ("level1", "level2")],
        scatter=(2e-3, 2e-3),
    ).settle(rng)
    if not null:
        hide_in_tanks(rig, rng, linear, size)
    for held_out in (False, False, True):
        steps = in_turn(0.0, (stairs(rng, 2400.0, (80, 350), 0.8e-4, 0.95e-4),), (), (0.1e-4, 2e-4))

        def flow(t: Array, steps=steps) -> Array:
            return np.where(t < 24, FLOW, steps(t))

        rig.plan(held_out, 2400.0, smooth(averaged(flow, 6, 13)), [rng.uniform(0.25, 0.45), rng.uniform(0.12, 0.3)], free=True)
    return rig


def hide_in_tanks(rig: Rig, rng: np.random.Generator, linear: bool, size: float) -> None:
    """Adds what the model file lacks."""
    rig.true["bend"] = rng.uniform(-0.1, 0.1)
    if linear:
        rig.true |= {"root": 1.0, "co": FLOW / np.sqrt(LEVEL) * rng.uniform(0.95, 1.05)}
        rig.law, rig.hidden = {"root": 1.0}, {"co": FLOW / np.sqrt(LEVEL)}
        rig.accepted, rig.verdicts = [[["outside_taxonomy", "*"]]], ["unexplained", "partly_explained"]
        rig.what = "the outflow goes with the root of the level, the model is linear"
    else:
        factor = 1 - min(0.25 * size, 0.5) if rng.random() < 0.5 else 1 + 0.3 * size
        rig.true["co"] = rig.nominal()["co"] * factor
        rig.wide, rig.accepted = {"co"}, [[["wrong_parameter", "co"]]]
        rig.what = f"the outflow coefficient is {factor:.2f} times the stated one"


def thermal(rng: np.random.Generator, variant: int, null: bool, size: float) -> Rig:
    """Hidden: a wrong conductance and a bias of a sensor. Small: loss that grows faster than the temperature."""
    rig = Rig(
        *("thermal", "thermal", 5.0, 5),
        order=["C1", "C2", "G12", "G1", "G2", "bend"],
        parameters=[
            Parameter("C1", 320.0, "J/K", 0.05),
            Parameter("C2", 850.0, "J/K", 0.05),
            Parameter("G12", 2.2, "W/K", 0.08),
            Parameter("G1", 0.35, "W/K", 0.15),
            Parameter("G2", 0.8, "W/K", 0.08),
        ],
        absent={"bend": 0.0},
        model=THERMAL,
        sensors=[sensor(rng, "T_block", "T1", "K", 0.08, 0.05), sensor(rng, "T_carrier", "T2", "K", 0.08, 0.05)],
        inputs=[Input("heater", "W", lambda _, u: u[:, 0], step=0.05), Input("T_air", "K", lambda _, u: u[:, 1], 0.05, 0.05)],
        shown=lambda x, _: {"T_block": x[:, 0], "T_carrier": x[:, 1]},
        null=null,
        start=lambda y, _: [float(np.mean(y[s][:6])) for s in ("T_block", "T_carrier")],
        scatter=(0.2, 0.2),
    ).settle(rng)
    if not null:
        hide_in_thermal(rig, rng, ("G12", "G2")[variant], size)
    for held_out in (False, False, True):
        steps = averaged(stairs(rng, 6000.0, (200, 900), 22.0, 25.0), 10, 11)
        change = sines(rng, 3, (1e-4, 1e-3), 0.5)
        mean = rng.uniform(293, 297)

        def air(t: Array, change=change, mean=mean) -> Array:
            return mean + change(t)

        first = float(air(np.zeros(1))[0])
        rig.plan(held_out, 6000.0, smooth(in_turn(30.0, (steps,), (), (0.0, 50.0)), air), [first, first], free=True)
    return rig


def hide_in_thermal(rig: Rig, rng: np.random.Generator, conductance: str, size: float) -> None:
    """Adds what the model file lacks."""
    factor = 1 - min(0.3 * size, 0.6) if rng.random() < 0.5 else 1 + 0.35 * size
    rig.true |= {conductance: rig.nominal()[conductance] * factor, "bend": rng.uniform(0, 0.0003)}
    bias = rng.uniform(0.7, 1.2) * rng.choice([-1, 1])
    rig.sensors[1].bias = bias
    rig.wide, rig.hidden, rig.linear = {conductance}, {"offset_T_carrier": 1.0}, {"offset_T_carrier"}
    wrong = ["wrong_parameter", conductance]
    rig.accepted = [[wrong, ["sensor_bias", "T_carrier"]], [wrong]]
    rig.what = f"conductance {conductance} is {factor:.2f} times the stated one, T_carrier reads {bias:+.2f} K"
