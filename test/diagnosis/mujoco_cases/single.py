# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Plants of one degree of freedom: a link under gravity, driven or free, and a cart on a rail."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .engine import Job, passive
from .plants import Hidden, Plant, Sensor, Site, Values, accelerometer, between, drive_attributes, encoder, extra, gyro, pick, subset

G = 9.81  # m/s^2
POINT = 0.3  # share of the inertia of a link that its point mass has


def link_job(
    names: tuple[str, str, str], file: tuple[float, float], tip: float, sensors: tuple[Sensor, ...], driven: bool
) -> Callable[[Values, Hidden], Job]:
    """MuJoCo's model of a link. `names`: of inertia, weight, damping; `file`: inertia and weight by the model file; `tip`: radius, m."""
    inertia, weight, damping = names
    arm = POINT * file[0] * G / file[1]

    def job(p: Values, h: Hidden) -> Job:
        at, mass = h.at("pivot"), p[weight] / (G * arm)
        own, armature = extra(p[inertia] - mass * arm**2, (1 - POINT) * file[0])
        attributes = passive((0, 0, at.cubic), (p[damping], at.quadratic), at.friction, at.stop, p[inertia])
        world = (
            f'<body><inertial pos="0 0 {-arm:.15g}" mass="{mass:.15g}" diaginertia="{own:.15g} {own:.15g} {own:.15g}"/>'
            f'<joint name="q" type="hinge" axis="0 -1 0" armature="{armature:.15g}" {attributes}/>'
            f'<site name="tip" pos="0 0 {-tip:.15g}"/></body>'
        )
        act = f'<general name="drive" joint="q" {drive_attributes(h)}/>' if driven else ""
        return Job(world, "", act, "".join(s.element for s in sensors), G, h.friction, h.load)

    return job


def link_sensors(rng: np.random.Generator, angle: str, rate: str, driven: bool) -> tuple[Sensor, ...]:
    """Encoder, and by chance a gyro and, on a driven link, an accelerometer along the path of its tip."""
    tip = [accelerometer(rng, pick(rng, "acc_t", "a_tip"), f"r_a*der({rate}) + g*sin({angle})", "tip", 0)]
    return subset(
        rng,
        encoder(rng, pick(rng, "enc", "angle", "q_meas"), angle, '<jointpos joint="q"/>'),
        gyro(rng, pick(rng, "gyro", "rate_z"), rate, '<jointvel joint="q"/>'),
        *tip * driven,
    )


def gravity_link(rng: np.random.Generator, driven: bool) -> Plant:
    """A link on a hinge under gravity: with a torque drive, or free to swing."""
    j = between(rng, 0.02, 1.0)
    w = 2 * np.pi * rng.uniform(0.6, 1.4)
    k, d = j * w * w, 2 * (rng.uniform(0.1, 0.4) if driven else rng.uniform(0.008, 0.025)) * j * w
    inertia, weight, damping = pick(rng, "J_arm", "I_zz", "theta_g"), pick(rng, "W", "mgl", "G_arm"), pick(rng, "b", "d_visc", "c_lager")
    v = {inertia: (j, "kg*m^2"), weight: (k, "N*m"), damping: (float(d), "N*m*s/rad")}
    body, angle, rate = pick(rng, "arm", "link", "hebel"), pick(rng, "phi", "alpha", "q"), pick(rng, "omega", "dphi", "w")
    held, drag, motor = pick(rng, "gravity", "weight"), pick(rng, "bearing", "drag"), pick(rng, "motor", "servo", "drive")
    command = pick(rng, "tau", "M_soll", "T_cmd")
    tip = round(float(rng.uniform(0.1, 0.4)), 3)
    sensors = link_sensors(rng, angle, rate, driven)
    known: tuple[str, ...] = () if driven else (inertia,)
    if any(s.what == "acceleration" for s in sensors):
        v |= {"r_a": (tip, "m"), "g": (G, "m/s^2")}
        known = (*known, "r_a", "g")
    elements = (
        f'{held} = {{ between = ["{body}", "ground"], law = "expression", force = "{weight}*sin({angle})" }}',
        f'{drag} = {{ between = ["{body}", "ground"], law = "linear_damper", damping = "{damping}" }}',
        f'{motor} = {{ between = ["{body}", "ground"], law = "expression", force = "-{command}" }}',
    )
    return Plant(
        "joint" if driven else "pendulum",
        v,
        known,
        {"pivot": Site((held, drag, body, *[motor] * driven), "joint:q", "", damping)},
        (f'{body} = {{ inertia = "{inertia}", position = "{angle}", velocity = "{rate}" }}',),
        elements if driven else elements[:2],
        sensors,
        link_job((inertia, weight, damping), (j, k), tip, sensors, driven),
        (command, "N*m") if driven else ("", ""),
        motor if driven else "",
        float(rng.uniform(0.3, 0.5)),
        (0.15, 1.8),
        lambda x, dx, ddx: j * ddx + d * dx + k * np.sin(x),
        j,
    )


