# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Every generator of cases with something hidden: the recordings of a case, and what scores an answer. MuJoCo's cases need build/mujoco:
test/setup.sh mujoco."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

import score
import worlds_score
from claims import nominals
from hidden import cases
from mujoco_cases import cases as mujoco
from worlds import equivalents, world

Scorer = Callable[[dict | None], dict]


def campaign(seed: int, index: int, folder: Path) -> tuple[list[Path], Scorer]:
    """A case of the own campaign: its recordings, and what scores an answer."""
    case = cases.make(seed, index)
    return case.write(folder), lambda found: score.score(case.truth(), found, 0.0)


def of_world(stratum: str, seed: int, index: int, folder: Path) -> tuple[list[Path], Scorer]:
    """The same of a wrong world."""
    case = world.make(seed, index, stratum, None)
    return case.write(folder), lambda found: worlds_score.score(equivalents.truth(case), found, nominals(folder / "model.toml"))


def of_mujoco(seed: int, index: int, folder: Path) -> tuple[list[Path], Scorer]:
    """The same of a case of MuJoCo."""
    case, refused = mujoco.make(seed, index, None)
    return case.write(folder), lambda found: worlds_score.score(case.truth(refused), found, nominals(folder / "model.toml"))


GENERATORS: dict[str, Callable[[int, int, Path], tuple[list[Path], Scorer]]] = {
    "campaign": campaign,
    "worlds": lambda *at: of_world("main", *at),
    "half-cars": lambda *at: of_world("halfcar", *at),
    "drives": lambda *at: of_world("drive", *at),
    "mujoco": of_mujoco,
}
