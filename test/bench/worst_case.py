# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The worst case of a step: its instructions over everything that may come, by what the step had to do.

worst_case.py [MODEL.toml] [--steps 10000] [--machine m4f ...]
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import cycles
import penode_gen
import programs
from penode_gen import fold
from penode_sil.status import BIT
from penode_sil.targets import MACHINES, ROOT

ROUND = 100  # steps, see worst_case.c
FPU = ("m4f", "m7", "m33", "m55")


def points(model: penode_gen.Model) -> NDArray[np.float32]:
    """Ends of the straight pieces of the default set's networks, their neighbours in float, and the middles."""
    places = [np.zeros(1, dtype=np.float32)]
    for network in filter(fold.foldable, model.sets["default"].networks.values()):
        kinks = fold.kinks(network).astype(np.float32)
        below, above = (np.nextafter(kinks, np.float32(end)) for end in (-np.inf, np.inf))
        places += [kinks, below, above, (kinks[1:] + kinks[:-1]) / 2]
    return np.concatenate(places)


def measure(model: penode_gen.Model, machine: str, steps: int, flags: Sequence[str] = ("-O2",)) -> dict[str, NDArray]:
    """
    Calls (cycles.CALL) of the step, at least `steps` of them, by kind: normal, refused (a number was not finite),
    adopting, holding; and of commit.
    """
    folded = ("-DMODEL_FOLDED",) if model.pieces else ()
    program = programs.our_program(model, machine, (*flags, *folded), programs.HERE / "worst_case.c")
    commit = f"{model.name}_tune_commit"
    with tempfile.TemporaryDirectory() as folder:
        with cycles.counting(program.elf, [program.step, commit], machine == "m4f") as result:
            points(model).tofile(Path(folder, "points"))
            programs.run(program, ["record", str(steps // ROUND), "points"], Path(folder))
            calls = result().calls
        status = np.fromfile(Path(folder, "record"), dtype="<u4")
    found = calls[program.step]
    if len(found) != len(status):
        raise AssertionError(f"{len(found)} steps counted of {len(status)}")
    held, adopted = status & BIT["held"] != 0, status & BIT["adopted"] != 0
    bad = status & (BIT["input_nonfinite"] | BIT["state_nonfinite"] | BIT["step_nonfinite"] | BIT["singular"]) != 0
    kinds = {
        "normal": ~(held | adopted | bad),
        "refused": bad & ~(held | adopted),
        "adopting": adopted,
        "holding": held & ~adopted,
    }
    return {kind: found[which] for kind, which in kinds.items()} | {"commit": calls[commit]}


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("model", nargs="?", type=Path, default=ROOT / "gen" / "nqvm" / "nqvm.toml")
    arguments.add_argument("--steps", type=int, default=10_000)
    arguments.add_argument("--machine", nargs="*", default=list(FPU), choices=[m for m in MACHINES if MACHINES[m]])
    given = arguments.parse_args()
    model = penode_gen.load(given.model)
    for machine in given.machine:
        for kind, calls in measure(model, machine, given.steps).items():
            print(f"{machine} {kind}: {cycles.described(calls, machine)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
