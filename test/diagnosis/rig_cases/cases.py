# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A case: a rig of the draw with its recordings, files and truth. Everything follows from seed and index."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import axes, motors, processes, servos, springs, swinging
from .expert import Study, study
from .recordings import Recording, record, write
from .rig import Rig

RIGS = (  # maker, and how many things may hide in it
    (swinging.pendulum, 1),
    (motors.throttle, 3),
    (axes.cart, 1),
    (swinging.crane, 1),
    (axes.axis, 2),
    (springs.oscillator, 2),
    (motors.motor, 3),
    (springs.quarter, 2),
    (processes.tanks, 2),
    (servos.servo, 2),
    (processes.thermal, 2),
)
NULLS = 3  # rigs of a turn in which nothing is hidden
TURN = len(RIGS) + NULLS
SIZES = (1.0, 1.5, 2.2, 3.0)  # of the effect, until it can be seen
SEEN = 2.0  # times that the true law predicts the hold-out better, at least
TRIES = 5
NOTHING = "nothing is hidden: noise, quantisation, parameters within their tolerances"


@dataclass
class Case:
    """A rig with its recordings."""

    seed: int
    index: int
    rig: Rig
    recordings: list[Recording]
    variant: int
    size: float = 1.0
    studied: Study | None = None

    def write(self, folder: Path) -> tuple[list[Path], list[Path]]:
        """Writes model file and recordings; returns training and hold-out."""
        folder.mkdir(parents=True)
        (folder / "model.toml").write_text(self.rig.text())
        paths: tuple[list[Path], list[Path]] = ([], [])
        for r in self.recordings:
            some = paths[r.plan.held_out]
            some.append(folder / f"{'holdout' if r.plan.held_out else 'train'}_{len(some) + 1}.csv")
            write(self.rig, r, some[-1])
        return paths

    def truth(self) -> dict:
        """What is right, and what the expert reaches; errors in the units of the recordings."""
        rig, logger = self.rig, self.rig.logger
        bent = [["sensor_scale", s.name] for s in rig.sensors if s.bent and not rig.null]
        return {
            "seed": self.seed,
            "index": self.index,
            "rig": rig.name,
            "null": rig.null,
            "what": rig.what or NOTHING,
            "accepted": rig.accepted,
            "tolerated": rig.tolerated + bent,
            "verdicts": rig.verdicts,
            "variant": self.variant,
            "size": self.size,
            "true": {k: float(x) for k, x in rig.true.items()},
            "units": {s.name: s.unit for s in rig.sensors},
            "noise": {s.name: s.noise for s in rig.sensors},
            "logger": vars(logger),
            "holdout": vars(self.studied) if self.studied else {},
        }


def which(seed: int, index: int) -> tuple[int, int, bool, int]:
    """Number of the rig, what hides in it, whether nothing does, and the turn of the draw."""
    turn, place = divmod(index, TURN)
    null = place >= len(RIGS)
    number = place
    if null:
        some = np.random.default_rng([seed, 999, turn]).choice(len(RIGS), NULLS, replace=False)
        number = int(np.sort(some)[place - len(RIGS)])
    return number, (seed + number + turn) % RIGS[number][1], null, turn


def draw(seed: int, index: int, size: float = 1.0, again: int = 0) -> Case:
    """A case, not yet studied."""
    number, variant, null, turn = which(seed, index)
    rng = np.random.default_rng([seed, index % TURN + 1, int(null), turn, *([again] if again else [])])
    rig = RIGS[number][0](rng, variant, null, size)
    return Case(seed, index, rig, [record(rig, plan, rng) for plan in rig.plans], variant, size)


def make(seed: int, index: int) -> Case:
    """A case that can be solved: the effect is made larger, and then drawn again, until the true law is SEEN times better."""
    for again in range(TRIES):
        for size in SIZES:
            case = draw(seed, index, size, again)
            case.studied = study(case.rig, case.recordings)
            if case.rig.null or case.studied.gain >= SEEN:
                return case
    raise ValueError(f"case {seed}:{index}, {case.rig.name}, cannot be solved: {case.rig.what}")


def write_truth(truth: dict, path: Path) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(truth, indent=1) + "\n")
