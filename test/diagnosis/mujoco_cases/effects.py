# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Hidden effects: where each may hide, how large it is at size 1, and by which feature of MuJoCo it acts.

    coulomb_friction             frictionloss                    input_gain        gear
    bump_stop                    range, solreflimit              input_lag         dyntype="filter"
    cubic_spring                 stiffness, third coefficient    input_saturation  forcerange
    quadratic_damper             damping, second coefficient     input_delay       delay
    backlash                     springlength of a tendon        input_dead_zone, input_slew_limit, input_offset: before ctrl
    load_dependent_friction      frictionloss, set in each step
    position_dependent_friction  the same                        tyre_damping      a second actuator
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from .engine import SAMPLE, STEP, Array, Friction, Reach, Run
from .plants import Hidden, Place, Plant

FORCES = ("coulomb_friction", "bump_stop", "cubic_spring", "quadratic_damper", "load_dependent_friction", "position_dependent_friction")
INPUT = ("input_gain", "input_lag", "input_delay", "input_saturation", "input_dead_zone", "input_slew_limit", "input_offset")
SENSOR = ("sensor_bias", "sensor_scale", "sensor_delay", "sensor_clipping")
KINDS = {
    "joint": (*FORCES, "wrong_parameter", *INPUT, *SENSOR),
    "slider": (*FORCES, "wrong_parameter", *INPUT, *SENSOR),
    "drive": (
        "coulomb_friction",
        "backlash",
        "cubic_spring",
        "load_dependent_friction",
        "wrong_parameter",
        *INPUT,
        "sensor_scale",
        "sensor_delay",
    ),
    "pendulum": ("coulomb_friction", "quadratic_damper", "position_dependent_friction", "wrong_parameter", "sensor_clipping"),
    "quarter": ("coulomb_friction", "bump_stop", "cubic_spring", "quadratic_damper", "tyre_damping", "wrong_parameter", *SENSOR),
}
WRONG = 0.08  # relative error of a parameter at size 1
HISTORY = ("delay", "nsample", "interp")  # attributes of an actuator that acts late
# Of a delay of whole steps, less a quarter so that no time is on an edge, the last of four evaluations of a step sees the next one: it has
# a sixth of the weight, so that the delay is EARLY short of whole steps.
EARLY = STEP / 6
ASKED = EARLY - STEP / 4  # s, the value given to MuJoCo minus the delay
DELAYS = 0.05  # s, the longest that a fit may try


@dataclass(frozen=True)
class Effect:
    """A hidden effect: kind, place (site, sensor, input or parameter), its parameters (SI), and what of its shape is fixed."""

    kind: str
    place: str
    numbers: Mapping[str, float]
    sign: float = 1.0
    shape: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Scale:
    """What a plant does without the effect: RMS and peak of travel and rate of a place, its force (N or N*m), the command, a sensor."""

    travel: float
    peak: float
    rate: float
    force: float
    stiffness: float
    command: Array
    signal: Array
    noise: float


def places(kind: str, plant: Plant) -> list[str]:
    """Where a kind may hide."""
    what = {s.name: s.what for s in plant.sensors}
    if kind in INPUT:
        return [plant.input[0]]
    if kind == "wrong_parameter":
        small = ("shaft", "motor")  # the damping of a shaft and of a small motor changes next to nothing
        hardly = {plant.sites[s].damper for s in small if s in plant.sites}
        return [k for k in plant.values if k not in plant.exact and k not in hardly]
    if kind == "sensor_bias":  # of a position it is another start where no force knows the place
        return [
            k
            for k, w in what.items()
            if w != "position" or plant.name in ("joint", "quarter") or (plant.name == "slider" and plant.anchored)
        ]
    if kind == "sensor_delay":  # a command that is held makes steps of an acceleration; one sensor that is late is a late input
        return [k for k, w in what.items() if len(what) > 1 and (w != "acceleration" or plant.road)]
    if kind in SENSOR:
        return list(what)
    if kind == "tyre_damping":
        return ["tyre"]
    if plant.name == "drive":
        return ["shaft"] if kind in ("backlash", "cubic_spring") else ["load"]
    return [next(iter(plant.sites))]