def joint(rng: np.random.Generator) -> Plant:
    """A link with gravity and a torque drive."""
    return gravity_link(rng, True)


def pendulum(rng: np.random.Generator) -> Plant:
    """A link that swings freely. It shows ratios to its inertia, which is therefore exact."""
    return gravity_link(rng, False)


def cart_job(names: tuple[str, str, str], file: float, sensors: tuple[Sensor, ...]) -> Callable[[Values, Hidden], Job]:
    """MuJoCo's model of a cart. `names`: of mass, damping, and stiffness or nothing; `file`: mass by the model file."""
    mass, damping, stiffness = names

    def job(p: Values, h: Hidden) -> Job:
        at, (own, armature) = h.at("rail"), extra(p[mass], file)
        spring = p[stiffness] if stiffness else 0.0
        attributes = passive((spring, 0, at.cubic), (p[damping], at.quadratic), at.friction, at.stop, p[mass])
        world = (
            f'<body><inertial pos="0 0 0" mass="{own:.15g}" diaginertia="1 1 1"/>'
            f'<joint name="q" type="slide" axis="1 0 0" armature="{armature:.15g}" {attributes}/><site name="top"/></body>'
        )
        act = f'<general name="drive" joint="q" {drive_attributes(h)}/>'
        return Job(world, "", act, "".join(s.element for s in sensors), 0.0, h.friction, h.load)

    return job


def slider(rng: np.random.Generator) -> Plant:
    """A cart on a rail, pushed by a force; half of them are tied to a spring."""
    m, tied = between(rng, 1.0, 20.0), bool(rng.random() < 0.5)
    d, k = float(m * rng.uniform(0.6, 2.5)), m * (2 * np.pi * rng.uniform(0.6, 1.5)) ** 2 * tied
    mass, damping, stiffness = pick(rng, "m_cart", "M", "m_s"), pick(rng, "d_rail", "b", "c_v"), pick(rng, "k_ret", "c_f") * tied
    v = {mass: (m, "kg"), damping: (d, "N*s/m")} | ({stiffness: (float(k), "N/m")} if tied else {})
    body, x, dx = pick(rng, "cart", "sled", "wagen"), pick(rng, "x", "s", "pos_c"), pick(rng, "v", "xd", "speed")
    rail, back, motor = pick(rng, "rail", "guide"), pick(rng, "return_spring", "feder"), pick(rng, "belt", "linear_motor", "coil")
    command = pick(rng, "F", "F_cmd", "kraft")
    count = float(rng.choice([1e-4, 2e-4, 5e-4]))
    sensors = subset(
        rng,
        Sensor(pick(rng, "scale_x", "pos", "linear_enc"), "m", x, '<jointpos joint="q"/>', "position", count, 0.5 * count),
        Sensor(pick(rng, "v_meas", "tacho"), "m/s", dx, '<jointvel joint="q"/>', "rate", 0.0, between(rng, 0.002, 0.01)),
        accelerometer(rng, pick(rng, "acc", "a_x"), f"der({dx})", "top", 0),
    )
    elements = (
        f'{rail} = {{ between = ["{body}", "ground"], law = "linear_damper", damping = "{damping}" }}',
        f'{motor} = {{ between = ["{body}", "ground"], law = "expression", force = "-{command}" }}',
        f'{back} = {{ between = ["{body}", "ground"], law = "linear_spring", stiffness = "{stiffness}" }}',
    )
    return Plant(
        "slider",
        v,
        (),
        {"rail": Site((rail, *[back] * tied, motor, body), "joint:q", stiffness, damping)},
        (f'{body} = {{ mass = "{mass}", position = "{x}", velocity = "{dx}" }}',),
        elements if tied else elements[:2],
        sensors,
        cart_job((mass, damping, stiffness), m, sensors),
        (command, "N"),
        motor,
        float(rng.uniform(0.06, 0.15)),
        (0.1, 1.5),
        lambda x, dx, ddx: m * ddx + d * dx + k * x,
        m,
        tied,
    )


MAKERS = {"joint": joint, "slider": slider, "pendulum": pendulum}
