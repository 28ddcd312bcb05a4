# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A plant on its test bench: excitations, sensors, noise, and what can be seen of a change under them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from . import plants, roads
from .effects import Change, Place
from .energy import Noise, Signals, draw_noise, remaining, whiten
from .plants import SIGNALS, Plant
from .solver import KNOT_RATE, RATE, STEPS, Motion, World, knots, simulate

LEAD = 3.0  # s of driving before a recording that starts in motion
SENSORS = (
    "a_body a_wheel deflection",
    "a_body a_wheel deflection",
    "a_body a_wheel",
    "a_body deflection",
    "a_wheel deflection",
    "a_body a_wheel deflection z_body z_wheel",
    "a_body a_wheel z_body",
    "deflection z_body",
)  # of a vehicle
NOTHING = Change({})


@dataclass(frozen=True)
class Drive:
    """One excitation: the input at the knots, with a lead before the recording starts."""

    file: str
    label: str
    values: np.ndarray
    lead: float  # s

    @property
    def duration(self) -> float:
        return (len(self.values) - 6) / KNOT_RATE - self.lead

    @cached_property
    def at_signals(self) -> tuple[np.ndarray, np.ndarray]:
        """Input and its rate at the times of the signals."""
        part = slice(2 + int(self.lead * RATE), len(self.values) - 4)  # the knots are as dense as the signals
        return self.values[part], np.gradient(self.values, 1 / KNOT_RATE)[part]


