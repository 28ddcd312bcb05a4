# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The vehicles and rigs that are measured, what the model file says of them, and their sensors without any fault."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .solver import GROUND, MOTION, Kind, Law, Motion, World

GRAVITY = 9.81
UNITS = {"m_b": "kg", "m_w": "kg", "m": "kg", "c": "N/m", "d": "N*s/m", "c_t": "N/m"}
# role -> names that a model file may give it: whoever explains must read the file, not guess by names
NAMES = {
    "body": ("body", "chassis", "sprung"),
    "wheel": ("wheel", "axle", "unsprung"),
    "mass": ("mass", "sledge", "seat"),
    "spring": ("spring", "coil", "main_spring"),
    "damper": ("damper", "strut", "shock"),
    "tyre": ("tyre", "tyre", "tire_spring"),
    "drive": ("drive", "shaker", "actuator"),
    "road": ("z_road", "z_road", "road"),
    "force_in": ("force_in", "pull", "shaker_force"),
    "motion": ("x", "stroke", "rod"),
    "a_body": ("a_body", "a_body", "acc_body"),
    "a_wheel": ("a_wheel", "a_wheel", "acc_wheel"),
    "deflection": ("deflection", "deflection", "travel"),
    "z_body": ("z_body", "body_height"),
    "z_wheel": ("z_wheel", "wheel_height"),
    "a_mass": ("a_mass", "acc"),
    "z_mass": ("z_mass", "displacement"),
    "force": ("force", "load_cell"),
}
SIGNALS = {  # kind of plant -> signal -> (expression in the model file's names, unit, noise of usual sensors)
    "quarter": {
        "a_body": ("der(v_{body})", "m/s^2", (0.01, 0.05)),
        "a_wheel": ("der(v_{wheel})", "m/s^2", (0.05, 0.3)),
        "deflection": ("z_{body} - z_{wheel}", "m", (3e-5, 3e-4)),
        "z_body": ("z_{body}", "m", (5e-5, 3e-4)),
        "z_wheel": ("z_{wheel}", "m", (5e-5, 3e-4)),
    },
    "mass": {"a_mass": ("der(v_{mass})", "m/s^2", (0.01, 0.05)), "z_mass": ("z_{mass}", "m", (3e-5, 3e-4))},
    "law": {"force": ("F_{spring} + F_{damper}", "N", (0.5, 4.0))},
}
ELEMENTS = {"quarter": ("spring", "damper", "tyre"), "mass": ("spring", "damper"), "law": ("spring", "damper")}
OWNER = {"m_b": "body", "m_w": "wheel", "m": "mass", "c": "spring", "d": "damper", "c_t": "tyre"}
INPUT = {"quarter": ("road", "m"), "mass": ("force_in", "N"), "law": ("motion", "m")}