def numbers(kind: str, x: float, sign: float, shape: Mapping[str, float], at: Scale, file: float) -> dict[str, float]:
    """Parameters of an effect of size x, about 1 for one that matters; `file`: what a wrong parameter is by the model file."""
    steps = np.abs(np.diff(at.command)) / SAMPLE if len(at.command) else np.zeros(1)
    size = np.abs(at.command) if len(at.command) else np.zeros(1)
    f, z = at.force, shape["z"]

    def most(values: Array, share: float) -> float:
        """What a share of the values exceeds."""
        return float(np.quantile(values, 1 - min(share, 0.6)))

    table: dict[str, Callable[[], dict[str, float]]] = {
        "coulomb_friction": lambda: {"force": 0.08 * x * f},
        "bump_stop": lambda: {"gap": (0.45 + 0.35 * z) * at.peak, "stiffness": x * f / at.peak + 0.5 * at.stiffness},
        "cubic_spring": lambda: {"cubic": 0.15 * x * f / at.travel**3},
        "quadratic_damper": lambda: {"coefficient": 0.1 * x * f / at.rate**2},
        "load_dependent_friction": lambda: {"share": 0.1 * x},
        "position_dependent_friction": lambda: {"force": 0.1 * x * f, "variation": 0.6 + 0.35 * z},
        "backlash": lambda: {"gap": 0.3 * x * at.travel},
        "tyre_damping": lambda: {"damping": 0.1 * x * f / at.rate},
        "input_gain": lambda: {"gain": 1 + sign * min(0.08 * x, 0.5)},
        "input_lag": lambda: {"time": 0.008 * x},
        "input_delay": lambda: {"delay": STEP * max(round(0.006 * x / STEP), 2) - EARLY},
        "input_saturation": lambda: {"limit": most(size, 0.08 * x)},
        "input_dead_zone": lambda: {"width": 0.08 * x * rms(size)},
        "input_slew_limit": lambda: {"rate": most(steps, 0.15 * x)},
        "input_offset": lambda: {"offset": sign * 0.08 * x * rms(size)},
        "sensor_bias": lambda: {"bias": sign * 2 * x * at.noise},
        "sensor_scale": lambda: {"scale": 1 + sign * min(0.03 * x, 0.4)},
        "sensor_delay": lambda: {"delay": 0.004 * x},
        "sensor_clipping": lambda: {"limit": most(np.abs(at.signal), 0.04 * x)},
        "wrong_parameter": lambda: {"value": file * (1 + sign * min(WRONG * x, 0.6))},
    }
    return table[kind]()


def in_plant(effects: list[Effect], plant: Plant) -> Hidden:
    """What hides in MuJoCo's model."""
    hidden = Hidden()
    for e in effects:
        n, sign = e.numbers, e.sign
        at = hidden.places.setdefault(e.place, Place())
        if e.kind == "coulomb_friction":
            at.friction = max(n["force"], 0.0)
        elif e.kind == "bump_stop":
            at.stop = (sign, max(n["gap"], 1e-6), max(n["stiffness"], 1e-6))
        elif e.kind == "cubic_spring":
            at.cubic = n["cubic"]
        elif e.kind == "quadratic_damper":
            at.quadratic = n["coefficient"]
        elif e.kind == "backlash":
            at.slack = max(n["gap"], 0.0)
        elif e.kind in ("load_dependent_friction", "position_dependent_friction"):
            at.friction = 0.0
            hidden.friction = _friction(e, plant)
            hidden.load = "tendon:t" if plant.name == "drive" else "actuator:drive"
            hidden.load = hidden.load if e.kind == "load_dependent_friction" else ""
        elif e.kind == "tyre_damping":
            hidden.tyre_damping = n["damping"]
        elif e.kind in INPUT:
            hidden.actuator |= _actuator(e)
    return hidden


def _friction(e: Effect, plant: Plant) -> Friction:
    of, n = plant.sites[e.place].of, e.numbers
    if e.kind == "load_dependent_friction":
        return Friction(of, lambda s, load: n["share"] * abs(load))
    wave, phase = e.shape["wave"], e.shape["phase"]
    return Friction(of, lambda s, load: n["force"] * (1 + n["variation"] * float(np.sin(wave * s + phase))))


