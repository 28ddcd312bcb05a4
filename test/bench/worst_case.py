# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The worst case of a step: its instructions over everything that may come, by what the step had to do.

worst_case.py [MODEL.toml] [--steps 10000] [--machine m4f ...]
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import cycles
import numpy as np
import programs
from all_laws import all_laws
from numpy.typing import NDArray

import penode_gen
from penode_gen.sets import fold
from penode_sil.status import BIT
from penode_sil.targets import MACHINES

ROOT = Path(__file__).resolve().parents[2]
ROUND = 100  # steps, see worst_case.c
METHODS, POLICIES = ("rk4", "ros1"), ("clamp", "fade")  # of a model of everything: values, and slopes, of all there is
FPU = ("m4f", "m7", "m33", "m55")


def points(model: penode_gen.Model) -> NDArray[np.float32]:
    """
    Where something changes along a state, and its neighbours in float: ends of the straight pieces of the default set's
    networks, edges of their envelopes, ends of the fading, values of parameters (gaps, knees); 0, and the pieces' middles.
    """
    places, middles = [np.zeros(1), np.array([p.value for p in model.parameters.values()])], []
    for network in model.sets["default"].networks.values():
        edges = np.array([network.input_min, network.input_max])
        fading = model.fade_width * np.diff(edges, axis=0) * [[-1], [1]]
        places += [edges.ravel(), (edges + fading).ravel()]
        if fold.foldable(network):
            kinks = fold.kinks(network)
            places.append(kinks)
            middles.append((kinks[1:] + kinks[:-1]) / 2)
    at = np.concatenate(places).astype(np.float32)
    below, above = (np.nextafter(at, np.float32(end)) for end in (-np.inf, np.inf))
    return np.concatenate([at, below, above, *(m.astype(np.float32) for m in middles)])


def everything() -> list[penode_gen.Model]:
    """Models of every law (all_laws.py), by method and policy outside of the trust envelope."""
    with tempfile.TemporaryDirectory() as folder:
        model = all_laws(Path(folder))
    names = {(method, outside): f"{model.name}_{method}_{outside}" for method in METHODS for outside in POLICIES}
    return [dataclasses.replace(model, name=name, method=m, outside=o) for (m, o), name in names.items()]


def measure(
    model: penode_gen.Model, machine: str, steps: int, flags: Sequence[str] = ("-O2",), source: Path | None = None
) -> dict[str, NDArray]:
    """
    Calls (cycles.CALL) of the step, at least `steps` of them, by kind: normal, refused (a number was not finite),
    adopting, holding; and of commit.
    """
    folded = ("-DMODEL_FOLDED",) if model.pieces else ()
    program = programs.our_program(model, machine, (*flags, *folded), programs.HERE / "worst_case.c", source)
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
    kinds = {"normal": ~(held | adopted | bad), "refused": bad & ~(held | adopted), "adopting": adopted, "holding": held & ~adopted}
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