@dataclass(frozen=True)
class Bench:
    """Everything but the effects."""

    plant: Plant
    rate: float  # Hz
    noise: Mapping[str, Noise]  # of the sensors there are
    input_noise: float  # RMS of the measured input
    drives: tuple[Drive, ...]  # training, then one hold-out
    moving: bool
    seed: tuple[int, ...]

    @property
    def training(self) -> tuple[Drive, ...]:
        return self.drives[:-1]

    @property
    def samples(self) -> int:
        """Measured values in the training data: what the energy of an effect as loud as the noise is."""
        return sum(int(d.duration * self.rate) for d in self.training) * len(self.noise)

    def rng(self, *what: int) -> np.random.Generator:
        return np.random.default_rng([*self.seed, *what])

    def world(self, changes: Sequence[Change], factors: Mapping[str, float] | None = None) -> World:
        """The true plant with its changes, and with parameters times `factors`."""
        true = dict(self.plant.true)
        for more in (*(c.factor for c in changes), factors or {}):
            true.update({p: true[p] * f for p, f in more.items()})
        world = self.plant.world(true)
        for i, c in enumerate(changes):
            laws = {(k if k in plants.ELEMENTS[self.plant.kind] else f"{i} {k}"): law for k, law in c.laws.items()}
            world = replace(
                world,
                masses=(*world.masses, *c.masses),
                laws={**world.laws, **laws},
                felt=c.felt or world.felt,
                inverse=world.inverse if c.inverse is None else c.inverse,
                auxiliary=c.auxiliary or world.auxiliary,
            )
        return world

    def move(self, drive: Drive, changes: Sequence[Change] = (), steps: int = STEPS, factors: Mapping[str, float] | None = None) -> Motion:
        """Noise-free motion in one recording, without its lead."""
        p, world, settled = self.plant.true, self.world(changes, factors), sum(c.settled for c in changes)
        start = np.zeros((2, len(world.masses)))
        if settled and world.masses:
            quarter = self.plant.kind == "quarter"
            start[0] = settled / p["c"] + (settled / p["c_t"] if quarter else 0.0)
            if quarter:
                start[0, 1] = settled / p["c_t"]
        m, k = simulate(world, drive.values, start, steps), int(drive.lead * RATE)
        return replace(m, z=m.z[k:], v=m.v[k:], a=m.a[k:], reaction=m.reaction[k:])

    def observe(self, motion: Motion, changes: Sequence[Change], recording: int, noise: Signals | None = None) -> dict[str, np.ndarray]:
        """What the sensors give, at the sample rate; without noise and rounding unless the noise is given."""
        seen = {}
        for name, x in self.plant.signals(motion).items():
            if name not in self.noise:
                continue
            for i, c in enumerate(changes):
                for fault in (c.sensor.get(name), c.sensor.get("*")):
                    x = fault(x, self.rng(recording, i, 1), RATE) if fault else x
            x = x[:: int(RATE / self.rate)] + (0.0 if noise is None else noise[name])
            for i, c in enumerate(changes):
                x = c.late[name](x, self.rng(recording, i, 2), self.rate) if name in c.late else x
            seen[name] = x if noise is None else self.noise[name].rounded(x)
        return seen

    def transfer(self, n: int) -> dict[str, np.ndarray]:
        """Linear transfer from the input to each signal at the bins of n samples."""
        return self.plant.transfer(np.fft.rfftfreq(n, 1 / self.rate))

    def white(self, parts: Sequence[Signals]) -> np.ndarray:
        """The signals of all training recordings in units of the noise."""
        return np.concatenate([whiten(p, self.noise, self.transfer(len(next(iter(p.values())))), self.input_noise) for p in parts])

    def response(self, changes: Sequence[Change] = (), steps: int = STEPS, factors: Mapping[str, float] | None = None) -> np.ndarray:
        """The noise-free signals of the training recordings in units of the noise; `steps` below STEPS where roughly will do."""
        as_before = steps < STEPS and not factors and not any(c.moves for c in changes)
        motions = self.linear_motions if as_before else [self.move(d, changes, steps, factors) for d in self.training]
        return self.white([self.observe(m, changes, i) for i, m in enumerate(motions)])

    @cached_property
    def linear_motions(self) -> list[Motion]:
        return [self.move(d, steps=1) for d in self.training]

    @cached_property
    def linear_signals(self) -> list[Signals]:
        return [self.observe(m, (), i) for i, m in enumerate(self.linear_motions)]

    @cached_property
    def linear(self) -> np.ndarray:
        return self.white(self.linear_signals)

    @cached_property
    def of_parameters(self) -> dict[str, np.ndarray]:
        """Whitened derivative with respect to the relative value of each parameter."""
        return {p: (self.response(steps=1, factors={p: 1.001}) - self.linear) / 1e-3 for p in self.plant.true}

    @cached_property
    def of_sensors(self) -> dict[tuple[str, str], np.ndarray]:
        """Whitened directions of a bias and of a scale of every sensor."""

        def only(name: str, change: type(np.copy)) -> np.ndarray:
            return self.white([{s: change(x) if s == name else 0 * x for s, x in part.items()} for part in self.linear_signals])

        return {
            (kind, s): only(s, change) for s in self.noise for kind, change in (("sensor_bias", np.ones_like), ("sensor_scale", np.copy))
        }

    @cached_property
    def of_start(self) -> list[np.ndarray]:
        """What an unknown start state can do to each recording; nothing if they start at rest."""
        found, n = [], len(self.plant.world().masses) if self.moving else 0
        for i, drive in enumerate(self.training):
            rest = np.zeros(round(drive.duration * KNOT_RATE) + 6)
            for k in range(2 * n):
                free = self.observe(simulate(self.plant.world(), rest, np.eye(2 * n)[k].reshape(2, n), 1), (), i)
                found.append(self.white([free if j == i else {s: 0 * x for s, x in p.items()} for j, p in enumerate(self.linear_signals)]))
        return found

    def left(self, x: np.ndarray, free: Sequence[np.ndarray] = ()) -> float:
        """Chi-square of a whitened difference after the model is re-fitted within its tolerances, and `free` directions freely."""
        known = [(y, 0.4 * self.plant.tolerance[p]) for p, y in self.of_parameters.items()]
        return remaining(x, [*self.of_start, *free], known)

    @cached_property
    def reach(self) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Deflection and rate of every element of the linear plant in all training recordings."""
        return reach(self.plant, self.linear_motions, self.training)

    def place(self, where: str) -> Place:
        """What the linear plant does at an element, or at the element that carries a body, or at a sensor."""
        element = where if where in self.reach else "tyre" if where == "wheel" else "spring"
        (s, v), p = self.reach[element], self.plant.true
        s_top, v_top = (float(np.quantile(np.abs(x), 0.995)) for x in (s, v))
        force = {"spring": p["c"] * s_top, "damper": p["d"] * v_top, "tyre": p.get("c_t", 0.0) * s_top}[element]
        power = np.abs(np.fft.rfft(s * np.hanning(len(s)))) ** 2
        centre = max(float(power @ np.fft.rfftfreq(len(s), 1 / RATE) / power.sum()), 0.5)
        signal = np.concatenate([part[where] for part in self.linear_signals]) if where in self.noise else np.zeros(1)
        duration = self.training[0].duration
        return Place(
            self.plant,
            where,
            s_top,
            v_top,
            float(s.min()),
            float(s.max()),
            force,
            p["d"] * float(np.mean(v**2)) * duration,
            float(np.quantile(np.abs(signal), 0.999)),
            centre,
            duration,
        )


def reach(plant: Plant, motions: Sequence[Motion], drives: Sequence[Drive]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Deflection and rate of every element over all these recordings."""
    parts = {e: [plant.deflection(e, m, *d.at_signals) for m, d in zip(motions, drives, strict=True)] for e in plants.ELEMENTS[plant.kind]}
    return {e: tuple(np.concatenate(x) for x in zip(*own, strict=True)) for e, own in parts.items()}


