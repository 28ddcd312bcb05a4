# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Plants of two degrees of freedom: motor, shaft and load; a quarter car on a road."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from .engine import Job, passive
from .plants import Hidden, Plant, Sensor, Site, Values, accelerometer, between, drive_attributes, encoder, extra, gyro, pick, subset


def shaft_job(names: Sequence[str], file: tuple[float, float], sensors: tuple[Sensor, ...]) -> Callable[[Values, Hidden], Job]:
    """MuJoCo's model of two hinges and a tendon. `names`: inertias, stiffness and damping of the shaft, dampings; `file`: the inertias."""
    m, load, shaft, loss, dm, dl = names

    def job(p: Values, h: Hidden) -> Job:
        def turning(name: str, inertia: float, own_file: float, damping: float, site: str) -> str:
            at, (own, armature) = h.at(site), extra(inertia, own_file)
            attributes = passive((0,), (damping, at.quadratic), at.friction, at.stop, inertia)
            return (
                f'<body><inertial pos="0 0 0" mass="1" diaginertia="{own:.15g} {own:.15g} {own:.15g}"/>'
                f'<joint name="{name}" type="hinge" axis="0 0 1" armature="{armature:.15g}" {attributes}/></body>'
            )

        at, slack = h.at("shaft"), h.at("shaft").slack / 2
        attributes = passive((p[shaft], 0, at.cubic), (p[loss], at.quadratic), at.friction, at.stop, 1 / (1 / p[m] + 1 / p[load]))
        tendon = (
            f'<fixed name="t" springlength="{-slack:.15g} {slack:.15g}" {attributes}>'
            '<joint joint="m" coef="1"/><joint joint="l" coef="-1"/></fixed>'
        )
        act = f'<general name="drive" joint="m" {drive_attributes(h)}/>'
        world = turning("m", p[m], file[0], p[dm], "motor") + turning("l", p[load], file[1], p[dl], "load")
        return Job(world, tendon, act, "".join(s.element for s in sensors), 0.0, h.friction, h.load)

    return job


def two_masses(rng: np.random.Generator) -> Plant:
    """Motor, elastic shaft, load."""
    jm, jl = 0.02 * between(rng, 0.6, 1.6), 0.1 * between(rng, 0.6, 1.6)
    k = (2 * np.pi * rng.uniform(5, 10)) ** 2 * jm * jl / (jm + jl)
    m, load, shaft = pick(rng, "J_m", "J_mot", "I_1"), pick(rng, "J_l", "J_tbl", "I_2"), pick(rng, "k_s", "c_shaft", "K_t")
    loss, dm, dl = pick(rng, "d_s", "b_shaft"), pick(rng, "d_m", "b_1"), pick(rng, "d_l", "b_2")
    v = {
        m: (jm, "kg*m^2"),
        load: (jl, "kg*m^2"),
        shaft: (k, "N*m/rad"),
        loss: (float(0.03 * np.sqrt(k * jm) * rng.uniform(2, 5)), "N*m*s/rad"),
        dm: (jm * rng.uniform(1, 3), "N*m*s/rad"),
        dl: (jl * rng.uniform(1, 4), "N*m*s/rad"),
    }
    one, two = pick(rng, "rotor", "motor"), pick(rng, "table", "load", "tisch")
    spring, damper = pick(rng, "shaft", "coupling"), pick(rng, "shaft_loss", "coupling_damping")
    first, second, feed = pick(rng, "bearing_m", "lager_1"), pick(rng, "bearing_l", "lager_2"), pick(rng, "airgap", "inverter")
    command = pick(rng, "tau_m", "T_soll")
    sensors = subset(
        rng,
        encoder(rng, pick(rng, "enc_m", "theta_1"), f"phi_{one}", '<jointpos joint="m"/>'),
        gyro(rng, pick(rng, "w_m", "rate_1"), f"omega_{one}", '<jointvel joint="m"/>'),
    )
    sensors = (*sensors, encoder(rng, pick(rng, "enc_l", "theta_2"), f"phi_{two}", '<jointpos joint="l"/>', (11, 13)))
    elements = (
        f'{spring} = {{ between = ["{one}", "{two}"], law = "linear_spring", stiffness = "{shaft}" }}',
        f'{damper} = {{ between = ["{one}", "{two}"], law = "linear_damper", damping = "{loss}" }}',
        f'{first} = {{ between = ["{one}", "ground"], law = "linear_damper", damping = "{dm}" }}',
        f'{second} = {{ between = ["{two}", "ground"], law = "linear_damper", damping = "{dl}" }}',
        f'{feed} = {{ between = ["{one}", "ground"], law = "expression", force = "-{command}" }}',
    )
    sites = {
        "shaft": Site((spring, damper), "tendon:t", shaft, loss),
        "load": Site((second, two), "joint:l", "", dl),
        "motor": Site((first, feed, one), "joint:m", "", dm),
    }
    return Plant(
        "drive",
        v,
        (),
        sites,
        tuple(f'{b} = {{ inertia = "{x}", position = "phi_{b}", velocity = "omega_{b}" }}' for b, x in ((one, m), (two, load))),
        elements,
        sensors,
        shaft_job((m, load, shaft, loss, dm, dl), (jm, jl), sensors),
        (command, "N*m"),
        feed,
        float(rng.uniform(0.5, 1.2)),
        (0.2, 3.0),
        lambda x, dx, ddx: (jm + jl) * ddx + (v[dm][0] + v[dl][0]) * dx,
        jm + jl,
        False,
    )


