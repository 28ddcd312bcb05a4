# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
One case: plant, excitation, sensors, and at most one hidden effect, of a size that is drawn against the noise.

Everything follows from seed and index. An effect whose own law, fitted by this generator, does not give its size back, or does not predict
the hold-out better than the nominal plant does, is drawn again; the truth counts how often.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from . import double, effects, excitation, plants, rivals, single
from .effects import Effect
from .engine import COARSE, SAMPLE, STEP, Array, Unstable, run
from .excitation import LONG
from .fitting import Fit, Record, simulate

MAKERS = {**single.MAKERS, **double.MAKERS}
NULL_EVERY = 6  # one case in so many hides nothing
RATIO = (0.8, 25.0)  # of the change of the signals to the noise, as drawn
KEPT = (0.5, 50.0)  # as settled
NEAR = 0.35  # of the logarithm of the ratio, to what was drawn
SIZES = (0.03, 5.0)  # of an effect, that are plausible
BEYOND = 3.0  # tolerances that a wrong parameter is off at least
INSIDE = 1.25  # of the trained range, that the hold-out may reach
SHARE = 0.1  # of its size that the own fit may err by
BETTER = 0.98  # share of the nominal plant's error on the hold-out that the own fit may keep
STEP_ERROR = 0.1  # of the noise, that a step twice as long may change
ATTEMPTS = 60


class Refused(ValueError):
    """A draw that is no case: why, in a word or two."""


