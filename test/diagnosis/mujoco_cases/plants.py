# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a plant is: a model of MuJoCo, and a model file of its physics in which nothing hides; how sensors, names and numbers are drawn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from .engine import SAMPLE, Friction, Job

Values = Mapping[str, float]


@dataclass
class Place:
    """What hides at a joint or tendon."""

    friction: float | None = None  # N or N*m
    quadratic: float = 0.0  # of the force quadratic v abs(v)
    cubic: float = 0.0  # of the force cubic s^3
    stop: tuple[float, float, float] | None = None  # side, gap, stiffness
    slack: float = 0.0  # whole dead band of a tendon's spring


@dataclass
class Hidden:
    """All that hides in the plant itself; what is done to commands and sensors is elsewhere."""

    places: dict[str, Place] = field(default_factory=dict)
    actuator: dict[str, str] = field(default_factory=dict)  # attributes
    friction: Friction | None = None
    load: str = ""
    tyre_damping: float = 0.0

    def at(self, place: str) -> Place:
        return self.places.get(place, Place())


@dataclass(frozen=True)
class Site:
    """A place of forces: every word for it in the model file, the joint or tendon, and its spring and damper."""

    words: tuple[str, ...]
    of: str
    spring: str = ""
    damper: str = ""


@dataclass(frozen=True)
class Sensor:
    """A sensor: what the model file says of it, what MuJoCo has, resolution and white noise (SI)."""

    name: str
    unit: str
    value: str
    element: str
    what: str  # position, rate or acceleration
    resolution: float = 0.0
    white: float = 0.0
    pick: tuple[int, int] = (0, 1)  # of the numbers that the element gives

    @property
    def noise(self) -> float:
        """Standard deviation of white noise and rounding together."""
        return float(np.hypot(self.white, self.resolution / np.sqrt(12)))


@dataclass(frozen=True)
class Plant:
    """A plant of one case. `bodies`, `elements`: of its model file. `job` makes MuJoCo's model of parameters and what hides."""

    name: str
    values: Mapping[str, tuple[float, str]]
    exact: tuple[str, ...]
    sites: Mapping[str, Site]
    bodies: tuple[str, ...]
    elements: tuple[str, ...]
    sensors: tuple[Sensor, ...]
    job: Callable[[Values, Hidden], Job]
    input: tuple[str, str] = ("", "")  # name, unit
    actuator: str = ""  # element of the drive
    travel: float = 0.0  # RMS of the position that the controller is asked for, or of the road
    band: tuple[float, float] = (0.1, 1.0)  # Hz
    forward: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray] = lambda q, v, a: 0 * q  # command of the nominal plant for a motion
    inertia: float = 0.0  # that the drive moves
    anchored: bool = True  # a force that knows where the plant is

    @property
    def road(self) -> bool:
        return self.name == "quarter"

    def columns(self, y: np.ndarray) -> np.ndarray:
        """The sensors [n, sensors] in MuJoCo's sensor data [n, numbers]."""
        ends = np.cumsum([0, *(s.pick[1] for s in self.sensors)])
        return y[:, [int(a) + s.pick[0] for a, s in zip(ends, self.sensors, strict=False)]]


def pick(rng: np.random.Generator, *words: str) -> str:
    """One of the names that a thing may have."""
    return str(rng.choice(words))


def between(rng: np.random.Generator, low: float, high: float) -> float:
    """A number, even on a logarithmic scale."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def subset(rng: np.random.Generator, first: Sensor, *more: Sensor) -> tuple[Sensor, ...]:
    """The first sensor, and others by chance."""
    return (first, *(s for s in more if rng.random() < 0.6))


def encoder(rng: np.random.Generator, name: str, value: str, element: str, bits: tuple[int, int] = (10, 12)) -> Sensor:
    """An angle in counts of a turn, with as much jitter as half a count."""
    count = 2 * np.pi / 2 ** int(rng.integers(bits[0], bits[1] + 1))
    return Sensor(name, "rad", value, element, "position", count, 0.5 * count)


def gyro(rng: np.random.Generator, name: str, value: str, element: str) -> Sensor:
    """A MEMS rate sensor."""
    return Sensor(name, "rad/s", value, element, "rate", 0.0, between(rng, 0.01, 0.04))


def accelerometer(rng: np.random.Generator, name: str, value: str, site: str, axis: int, low: float = 0.03) -> Sensor:
    """One axis of a MEMS accelerometer; gravity is in what it shows."""
    return Sensor(name, "m/s^2", value, f'<accelerometer site="{site}"/>', "acceleration", 0.0, between(rng, low, 5 * low), (axis, 3))


def extra(actual: float, file: float) -> tuple[float, float]:
    """Inertia of the body itself and armature on its joint: what a body has more than the file says is armature."""
    return min(actual, file), max(actual - file, 0.0)


def drive_attributes(hidden: Hidden) -> str:
    """Attributes of a force or torque drive."""
    return " ".join(f'{k}="{v}"' for k, v in {"gear": "1", **hidden.actuator}.items())


def model_text(plant: Plant, tolerance: float | None, noise: Mapping[str, float]) -> str:
    """The model file; without `tolerance` no parameter states one."""
    lines = [f'[model]\nname = "{plant.name}"\nsample_time = "{SAMPLE * 1e3:g} ms"']
    if plant.actuator:
        lines.append('input = "held"')
    lines.append("\n[parameters]")
    for name, (value, unit) in plant.values.items():
        sure = ", exact = true" if name in plant.exact else f", tolerance = {tolerance:g}" if tolerance else ""
        lines.append(f'{name} = {{ value = {value:.12g}, unit = "{unit}"{sure} }}')
    if plant.input[0]:
        lines.append(f'\n[inputs]\n{plant.input[0]} = {{ unit = "{plant.input[1]}" }}')
    lines += ["\n[bodies]", *plant.bodies, "\n[elements]", *plant.elements]
    first = plant.sensors[0]
    lines.append(f'\n[outputs]\nout_1 = {{ value = "{first.value}", unit = "{first.unit}" }}\n\n[sensors]')
    lines += [f'{s.name} = {{ value = "{s.value}", unit = "{s.unit}", noise = {noise[s.name]:.3g} }}' for s in plant.sensors]
    return "\n".join(lines) + "\n"
