# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Hidden effects: every kind in a common form, and in foreign forms that a fitter of textbook formulas does not know.

A form is called with a random generator and a place, and gives a function from size to change. The size is relative to
what the linear plant does there: forces to the peak force of the linear element, sensor faults to the peak of the signal.
Curves are of x = deflection or rate over its peak. Random numbers stand in default arguments: they are drawn once a case.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from .plants import Plant
from .solver import GROUND, MOTION, Curve, Kind, Law, Track

Rng = np.random.Generator
Sensor = Callable[[np.ndarray, Rng, float], np.ndarray]  # (signal, rng, sample rate [Hz]) -> signal
OUTSIDE = "outside_taxonomy"


@dataclass(frozen=True)
class Change:
    """What an effect does to a plant. Truth parameters in SI; `late` sensor faults come after the noise, as in a converter."""

    parameters: Mapping[str, float]
    laws: Mapping[str, Law] = field(default_factory=dict)  # added, or in place of the element of that name
    masses: tuple[float, ...] = ()  # kg, added
    factor: Mapping[str, float] = field(default_factory=dict)  # on true parameters
    sensor: Mapping[str, Sensor] = field(default_factory=dict)
    late: Mapping[str, Sensor] = field(default_factory=dict)
    auxiliary: Track | None = None
    felt: Track | None = None
    inverse: np.ndarray | None = None
    settled: float = 0.0  # N, constant force on the body under which the recording starts
    memory: Callable[[Mapping[str, float]], dict[str, float]] | None = None  # truth from the last states of the laws

    @property
    def moves(self) -> bool:
        """Whether the plant moves in another way; else only the sensors see something else."""
        return bool(self.laws or self.masses or self.factor or self.felt or self.inverse is not None)


Build = Callable[[float], Change]


@dataclass(frozen=True)
class Place:
    """Where an effect acts, and what the linear plant does there in the training recordings."""

    plant: Plant
    where: str  # element, body, sensor or parameter, by role
    s: float  # m, deflection of the element that 99.5 % of the time is not passed
    v: float  # m/s, rate likewise
    low: float  # m, most negative deflection
    high: float
    force: float  # N, of the linear element at s or v
    heat: float  # J, loss of the linear damper in one training recording
    peak: float  # of the signal of a sensor
    centre: float  # Hz, where the deflection has its power
    duration: float  # s

    def law(self, kind: Kind, *p: float, curve: Curve | None = None, **table: float) -> Law:
        return Law(kind, *self.plant.ends(self.where), p, curve, **table)

    @property
    def stiffness(self) -> float:
        return self.force / self.s

    @property
    def damping(self) -> float:
        return self.plant.true["d"]


@dataclass(frozen=True)
class Form:
    kind: str
    name: str
    places: tuple[str, ...]  # roles of elements and bodies; "sensor", "parameter": any of the plant; "strut": a damper between bodies
    common: bool
    sizes: tuple[float, float]  # what is plausible
    make: Callable[[Rng, Place], Build]


FORMS: list[Form] = []


def forms(kind: str, places: str, sizes: tuple[float, float], common: str, **made: Callable[[Rng, Place], Build]) -> None:
    """Registers the forms of a kind; `common` names those that textbooks have."""
    FORMS.extend(Form(kind, name, tuple(places.split()), name in common.split(), sizes, make) for name, make in made.items())


def one_of(r: Rng, *ranges: tuple[float, float]) -> float:
    return float(r.uniform(*ranges[r.integers(len(ranges))]))


def logarithmic(r: Rng, low: float, high: float) -> float:
    return float(np.exp(r.uniform(np.log(low), np.log(high))))


def way(r: Rng, positive: float = 0.5) -> float:
    return 1.0 if r.random() < positive else -1.0


def soft(x: np.ndarray | float, width: float) -> np.ndarray:
    """max(x, 0) with a rounded corner."""
    return 0.5 * (x + np.sqrt(np.square(x) + width**2) - width)


def odd(curve: Curve) -> Curve:
    return lambda x: np.sign(x) * curve(np.abs(x))


def of_rate(at: Place, size: float, curve: Curve, **truth: float) -> Change:
    return Change(truth, {"hidden": at.law(Kind.RATE_CURVE, curve=lambda v: size * at.force * curve(v / at.v))})


def of_deflection(at: Place, size: float, curve: Curve, **truth: float) -> Change:
    return Change(truth, {"hidden": at.law(Kind.DEFLECTION_CURVE, curve=lambda s: size * at.force * curve(s / at.s))})


def pulling(at: Place, force: float) -> dict[str, Law]:
    """A force [N] on a body, up, times the auxiliary input; under prescribed motion it adds to the measured force."""
    body = at.plant.body(at.where)
    return {"hidden": Law(Kind.TRACK, body, GROUND, (force if body == MOTION else -force,))}


def rise(t: np.ndarray, start: float, seconds: float) -> np.ndarray:
    u = np.clip((t - start) / seconds, 0, 1)
    return u * u * (3 - 2 * u)


def times(x: np.ndarray, rate: float) -> np.ndarray:
    return np.arange(len(x)) / rate


def places(form: Form, plant: Plant, sensors: list[str]) -> list[str]:
    """Where on this plant a form can act."""
    here = {"quarter": "spring damper tyre body wheel", "mass": "spring damper mass", "law": "spring damper motion"}[plant.kind].split()
    meant = {"sensor": sensors, "parameter": list(plant.true), "clock": ["clock"], "strut": ["damper"] * (plant.kind == "quarter")}
    return [place for role in form.places for place in meant.get(role, [role] if role in here else [])]
