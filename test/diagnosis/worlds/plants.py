# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Six kinds of plant: their physics for the solver, and their model file in the model language."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .solver import Law, Plant


@dataclass(frozen=True)
class Site:
    """A place of forces: elements that act there, spring and damper parameters, coordinate if its other end is ground, input if a road."""

    elements: tuple[str, ...]
    spring: str = ""
    damper: str = ""
    coordinate: int = -1
    road: int = -1


@dataclass(frozen=True)
class Kind:
    """A plant: parameters with units, coordinates with their inertia, inputs, sites with coefficients of coordinates and inputs, sensors.

    `gain[i][k]`: force of input k on coordinate i. Sensors: unit and coefficients of accelerations, deflections of a site or coordinates.
    """

    name: str
    values: Mapping[str, tuple[float, str]]
    masses: tuple[tuple[str, str], ...]  # body, parameter
    turning: tuple[str, ...]
    inputs: Mapping[str, str]
    sites: Mapping[str, tuple[Site, tuple[float, ...]]]
    gain: tuple[tuple[float, ...], ...]
    points: Mapping[str, str]
    ends: Mapping[str, tuple[str, str]]
    sensors: Mapping[str, tuple[str, str, str, tuple[float, ...]]]  # name: (expression, unit, "q" or "ddq", coefficients)
    exact: tuple[str, ...] = ()
    sine: str = ""  # site whose spring acts by the sine

    def plant(self, p: Mapping[str, float]) -> Plant:
        """The plant with these parameters, nominal laws only."""
        n, nu = len(self.masses), len(self.inputs)
        laws = []
        for name, (site, _) in self.sites.items():
            if site.spring or site.damper:
                k, d = (p[x] if x else 0.0 for x in (site.spring, site.damper))
                laws.append(Law(name, "sine" if name == self.sine else "linear", [k, d]))
        gains = np.array(self.gain, float).reshape(n, nu)
        return Plant([p[m] for _, m in self.masses], list(self.inputs), {k: list(row) for k, (_, row) in self.sites.items()}, gains, laws)

    def drive(self) -> int:
        """Index of the input that is a force, -1 without one."""
        return next((k for k in range(len(self.inputs)) if any(g[k] for g in self.gain)), -1)


def quarter(rng: np.random.Generator) -> Kind:
    """A quarter vehicle of 220 to 700 kg on a road."""
    m = float(rng.uniform(220, 700))
    c = m * (2 * np.pi * rng.uniform(1.0, 1.6)) ** 2
    v = {
        "m_b": (m, "kg"),
        "m_w": (m * rng.uniform(0.09, 0.15), "kg"),
        "c": (c, "N/m"),
        "d": (2 * rng.uniform(0.2, 0.4) * np.sqrt(c * m), "N*s/m"),
        "c_t": (c * rng.uniform(7, 11), "N/m"),
    }
    sites = {
        "suspension": (Site(("spring", "damper"), "c", "d"), (1.0, -1.0, 0.0)),
        "tyre": (Site(("tyre",), "c_t", road=0), (0.0, 1.0, -1.0)),
        "body": (Site(("body",), coordinate=0), (1.0, 0.0, 0.0)),
    }
    sensors = {
        "a_body": ("der(v_body)", "m/s^2", "ddq", (1.0, 0.0)),
        "a_wheel": ("der(v_wheel)", "m/s^2", "ddq", (0.0, 1.0)),
        "deflection": ("z_body - z_wheel", "m", "q", (1.0, -1.0)),
    }
    ends = {"suspension": ("body", "wheel"), "tyre": ("wheel", "z_road")}
    return Kind("quarter", v, (("body", "m_b"), ("wheel", "m_w")), (), {"z_road": "m"}, sites, ((0.0,), (0.0,)), {}, ends, sensors)


def one_mass(rng: np.random.Generator) -> Kind:
    """A mass on a spring and a damper, pushed by a measured force."""
    m = float(10 ** rng.uniform(0.3, 2.3))
    w = 2 * np.pi * rng.uniform(1.5, 4.0)
    v = {"m": (m, "kg"), "k": (m * w * w, "N/m"), "d": (2 * rng.uniform(0.12, 0.4) * m * w, "N*s/m")}
    sites = {"mount": (Site(("spring", "damper", "mass"), "k", "d", 0), (1.0, 0.0))}
    sensors = {"x_mass": ("z_mass", "m", "q", (1.0,)), "a_mass": ("der(v_mass)", "m/s^2", "ddq", (1.0,))}
    return Kind("rig", v, (("mass", "m"),), (), {"push": "N"}, sites, ((1.0,),), {}, {"mount": ("mass", "ground")}, sensors)


