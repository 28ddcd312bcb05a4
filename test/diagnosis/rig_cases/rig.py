# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a rig is: a plant of plants.c, the model file of its nominal physics, sensors, a logger, and what is hidden in it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from .signals import Drive, Wave
from .solver import Array

Named = list[list[str]]  # pairs of kind and place
UNSTATED = 0.025  # true values lie within, where the model file states no tolerance
INSIDE = 0.7  # of the stated tolerance, that true values lie in
STATED = (0.9, 1.3)  # stated over true noise


@dataclass
class Parameter:
    """A parameter of the model file."""

    name: str
    value: float
    unit: str
    tolerance: float | None = None
    exact: bool = False

    def row(self) -> str:
        """Its line of the model file."""
        sure = ", exact = true" if self.exact else f", tolerance = {self.tolerance:g}" if self.tolerance else ""
        return f'{self.name} = {{ value = {self.value:.6g}, unit = "{self.unit}"{sure} }}'


@dataclass
class Sensor:
    """A sensor: white noise and quantisation step in its unit, share of nonlinearity at full scale, stated noise, bias."""

    name: str
    value: str
    unit: str
    white: float
    step: float = 0.0
    bent: float = 0.0
    stated: float | None = None
    bias: float = 0.0

    @property
    def noise(self) -> float:
        """Standard deviation of white noise and quantisation."""
        return float(np.hypot(self.white, self.step / 12**0.5))

    def row(self) -> str:
        """Its line of the model file."""
        stated = f", noise = {self.stated:.2g}" if self.stated else ""
        return f'{self.name} = {{ value = "{self.value}", unit = "{self.unit}"{stated} }}'


@dataclass
class Input:
    """A recorded input; `true` gives it in SI units of states and inputs of the plant, `si` is its unit in SI units."""

    name: str
    unit: str
    true: Callable[[Array, Array], Array]
    white: float = 0.0
    step: float = 0.0
    held: bool = False
    si: float = 1.0
    stated: float | None = None

    def row(self) -> str:
        """Its line of the model file."""
        stated = f", noise = {self.stated:.2g}" if self.stated else ""
        return f'{self.name} = {{ unit = "{self.unit}"{stated} }}'


@dataclass
class Plan:
    """A recording to be made: rows, inputs, start; `free`: it starts in motion; `command`: what is logged instead of the input."""

    held_out: bool
    rows: int
    drive: Drive
    start: Array
    free: bool = False
    command: Wave | None = None


@dataclass
class Logger:
    """Jitter of the sampling (share of a period), whether time stamps show it, lost rows, empty cells of each sensor."""

    jitter: float
    stamped: bool
    lost: int
    empty: int


def no_start(_values: Mapping[str, Array], _times: Array) -> list[float]:
    """The start of rigs whose recordings all start at rest."""
    raise NotImplementedError


@dataclass
class Rig:
    """A rig. `order`: parameters of its plant; `absent`: their values where nothing is hidden; `shown`: its sensors of states and rates."""

    name: str
    plant: str
    sample: float
    steps: int
    order: list[str]
    parameters: list[Parameter]
    absent: dict[str, float]
    model: str
    sensors: list[Sensor]
    inputs: list[Input]
    shown: Callable[[Array, Array], dict[str, Array]]
    logger: Logger = field(init=False)
    true: dict[str, float] = field(default_factory=dict)
    null: bool = False
    what: str = ""
    accepted: list[Named] = field(default_factory=list)
    tolerated: Named = field(default_factory=list)
    verdicts: list[str] = field(default_factory=list)
    hidden: dict[str, float] = field(default_factory=dict)  # arguments of the true law, and where their fit starts
    linear: set[str] = field(default_factory=set)  # those that may change their sign
    wide: set[str] = field(default_factory=set)  # parameters outside of their tolerance
    law: dict[str, float] = field(default_factory=dict)  # what the true law has instead of `absent`
    plans: list[Plan] = field(default_factory=list)
    start: Callable[[Mapping[str, Array], Array], list[float]] = no_start  # of a recording in motion, by sight
    scatter: tuple[float, ...] = (1.0,)  # how wrong that may be

    def settle(self, rng: np.random.Generator) -> Rig:
        """Draws logger, stated noise of inputs, and true values; nothing is hidden yet."""
        jitter = float(rng.choice([0.0, 0.003, 0.01]))
        self.logger = Logger(jitter, bool(rng.random() < 0.6), int(rng.choice([0, 0, 3, 7])), int(rng.choice([0, 0, 4])))
        for i in self.inputs:
            if i.white and rng.random() < 0.5:
                i.stated = float(np.hypot(i.white, i.step / 12**0.5) * rng.uniform(*STATED))
        self.true = dict(self.absent)
        for p in self.parameters:
            share = 0.0 if p.exact else rng.uniform(-INSIDE, INSIDE) * (p.tolerance or UNSTATED)
            self.true[p.name] = p.value * (1 + share)
        return self

    def vector(self, values: Mapping[str, float]) -> Array:
        """Parameters of the plant, in its order."""
        return np.array([float(values[n]) for n in self.order])

    def nominal(self) -> dict[str, float]:
        """Values of the model file."""
        return {p.name: p.value for p in self.parameters}

    def text(self) -> str:
        """The model file."""
        rows = {
            "@PARAMETERS": [p.row() for p in self.parameters],
            "@INPUTS": [i.row() for i in self.inputs],
            "@SENSORS": [s.row() for s in self.sensors],
            "@SAMPLE": [f"{self.sample * 1e3:g} ms"],
        }
        text = self.model
        for mark, lines in rows.items():
            text = text.replace(mark, "\n".join(lines))
        return text

    def plan(self, held_out: bool, duration: float, drive: Drive, start: object, free: bool = False, command: Wave | None = None) -> None:
        """A further recording."""
        rows = round(duration / self.sample) + 1
        self.plans.append(Plan(held_out, rows, drive, np.array(start, dtype=float), free, command))


def sensor(
    rng: np.random.Generator, name: str, value: str, unit: str, white: float, step: float = 0.0, bent: float = 0.0, stated: float = 0.8
) -> Sensor:
    """A sensor whose noise the model file states by a chance of `stated`."""
    made = Sensor(name, value, unit, white, step)
    made.stated = made.noise * rng.uniform(*STATED) if rng.random() < stated else None
    made.bent = bent * rng.uniform(-1, 1)
    return made


def sheet(rng: np.random.Generator, tolerance: float, miss: float = 0.25) -> float | None:
    """What a data sheet states: mostly how well a value is known."""
    return None if rng.random() < miss else tolerance


def digits(value: float, n: int) -> float:
    """A value as a data sheet gives it."""
    return float(f"{value:.{n}g}")


def varied(rng: np.random.Generator, value: float, share: float = 0.2) -> float:
    """A value that differs from rig to rig."""
    return float(value * rng.uniform(1 - share, 1 + share))