def draw_drives(rng: np.random.Generator, plant: Plant, moving: bool, harsh: bool) -> tuple[Drive, ...]:
    """One or two training recordings and a hold-out inside their range, as hard as this plant is used to; `harsh`: the tyre may lift."""
    several = rng.random() < 0.5
    lengths = [float(rng.integers(10, 16)) for _ in range(2)] if several else [float(rng.integers(20, 31))]
    lead, level = LEAD if moving else 0.0, rng.uniform(0.005, 0.03)  # m, of a prescribed motion; a force is scaled below
    drives: list[Drive] = []
    peaks: dict[str, np.ndarray] = {}
    for i, length in enumerate([*lengths, float(rng.integers(10, 14))]):
        t = knots(length + lead)
        label, of = roads.draw(rng, t[-1]) if plant.kind == "quarter" else roads.draw_other(rng, t[-1], level)
        drive = Drive("", label, of(t), 0.0)
        own = {
            e: np.array([np.abs(x).max() for x in both])
            for e, both in reach(plant, [simulate(plant.world(), drive.values, steps=1)], [drive]).items()
        }
        factor, travel = 1.0, own["spring"][0]
        if plant.kind == "quarter":
            load = plant.true["c_t"] * own["tyre"][0] / plant.weight
            wish = rng.uniform(0.8, 1.3) / load if harsh else 1.0
            factor = float(np.clip(wish, 0.008 / travel, min((1.4 if harsh else 0.85) / load, (0.15 if harsh else 0.09) / travel)))
        elif plant.kind == "mass":
            factor = rng.uniform(0.008, 0.05) / travel
        last = i == len(lengths)
        if last:
            factor = min(factor, *(0.9 * float((peaks[e] / x).min()) for e, x in own.items()))
        peaks = {e: np.maximum(peaks.get(e, 0.0), factor * x) for e, x in own.items()}
        drives.append(Drive("holdout_1.csv" if last else f"train_{i + 1}.csv", f"{label}, times {factor:.2f}", factor * drive.values, lead))
    return tuple(drives)


def draw_bench(rng: np.random.Generator, seed: tuple[int, ...], kind: str, hard: bool, harsh: bool) -> Bench:
    """A random plant of this kind; `hard`: known to 3 %, noisy input, coloured noise, recordings that start in motion."""
    plant = plants.draw(rng, hard, kind)
    sensors = rng.choice(SENSORS).split() if kind == "quarter" else list(SIGNALS[kind])
    noise = {s: draw_noise(rng, SIGNALS[kind][s][2], hard) for s in sensors}
    drives = draw_drives(rng, plant, hard, harsh)
    worst = {"quarter": rng.uniform(5e-6, 5e-5), "mass": 3e-3 * float(np.std(drives[0].values)), "law": rng.uniform(2e-7, 2e-6)}[kind]
    rate = float(rng.choice([500, 1000, 2000], p=[0.35, 0.45, 0.2]))
    return Bench(plant, rate, noise, worst if hard else 0.0, drives, hard, seed)