def swing(rng: np.random.Generator) -> Kind:
    """A free swing: torsion spring, or gravity by the sine."""
    inertia = float(10 ** rng.uniform(-2, 0))
    w = 2 * np.pi * rng.uniform(0.7, 1.8)
    v = {"J": (inertia, "kg*m^2"), "k": (inertia * w * w, "N*m/rad"), "d": (2 * rng.uniform(0.01, 0.03) * inertia * w, "N*m*s/rad")}
    sites = {"pivot": (Site(("spring", "damper", "arm"), "k", "d", 0), (1.0,))}
    sine = "pivot" if rng.random() < 0.5 else ""
    sensors = {"angle": ("phi_arm", "rad", "q", (1.0,))}
    return Kind("swing", v, (("arm", "J"),), ("arm",), {}, sites, ((),), {}, {"pivot": ("arm", "ground")}, sensors, ("J",), sine)


def joint(rng: np.random.Generator) -> Kind:
    """A motor-driven joint, held by gravity."""
    inertia = float(10 ** rng.uniform(-2, 0))
    w = 2 * np.pi * rng.uniform(0.6, 1.5)
    v = {"J": (inertia, "kg*m^2"), "k": (inertia * w * w, "N*m/rad"), "d": (2 * rng.uniform(0.2, 0.6) * inertia * w, "N*m*s/rad")}
    sites = {"bearing": (Site(("gravity", "drag", "link"), "k", "d", 0), (1.0, 0.0))}
    sensors = {"q": ("phi_link", "rad", "q", (1.0,))}
    return Kind("joint", v, (("link", "J"),), ("link",), {"tau": "N*m"}, sites, ((1.0,),), {}, {"bearing": ("link", "ground")}, sensors)


def drive(rng: np.random.Generator) -> Kind:
    """Motor, elastic shaft, load; angles of both."""
    jm, jl = 0.02 * rng.uniform(0.6, 1.6), 0.1 * rng.uniform(0.6, 1.6)
    k = (2 * np.pi * rng.uniform(6, 11)) ** 2 * jm * jl / (jm + jl)
    v = {
        "J_m": (jm, "kg*m^2"),
        "J_l": (jl, "kg*m^2"),
        "k": (k, "N*m/rad"),
        "d": (0.03 * np.sqrt(k * jm) * rng.uniform(2, 5), "N*m*s/rad"),
        "d_m": (jm * rng.uniform(1, 3), "N*m*s/rad"),
        "d_l": (jl * rng.uniform(2, 6), "N*m*s/rad"),
    }
    sites = {
        "shaft": (Site(("shaft", "shaft_damper"), "k", "d"), (1.0, -1.0, 0.0)),
        "motor": (Site(("rotor", "motor"), "", "d_m", 0), (1.0, 0.0, 0.0)),
        "load": (Site(("bearing", "load"), "", "d_l", 1), (0.0, 1.0, 0.0)),
    }
    sensors = {"angle_motor": ("phi_motor", "rad", "q", (1.0, 0.0)), "angle_load": ("phi_load", "rad", "q", (0.0, 1.0))}
    ends = {"shaft": ("motor", "load"), "motor": ("motor", "ground"), "load": ("load", "ground")}
    return Kind(
        "drive", v, (("motor", "J_m"), ("load", "J_l")), ("motor", "load"), {"tau": "N*m"}, sites, ((1.0,), (0.0,)), {}, ends, sensors
    )