def car_job(names: Sequence[str], file: tuple[float, float], sensors: tuple[Sensor, ...]) -> Callable[[Values, Hidden], Job]:
    """
    MuJoCo's model of a quarter car: the strut is a tendon between two slides, the tyre an actuator whose command is the road, its damping a
    second one whose command is the rate of the road. `names`: masses of body and wheel, strut, its damping, tyre; `file`: the masses.
    """
    body, wheel, stiffness, damping, tyre = names

    def job(p: Values, h: Hidden) -> Job:
        def moving(name: str, mass: float, own_file: float) -> str:
            own, armature = extra(mass, own_file)
            return (
                f'<body><inertial pos="0 0 0" mass="{own:.15g}" diaginertia="1 1 1"/>'
                f'<joint name="{name}" type="slide" axis="0 0 1" armature="{armature:.15g}"/><site name="{name}"/></body>'
            )

        at = h.at("strut")
        inertia = 1 / (1 / p[body] + 1 / p[wheel])
        attributes = passive((p[stiffness], 0, at.cubic), (p[damping], at.quadratic), at.friction, at.stop, inertia)
        tendon = f'<fixed name="t" springlength="0" {attributes}><joint joint="b" coef="1"/><joint joint="w" coef="-1"/></fixed>'
        k, d = p[tyre], h.tyre_damping
        act = f'<general name="tyre" joint="w" gainprm="{k:.15g}" biastype="affine" biasprm="0 {-k:.15g} 0"/>'
        if d:
            act += f'<general name="tyre_damping" joint="w" gainprm="{d:.15g}" biastype="affine" biasprm="0 0 {-d:.15g}"/>'
        world = moving("b", p[body], file[0]) + moving("w", p[wheel], file[1])
        return Job(world, tendon, act, "".join(s.element for s in sensors), 0.0, h.friction, h.load)

    return job


def quarter(rng: np.random.Generator) -> Plant:
    """A quarter car on a road that is measured."""
    mb = float(rng.uniform(220, 600))
    mw = mb * float(rng.uniform(0.1, 0.16))
    c = mb * (2 * np.pi * rng.uniform(1.0, 1.6)) ** 2
    body_mass, wheel_mass = pick(rng, "m_s", "M_A", "m_body"), pick(rng, "m_u", "M_R", "m_wheel")
    stiffness, damping, rate = pick(rng, "c_A", "k_s", "k_susp"), pick(rng, "d_A", "b_s"), pick(rng, "c_R", "k_t")
    v = {
        body_mass: (mb, "kg"),
        wheel_mass: (mw, "kg"),
        stiffness: (c, "N/m"),
        damping: (float(2 * rng.uniform(0.2, 0.4) * np.sqrt(c * mb)), "N*s/m"),
        rate: (c * rng.uniform(7, 11), "N/m"),
    }
    body, wheel, road = pick(rng, "body", "aufbau", "sprung"), pick(rng, "wheel", "rad", "unsprung"), pick(rng, "z_r", "road", "w")
    spring, damper, tyre = pick(rng, "spring", "coil"), pick(rng, "damper", "shock"), pick(rng, "tyre", "reifen")
    sensors = subset(
        rng,
        accelerometer(rng, pick(rng, "a_body", "acc_s"), f"der(v_{body})", "b", 2, 0.01),
        accelerometer(rng, pick(rng, "a_wheel", "acc_u"), f"der(v_{wheel})", "w", 2, 0.05),
    )
    stroke = Sensor(pick(rng, "defl", "stroke"), "m", f"z_{body} - z_{wheel}", '<tendonpos tendon="t"/>', "position", 5e-5, 1e-4)
    elements = (
        f'{spring} = {{ between = ["{body}", "{wheel}"], law = "linear_spring", stiffness = "{stiffness}" }}',
        f'{damper} = {{ between = ["{body}", "{wheel}"], law = "linear_damper", damping = "{damping}" }}',
        f'{tyre} = {{ between = ["{wheel}", "{road}"], law = "linear_spring", stiffness = "{rate}" }}',
    )
    return Plant(
        "quarter",
        v,
        (),
        {"strut": Site((spring, damper), "tendon:t", stiffness, damping), "tyre": Site((tyre,), "", rate)},
        tuple(f'{b} = {{ mass = "{x}", position = "z_{b}", velocity = "v_{b}" }}' for b, x in ((body, body_mass), (wheel, wheel_mass))),
        elements,
        (*sensors, stroke),
        car_job((body_mass, wheel_mass, stiffness, damping, rate), (mb, mw), (*sensors, stroke)),
        (road, "m"),
        "",
        0.006 * float(rng.uniform(0.8, 1.5)),
        (0.4, 20.0),
    )


MAKERS = {"drive": two_masses, "quarter": quarter}