@dataclass(frozen=True)
class Plant:
    """One vehicle or rig. `nominal` and `tolerance` stand in the model file, `true` does not."""

    kind: str
    true: Mapping[str, float]
    nominal: Mapping[str, float]
    tolerance: Mapping[str, float]
    names: Mapping[str, str]

    @property
    def weight(self) -> float:
        """Static load of the tyre [N]."""
        return GRAVITY * (self.true["m_b"] + self.true["m_w"])

    def ends(self, element: str) -> tuple[int, int]:
        """The two ends of an element as plant.c counts them."""
        return {"quarter": (1, MOTION) if element == "tyre" else (0, 1), "mass": (0, GROUND), "law": (MOTION, GROUND)}[self.kind]

    def body(self, role: str) -> int:
        return {"body": 0, "mass": 0, "wheel": 1, "motion": MOTION}[role]

    def world(self, values: Mapping[str, float] | None = None) -> World:
        """The linear plant with these parameter values [SI], else the true ones."""
        p = self.true if values is None else values
        laws = {
            "spring": Law(Kind.LINEAR, *self.ends("spring"), (p["c"], 0.0)),
            "damper": Law(Kind.LINEAR, *self.ends("damper"), (0.0, p["d"])),
        }
        if self.kind == "quarter":
            laws["tyre"] = Law(Kind.LINEAR, *self.ends("tyre"), (p["c_t"], 0.0))
        if self.kind == "mass":
            laws["drive"] = Law(Kind.TRACK, 0, GROUND, (-1.0, 0.0, 0.0, 1.0))
        return World(tuple(p[m] for m in ("m_b", "m_w", "m") if m in p), laws)

    def signals(self, motion: Motion) -> dict[str, np.ndarray]:
        """What ideal sensors see."""
        z, a = motion.z, motion.a
        if self.kind == "quarter":
            return {"a_body": a[:, 0], "a_wheel": a[:, 1], "deflection": z[:, 0] - z[:, 1], "z_body": z[:, 0], "z_wheel": z[:, 1]}
        return {"a_mass": a[:, 0], "z_mass": z[:, 0]} if self.kind == "mass" else {"force": motion.reaction}

    def deflection(self, element: str, motion: Motion, given: np.ndarray, given_rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Deflection [m] and rate [m/s] of an element; `given` is the input at the same times."""
        a, b = self.ends(element)
        zero = np.zeros(len(given))
        pick = {
            MOTION: (given, given_rate),
            GROUND: (zero, zero),
            **{i: (motion.z[:, i], motion.v[:, i]) for i in range(motion.z.shape[1])},
        }
        return pick[a][0] - pick[b][0], pick[a][1] - pick[b][1]

    def transfer(self, f: np.ndarray) -> dict[str, np.ndarray]:
        """Linear transfer from the measured input to each signal at frequencies f [Hz]: what an error of the input does."""
        p, s = self.true, 2j * np.pi * f
        k = p["c"] + p["d"] * s
        if self.kind == "law":
            return {"force": k}
        if self.kind == "mass":
            z = 1 / (p["m"] * s**2 + k)
            return {"a_mass": s**2 * z, "z_mass": z}
        body, wheel = p["m_b"] * s**2 + k, p["m_w"] * s**2 + k + p["c_t"]
        z_w = p["c_t"] * body / (wheel * body - k**2)
        z_b = k / body * z_w
        return {"a_body": s**2 * z_b, "a_wheel": s**2 * z_w, "deflection": z_b - z_w, "z_body": z_b, "z_wheel": z_w}


def draw(rng: np.random.Generator, hard: bool, kind: str) -> Plant:
    """From a small car to a van, or a rig of a laboratory. `hard`: known to 3 % only; else the usual rig, 0.5 to 2 %."""
    if kind == "quarter":
        m_b = rng.uniform(220, 700)
        m_w = m_b * rng.uniform(0.09, 0.25)
        c = m_b * (2 * np.pi * rng.uniform(0.85, 1.8)) ** 2
        d = 2 * rng.uniform(0.15, 0.4) * np.sqrt(c * m_b)
        value = {"m_b": m_b, "m_w": m_w, "c": c, "d": d, "c_t": (m_b + m_w) * rng.uniform(450, 850)}
    else:
        m = 10 ** rng.uniform(1, 2.6)
        c = m * (2 * np.pi * rng.uniform(0.8, 4.0)) ** 2
        value = {"m": m, "c": c, "d": 2 * rng.uniform(0.05, 0.35) * np.sqrt(c * m)}
        if kind == "law":
            del value["m"]
    nominal = {name: float(f"{x:.4g}") for name, x in value.items()}
    known = 0.03 if hard else float(rng.choice([0.005, 0.01, 0.02]))
    tolerance = dict.fromkeys(nominal, known)
    if "m_b" in nominal and not hard:
        tolerance["m_b"] = float(rng.choice([0.01, 0.02, 0.03]))  # payload and fuel
    inside = {name: np.clip(0.4 * rng.standard_normal(), -1, 1) * tolerance[name] for name in nominal}
    return Plant(
        kind,
        {name: x * (1 + inside[name]) for name, x in nominal.items()},
        nominal,
        tolerance,
        {role: str(rng.choice(choices)) for role, choices in NAMES.items()},
    )


def model_file(plant: Plant, sample_rate: float, sensors: Mapping[str, float], input_noise: float) -> str:
    """Text of the nominal model file; `sensors`: signal -> noise that its data sheet states; input_noise 0: not stated."""
    name = plant.names
    ends = {"quarter": ("body", "wheel"), "mass": ("mass", "ground"), "law": ("motion", "ground")}[plant.kind]
    a, b = (name.get(end, end) for end in ends)
    driver, unit = INPUT[plant.kind]
    lines = ["[model]", f'name = "{plant.kind}"', f'sample_time = "{1e3 / sample_rate:g} ms"']
    lines += ['input = "parabola"'] if plant.kind == "law" else []  # its force needs the rate, and a line's is late
    lines += ["", "[parameters]"]
    lines += [f'{p} = {{ value = {x!r}, unit = "{UNITS[p]}", tolerance = {plant.tolerance[p]!r} }}' for p, x in plant.nominal.items()]
    noise = f", noise = {input_noise:.3g}" if input_noise else ""
    lines += ["", "[inputs]", f'{name[driver]} = {{ unit = "{unit}"{noise} }}', ""]
    bodies = {"quarter": {"body": "m_b", "wheel": "m_w"}, "mass": {"mass": "m"}, "law": {}}[plant.kind]
    if bodies:
        lines += [
            "[bodies]",
            *(f'{name[role]} = {{ mass = "{m}", position = "z_{name[role]}", velocity = "v_{name[role]}" }}' for role, m in bodies.items()),
            "",
        ]
    lines += [
        "[elements]",
        f'{name["spring"]} = {{ between = ["{a}", "{b}"], law = "linear_spring", stiffness = "c" }}',
        f'{name["damper"]} = {{ between = ["{a}", "{b}"], law = "linear_damper", damping = "d" }}',
    ]
    if plant.kind == "quarter":
        lines += [f'{name["tyre"]} = {{ between = ["{b}", "{name["road"]}"], law = "linear_spring", stiffness = "c_t" }}']
    if plant.kind == "mass":
        lines += [f'{name["drive"]} = {{ between = ["{a}", "ground"], law = "expression", force = "-{name["force_in"]}" }}']
    expressions = {signal: (text.format(**name), unit) for signal, (text, unit, _) in SIGNALS[plant.kind].items()}
    out = {"quarter": "deflection", "mass": "z_mass", "law": "force"}[plant.kind]
    lines += ["", "[outputs]", f'out = {{ value = "{expressions[out][0]}", unit = "{expressions[out][1]}" }}', "", "[sensors]"]
    lines += [
        f'{name[signal]} = {{ value = "{expressions[signal][0]}", unit = "{expressions[signal][1]}", noise = {level:.3g} }}'
        for signal, level in sensors.items()
    ]
    return "\n".join(lines) + "\n"