class Case:
    """Draws and settles one case. Raises Refused."""

    def __init__(self, seed: int, index: int, tolerances: bool | None, attempt: int) -> None:
        self.seed, self.index, self.attempt = seed, index, attempt
        draw = np.random.default_rng([seed, index, attempt])
        self.group = "null" if index % NULL_EVERY == NULL_EVERY - 1 else "single"
        kinds = sorted({k for some in effects.KINDS.values() for k in some})
        self.kind = str(draw.choice(kinds)) if self.group == "single" else ""
        self.plant = MAKERS[str(draw.choice([k for k, some in effects.KINDS.items() if not self.kind or self.kind in some]))](draw)
        even = bool(np.random.default_rng([seed, index // 2]).integers(2)) == bool(index % 2)
        self.tolerance = float(draw.choice([0.02, 0.03, 0.05])) if (even if tolerances is None else tolerances) else None
        self.true = {k: v for k, (v, _) in self.plant.values.items()}
        for k in self.true:
            if self.tolerance and k not in self.plant.exact:
                self.true[k] *= 1 + 0.4 * self.tolerance * float(np.clip(draw.standard_normal(), -2, 2))
        self.noise = {s.name: s.noise * float(draw.uniform(0.9, 1.15)) for s in self.plant.sensors}  # as the model file states it
        self.records: dict[str, Record] = {}
        self.effect: Effect | None = None
        self.ratio = self.size_error = self.step_error = 0.0
        self.target = plants.between(draw, *RATIO)
        if self.group == "single":
            self._settle(draw)
        names = ["train_1", *["train_2"] * (not self.plant.input[0]), "holdout_1"]
        self.records = {name: self._record(name, STEP) for name in names}
        self._check()

    @property
    def hidden(self) -> list[Effect]:
        return [self.effect] if self.effect else []

    @property
    def trained(self) -> list[Record]:
        return [r for k, r in self.records.items() if k.startswith("train")]

    def _record(self, name: str, step: float) -> Record:
        """Simulate a recording with what hides, and let the sensors see it; the excitation is always the same."""
        number, plant = list(LONG).index(name), self.plant
        rng = np.random.default_rng([self.seed, self.index, self.attempt, number, 1])
        wrong = {e.place: e.numbers["value"] for e in self.hidden if e.kind == "wrong_parameter"}
        job = plant.job({**self.true, **wrong}, effects.in_plant(self.hidden, plant))
        size, rows = excitation.SIZE.get(name, 1.0), LONG[name]
        start = excitation.start(rng, plant, size)
        job.start.update(start)
        self.last = run(job, rows, step, excitation.command(rng, plant, rows, size), effects.reach(self.hidden), plant.road)
        clean = effects.sensed(self.hidden, plant, plant.columns(self.last.y))
        seen = clean + np.array([s.white for s in plant.sensors]) * rng.standard_normal(clean.shape)
        for i, s in enumerate(plant.sensors):
            if s.resolution:
                seen[:, i] = s.resolution * np.round(seen[:, i] / s.resolution)
        return Record(self.last.u if plant.input[0] else None, start, clean, seen)

    def _settle(self, draw: np.random.Generator) -> None:
        """Place, sign and shape; then the size, until the change of the signals is what was drawn."""
        where = effects.places(self.kind, self.plant)
        if not where:
            raise Refused("no place")
        place = str(draw.choice(where))
        shape = {"z": float(draw.random()), "phase": float(draw.uniform(0, 2 * np.pi)), "wave": 0.0}
        first, sign, x = self._record("train_1", COARSE), float(draw.choice([-1, 1])), 1.0
        site = self.plant.sites.get(place)
        stiffness = self.plant.values[site.spring][0] if site and site.spring else 0.0
        at = effects.scale_of(self.kind, place, self.plant, self.last, first.clean, stiffness)
        shape["wave"] = float(draw.uniform(1.5, 3.5)) / max(at.peak, 1e-9)  # so that its level changes some times over the travel
        wrong, least = self.kind == "wrong_parameter", SIZES[0]
        file = self.plant.values[place][0] if wrong else 0.0
        if wrong and self.tolerance:
            x = least = BEYOND * self.tolerance / effects.WRONG
        for _ in range(5):
            self.effect = Effect(self.kind, place, effects.numbers(self.kind, x, sign, shape, at, file), sign, shape)
            self.records = {"train_1": self._record("train_1", COARSE)}
            self.ratio = self._without(rounds=1).ratio
            before, x = x, x * float(np.clip(self.target / max(self.ratio, 1e-9), 0.2, 4.0)) ** 0.9
            x = float(np.clip(x, least, SIZES[1]))
            if abs(np.log(self.ratio / self.target)) < NEAR or x == before:
                break
        self._sized()

    def _sized(self) -> None:
        """Refuse an effect that is hardly seen, or, unless a tolerance asks for it, one that nobody would miss."""
        if not KEPT[0] < self.ratio or (self.ratio > KEPT[1] and self.kind != "wrong_parameter"):
            raise Refused("size")

    def _without(self, rounds: int = 4, clean: bool = True) -> Fit:
        """The nominal plant, fitted; of a wrong parameter with the value of the file."""
        fixed = [self.effect.place] if self.effect and self.kind == "wrong_parameter" else []
        return Fit(self.plant, self.tolerance, self.trained, clean, [], fixed).solve(rounds)

    def _check(self) -> None:
        """Steps are short enough; what hides can be found by who knows its law."""
        r = self.records["train_1"]
        rough = simulate(self.plant, self.true, self.hidden, r.u, r.start, len(r.clean), 2 * STEP)
        self.step_error = float(np.sqrt(np.mean(((rough - r.clean) / [s.noise for s in self.plant.sensors]) ** 2)))
        if self.step_error > STEP_ERROR:
            raise Refused("step")
        most = [np.max([self._reached(x) for x in some], axis=0) for some in (self.trained, [self.records["holdout_1"]])]
        if np.any(most[1] > INSIDE * most[0]):
            raise Refused("hold-out outside")
        if self.effect is None:
            return
        null = self._without()
        self.ratio = null.ratio
        self._sized()
        own = Fit(self.plant, self.tolerance, self.trained, False, [self._guess()]).solve()
        got, true = own.state(own.x).effects[0].numbers, self.effect.numbers
        size = rivals.SIZE[self.kind]
        nothing = self.plant.values[self.effect.place][0] if self.kind == "wrong_parameter" else rivals.NOTHING.get(size, 0.0)
        self.size_error = abs(got[size] - true[size]) / abs(true[size] - nothing)
        if self.size_error > SHARE:
            raise Refused("size not recovered")
        if own.elsewhere(self.records["holdout_1"]) > BETTER * null.elsewhere(self.records["holdout_1"]):
            raise Refused("no gain on the hold-out")

    def _reached(self, r: Record) -> Array:
        """Greatest magnitude of every column of a recording."""
        return np.asarray(np.abs(r.clean if r.u is None else np.column_stack([r.u, r.clean])).max(axis=0))

    def _guess(self) -> Effect:
        """The effect as a fit begins with it: 10 % off."""
        assert self.effect is not None
        return replace(self.effect, numbers={k: 1.1 * v if k in rivals.GUESSED else v for k, v in self.effect.numbers.items()})

    def write(self, folder: Path) -> list[Path]:
        """Model file and recordings; the last one is the hold-out."""
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        for name, r in self.records.items():
            heads, columns = ["time [s]"], [np.arange(len(r.seen)) * SAMPLE]
            if r.u is not None:
                heads.append(f"{self.plant.input[0]} [{self.plant.input[1]}]")
                columns.append(r.u)
            heads += [f"{s.name} [{s.unit}]" for s in self.plant.sensors]
            paths.append(folder / f"{name}.csv")
            np.savetxt(paths[-1], np.column_stack([*columns, r.seen]), "%.9g", ",", header=",".join(heads), comments="")
        (folder / "model.toml").write_text(plants.model_text(self.plant, self.tolerance, self.noise))
        return paths

    def truth(self, refused: Mapping[str, int] | None = None) -> dict[str, Any]:
        """Kind, place, parameters, size and equivalents of the effect; how often it was drawn again, and why."""
        found = [
            {
                "kind": e.kind,
                "where": effects.words(e, self.plant),
                "parameters": effects.told(e),
                "ratio": round(self.ratio, 3),
                "recovered_within": round(self.size_error, 4),
                "equivalents": rivals.equivalents(self),
            }
            for e in self.hidden
        ]
        return {
            "seed": self.seed,
            "index": self.index,
            "stratum": "mujoco",
            "group": self.group,
            "plant": self.plant.name,
            "tolerance": self.tolerance,
            "mismodelling": 0.0,
            "true": self.true,
            "step_error": round(self.step_error, 5),
            "refused": dict(refused or {}),
            "effects": found,
        }


def make(seed: int, index: int, tolerances: bool | None = None) -> tuple[Case, Counter[str]]:
    """The case, and why earlier draws of it were refused."""
    refused: Counter[str] = Counter()
    for attempt in range(ATTEMPTS):
        try:
            return Case(seed, index, tolerances, attempt), refused
        except Refused as why:
            refused[str(why)] += 1
        except (Unstable, np.linalg.LinAlgError):
            refused["unstable"] += 1
    raise Refused(f"{seed}:{index}: {dict(refused)}")


def write_truth(truth: Mapping[str, Any], path: Path) -> None:
    """The truth as JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(truth, indent=1))