def halfcar(rng: np.random.Generator) -> Kind:
    """A half-car that heaves and pitches on two axles."""
    m = float(rng.uniform(450, 800))
    a, b = float(rng.uniform(1.1, 1.3)), float(rng.uniform(1.3, 1.5))
    v = {"m_b": (m, "kg"), "J": (m * a * b * rng.uniform(0.85, 1.0), "kg*m^2"), "a": (a, "m"), "b": (b, "m")}
    sites = {}
    for x, share in (("f", b / (a + b)), ("r", a / (a + b))):
        c = share * m * (2 * np.pi * rng.uniform(1.1, 1.5)) ** 2
        v |= {
            f"m_{x}": (share * m * 0.13, "kg"),
            f"c_{x}": (c, "N/m"),
            f"d_{x}": (2 * rng.uniform(0.2, 0.35) * np.sqrt(c * share * m), "N*s/m"),
            f"t_{x}": (9 * c, "N/m"),
        }
    sites["front"] = (Site(("spring_f", "damper_f"), "c_f", "d_f"), (1.0, -a, -1.0, 0.0, 0.0, 0.0))
    sites["rear"] = (Site(("spring_r", "damper_r"), "c_r", "d_r"), (1.0, b, 0.0, -1.0, 0.0, 0.0))
    sites["tyre_f"] = (Site(("tyre_f",), "t_f", road=0), (0.0, 0.0, 1.0, 0.0, -1.0, 0.0))
    sites["tyre_r"] = (Site(("tyre_r",), "t_r", road=1), (0.0, 0.0, 0.0, 1.0, 0.0, -1.0))
    sites["heave"] = (Site(("heave",), coordinate=0), (1.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    sites["pitch"] = (Site(("pitch",), coordinate=1), (0.0, 1.0, 0.0, 0.0, 0.0, 0.0))
    sensors = {
        "a_front": ("der(v_heave) - a*der(omega_pitch)", "m/s^2", "ddq", (1.0, -a, 0.0, 0.0)),
        "a_rear": ("der(v_heave) + b*der(omega_pitch)", "m/s^2", "ddq", (1.0, b, 0.0, 0.0)),
        "a_wheel_f": ("der(v_wheel_f)", "m/s^2", "ddq", (0.0, 0.0, 1.0, 0.0)),
        "a_wheel_r": ("der(v_wheel_r)", "m/s^2", "ddq", (0.0, 0.0, 0.0, 1.0)),
        "s_front": ("front - z_wheel_f", "m", "q", (1.0, -a, -1.0, 0.0)),
        "s_rear": ("rear - z_wheel_r", "m", "q", (1.0, b, 0.0, -1.0)),
    }
    ends = {"front": ("front", "wheel_f"), "rear": ("rear", "wheel_r"), "tyre_f": ("wheel_f", "road_f"), "tyre_r": ("wheel_r", "road_r")}
    points = {"front": "z_heave - a*phi_pitch", "rear": "z_heave + b*phi_pitch"}
    masses = (("heave", "m_b"), ("pitch", "J"), ("wheel_f", "m_f"), ("wheel_r", "m_r"))
    none = ((0.0, 0.0),) * 4
    return Kind("halfcar", v, masses, ("pitch",), {"road_f": "m", "road_r": "m"}, sites, none, points, ends, sensors, ("a", "b"))


MAKERS = {"quarter": quarter, "rig": one_mass, "swing": swing, "joint": joint, "drive": drive, "halfcar": halfcar}


def model_text(kind: Kind, tolerance: float | None, noise: Mapping[str, float], sample: float) -> str:
    """The model file; without `tolerance` no parameter states one."""
    lines = [f'[model]\nname = "{kind.name}"\nsample_time = "{sample * 1e3:g} ms"\n\n[parameters]']
    for name, (value, unit) in kind.values.items():
        sure = ", exact = true" if name in kind.exact else f", tolerance = {tolerance:g}" if tolerance else ""
        lines.append(f'{name} = {{ value = {value:.12g}, unit = "{unit}"{sure} }}')
    if kind.inputs:
        lines += ["\n[inputs]", *(f'{k} = {{ unit = "{unit}" }}' for k, unit in kind.inputs.items())]
    lines.append("\n[bodies]")
    for name, mass in kind.masses:
        what, pos, rate = ("inertia", "phi", "omega") if name in kind.turning else ("mass", "z", "v")
        lines.append(f'{name} = {{ {what} = "{mass}", position = "{pos}_{name}", velocity = "{rate}_{name}" }}')
    if kind.points:
        lines += ["\n[points]", *(f'{k} = "{x}"' for k, x in kind.points.items())]
    lines.append("\n[elements]")
    for name, (site, _) in kind.sites.items():
        rest = list(site.elements)
        if site.spring:
            between = f'between = ["{kind.ends[name][0]}", "{kind.ends[name][1]}"]'
            body = (
                f'law = "expression", force = "{site.spring}*sin(phi_{kind.ends[name][0]})"'
                if name == kind.sine
                else f'law = "linear_spring", stiffness = "{site.spring}"'
            )
            lines.append(f"{rest.pop(0)} = {{ {between}, {body} }}")
        if site.damper:
            lines.append(
                f'{rest[0]} = {{ between = ["{kind.ends[name][0]}", "{kind.ends[name][1]}"], '
                f'law = "linear_damper", damping = "{site.damper}" }}'
            )
    if (k := kind.drive()) >= 0:
        lines.append(f'actuator = {{ between = ["{kind.masses[0][0]}", "ground"], law = "expression", force = "-{list(kind.inputs)[k]}" }}')
    first, (expression, unit, _, _) = next(iter(kind.sensors.items()))
    lines.append(f'\n[outputs]\nout_{first} = {{ value = "{expression}", unit = "{unit}" }}\n\n[sensors]')
    lines += [f'{k} = {{ value = "{x}", unit = "{unit}", noise = {noise[k]:.3g} }}' for k, (x, unit, _, _) in kind.sensors.items()]
    return "\n".join(lines) + "\n"
