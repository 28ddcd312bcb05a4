# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Mechanisms with points and turning bodies: is every place seen, is the missing force recovered, is nothing claimed where nothing hides?

    build/venv/bin/python test/diagnosis/mechanisms_campaign.py [--plant halfcar|drive] [--cases 20] [--seed 1] [--seconds 6]

Exit code 1 if a place is not seen, a force misses by more than LIMIT of its RMS, or a null case gets a finding.
"""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parent))

from mechanisms.generator import KINDS, WHERE, Case, cases

import penode_gen
from penode_gen.model import GROUND, Model
from penode_sil import diagnosis
from penode_sil.diagnosis.study import noise, study
from penode_sil.diagnosis.study.missing import missing_forces
from penode_sil.recordings.measured import load

HERE = Path(__file__).resolve().parent
LIMIT = 0.05  # of the RMS of the true hidden force


@dataclass(frozen=True)
class Score:
    """What was found: places that are not seen; error of the force at the true place and rank of that place; verdict of a null case."""

    unseen: tuple[tuple[str, str], ...]
    error: float
    rank: int
    verdict: str

    @property
    def right(self) -> bool:
        return not self.unseen and self.error < LIMIT and self.verdict in ("", "no_discrepancy")


def model_of(plant: str) -> Model:
    return penode_gen.load(HERE / "mechanisms" / f"{plant}.toml")


def expected(model: Model) -> set[frozenset[str]]:
    """Where elements act, and every body to ground; but no measured force."""
    return {frozenset(e.ends) for e in model.elements if e.law != "expression"} | {frozenset((b.name, GROUND)) for b in model.bodies}


def null(model: Model, case: Case) -> Score:
    """The whole diagnosis, from a file, of a case in which nothing hides."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "case.csv"
        names = [f"{s.name} [{s.unit}]" for s in (*model.inputs, *model.sensors)]
        table = np.column_stack([case.time, case.u, case.y])
        np.savetxt(path, table, "%.9g", ",", header=",".join(["time [s]", *names]), comments="")
        found = diagnosis.diagnose(model, load([path], model))
    return Score((), 0.0, 0, found.verdict)


def score(model: Model, case: Case) -> Score:
    """Diagnose one case as far as its places and forces go, and whether there is anything at all."""
    if case.kind == "nothing":
        return null(model, case)
    good = np.ones_like(case.y, dtype=bool)
    e = noise.prepare("case", case.time, case.u, case.y, good, np.zeros(case.u.shape[1]), [None] * case.y.shape[1])
    state = study.begin(model, [e])
    unseen = expected(model) - {frozenset(p.ends) for p in state.places}
    found = missing_forces(state)
    rank = next((k for k, m in enumerate(found) if set(m.place.ends) == set(WHERE[case.plant, case.kind])), -1)
    if rank < 0:
        return Score(tuple(map(tuple, unseen)), 1.0, -1, "")
    place = found[rank]
    force = place.forces[0] * (1.0 if place.place.ends == WHERE[case.plant, case.kind] else -1.0)
    truth = case.hidden[: len(force)]
    error = float(np.sqrt(np.mean((force - truth) ** 2) / np.mean(truth**2)))
    return Score(tuple(map(tuple, unseen)), error, rank + 1, "")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plant", choices=KINDS, action="append")
    parser.add_argument("--cases", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--seconds", type=float, default=6.0)
    args = parser.parse_args()
    wrong = 0
    for plant in args.plant or KINDS:
        model = model_of(plant)
        for case in cases(plant, args.cases, args.seed, args.seconds):
            began = time.process_time()
            s = score(model, case)
            wrong += not s.right
            what = s.verdict or f"force missed by {s.error:.1%}, place ranks {s.rank}"
            print(
                f"{plant} {case.seed} {case.kind:<9} {'ok   ' if s.right else 'WRONG'} {what}{f', not seen: {s.unseen}' * bool(s.unseen)}"
                f" ({time.process_time() - began:.1f} s)",
                flush=True,
            )
    print(f"{wrong} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