def late(effects: Sequence[Effect]) -> float:
    """The delay of the command, s, 0 without one."""
    return sum(float(np.clip(e.numbers["delay"], 0.0, DELAYS)) for e in effects if e.kind == "input_delay")


def _actuator(e: Effect) -> dict[str, str]:
    """Attributes of MuJoCo's actuator that make the effect."""
    n = e.numbers
    if e.kind == "input_gain":
        return {"gear": f"{n['gain']:.15g}"}
    if e.kind == "input_lag":
        return {"dyntype": "filter", "dynprm": f"{max(n['time'], 1e-4):.15g}"}
    if e.kind == "input_saturation":
        return {"forcerange": f"{-max(n['limit'], 1e-9):.15g} {max(n['limit'], 1e-9):.15g}"}
    if e.kind == "input_delay":
        return {"delay": f"{late([e]) + ASKED:.15g}", "nsample": "600", "interp": "zoh"}
    return {}


def reach(effects: list[Effect]) -> Reach:
    """What is sent to what reaches MuJoCo's actuator, where its own features do not do it."""
    kept = 0.0

    def acts(u: float) -> float:
        nonlocal kept
        for e in effects:
            n = e.numbers
            if e.kind == "input_dead_zone":
                u = float(np.sign(u) * max(abs(u) - n["width"], 0.0))
            elif e.kind == "input_offset":
                u += n["offset"]
            elif e.kind == "input_slew_limit":
                most = abs(n["rate"]) * SAMPLE
                u = kept = kept + float(np.clip(u - kept, -most, most))
        return u

    return acts


def sensed(effects: list[Effect], plant: Plant, y: Array) -> Array:
    """Clean signals [n, sensors] as the sensors show them, before noise."""
    y = y.copy()
    for e in effects:
        if e.kind not in SENSOR:
            continue
        i, n = [s.name for s in plant.sensors].index(e.place), e.numbers
        if e.kind == "sensor_bias":
            y[:, i] += n["bias"]
        elif e.kind == "sensor_scale":
            y[:, i] *= n["scale"]
        elif e.kind == "sensor_delay":
            t = np.arange(len(y)) * SAMPLE
            y[:, i] = CubicSpline(t, y[:, i])(np.maximum(t - n["delay"], 0.0))
        else:
            y[:, i] = np.clip(y[:, i], -n["limit"], n["limit"])
    return y


def words(e: Effect, plant: Plant) -> list[str]:
    """Every word of the model file for the place of an effect; none of a parameter, which its name tells."""
    if e.kind in SENSOR:
        return [e.place]
    if e.kind in INPUT:
        return [plant.input[0], plant.actuator]
    return [] if e.kind == "wrong_parameter" else list(plant.sites[e.place].words)


def told(e: Effect) -> dict[str, float]:
    """Parameters of the truth: those of README.md, a wrong parameter by its name."""
    return {e.place: e.numbers["value"]} if e.kind == "wrong_parameter" else dict(e.numbers)


def rms(x: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(x**2)))


def scale_of(kind: str, place: str, plant: Plant, r: Run, y: Array, stiffness: float) -> Scale:
    """Sizes that an effect is drawn by, of a run without it; `stiffness`: of the spring at the place, 0 without one."""
    site = plant.sites.get(place)
    names = [s.name for s in plant.sensors]
    if plant.name in ("drive", "quarter") and site and not site.of.startswith("joint"):
        s = r.q[:, 0] - r.q[:, 1] if site.of else r.q[:, 1] - r.u
        v = r.v[:, 0] - r.v[:, 1] if site.of else np.gradient(s, SAMPLE)
    else:
        column = 1 if place == "load" else 0
        s, v = r.q[:, column], r.v[:, column]
    command = r.u
    force = rms(r.u) if plant.actuator else 0.02 * plant.values[next(iter(plant.values))][0] * rms(np.gradient(v, SAMPLE))
    if plant.road:
        force = max(stiffness, 1.0) * rms(s)
    signal = y[:, names.index(place)] if place in names else np.zeros(1)
    noise = plant.sensors[names.index(place)].noise if place in names else 0.0
    return Scale(rms(s), float(np.abs(s).max()), rms(v), force, stiffness, command, signal, noise)
