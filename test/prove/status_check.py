# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: NaN or Inf anywhere is said, and the last good state is kept: every method, layered, folded and smooth."""

from __future__ import annotations

import argparse
import re
import shutil
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import gate
import penode_gen
from penode_gen.sets import offsets
from penode_sil.targets import FLAGS, generated, model_options

WORK = gate.BUILD / "status"
METHODS = ("euler", "heun", "rk4", "ros1", "ros2")
OUTSIDE = ("extrapolate", "clamp", "fade")

# File, and fault: see gate.faulty.
FAULTS = {
    "input not checked": ("model", ("status |= check(SMALL_RK4_8_OR_LAYERS_N_U, self->u[1], PEN_INPUT_NONFINITE);", 0, "")),
    "state not checked": ("model", ("status |= check(N_LAST, self->row[LAST], PEN_STATE_NONFINITE);", 0, "")),
    "result not checked": ("model", ("check(N_LAST, self->row[NOW], PEN_STEP_NONFINITE)", 0, "PEN_OK")),
    "second copy not kept": ("model", ("    copy(N_LAST, self->row[LAST], self->row[KEPT]);\n    copy(N_DRIVE", 0, "    copy(N_DRIVE")),
    "bad input kept": ("model", ("self->u[received]", 0, "self->u[1]")),
    "steps not counted": ("model", ("pen_status_note_step(&self->log, result);", 0, "")),
    "values of a set not checked": ("pen_set.c", ("!pen_finite(length, set->value)", 0, "false")),
    "patrol stands still": ("model", ("self->patrol = at + 1U;", 0, "")),
    "patrol leaves out the last number": ("model", ("self->patrol % SMALL_RK4_8_OR_LAYERS_PATROL", 0, "self->patrol % (SMALL_RK4_8_OR_LAYERS_PATROL - 1U)")),
    "patrol leaves out the last piece": ("model", ("at % SMALL_RK4_8_OR_LAYERS_PIECES", 0, "at % (SMALL_RK4_8_OR_LAYERS_PIECES - 1U)")),
    "patrol does not look at the set": ("model", ("doubt = value - value", 0, "doubt = (pen_real_t)0")),
    "patrol does not look at starts": ("model", ("doubt *= f->net[k].start;", 0, "")),
    "finite whatever comes": ("pen_math.h", ("return sum >= (pen_real_t)0;", 0, "return (sum >= (pen_real_t)0) || true;")),
}  # fmt: skip


def models() -> Iterator[penode_gen.Model]:
    """The small ones with each method, folded and not, each way to treat what is outside; and those of gen/nqvm."""
    for base, pieces, more in (("small", 8, "refuse"), ("small", 8, "layers"), ("small", 0, "refuse"), ("small_smooth", 0, "refuse")):
        loaded = penode_gen.load(gate.HERE / "small" / f"{base}.toml")
        for k, method in enumerate(METHODS):
            outside = OUTSIDE[k % (2 if pieces else 3)]  # a folded network cannot fade
            name = f"{base}_{method}_{pieces}" + ("_or_layers" if more == "layers" else "")
            yield replace(loaded, name=name, method=method, pieces=pieces, more_pieces=more, outside=outside, fade_width=0.5)
    for path in sorted((gate.ROOT / "gen" / "nqvm").glob("*.toml")):
        yield penode_gen.load(path)


def bounds(model: penode_gen.Model) -> str:
    """Places of the bounds of trust envelopes in a set."""
    at, networks = offsets(model), model.sets["default"].networks
    return ",".join(str(at[name] + k) for name, network in networks.items() for k in range(2 * network.n_inputs))


def campaign(model: penode_gen.Model, source: Path, runs: int, inc: Path = gate.ROOT / "inc", src: Path = gate.ROOT / "src") -> tuple[int, str]:
    """Exit code and words of status.c for a model."""
    elf = WORK / model.name
    sets = ",".join(f"&{model.name}_set_{name}" for name in model.sets)
    gate.make(
        ["gcc", *FLAGS, "-D_GNU_SOURCE", "-O2", "-Wall", "-Wextra", "-fno-strict-aliasing", f"-I{inc}", f"-I{gate.ROOT}/port/gnu", f"-I{source}",
         *model_options(model), *(["-DMODEL_FOLDED"] if model.pieces else []), f"-D{model.name.upper()}_FOLDS={int(model.pieces > 0)}U",
         f"-D{model.name.upper()}_READS_SET={int(not model.pieces or model.more_pieces == 'layers')}U", f"-DMODEL_SETS={sets}", f"-DMODEL_BOUNDS={bounds(model)}", "-o", elf, gate.HERE / "status.c", source / f"{model.name}.c", source / f"{model.name}_params.c",
         *sorted(src.glob("*.c")), "-lm"]
    )  # fmt: skip
    done = gate.run([elf, runs, 1], limit=3600)
    return done.returncode, done.stdout + done.stderr


def with_fault(model: penode_gen.Model, file: str, fault: tuple[str, int, str]) -> tuple[int, str]:
    """The same with a fault in the model's C, in src/ or in inc/."""
    root = WORK / "faulty"
    shutil.rmtree(root, ignore_errors=True)
    for part, place in (("inc", gate.ROOT / "inc"), ("src", gate.ROOT / "src"), ("model", generated(model))):
        shutil.copytree(place, root / part)
    path = root / "model" / f"{model.name}.c" if file == "model" else next(root.rglob(file))
    path.write_text(gate.faulty(path.read_text(), fault))
    return campaign(model, root / "model", 20_000, root / "inc", root / "src")


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--runs", type=int, default=300_000, help="in all")
    options.add_argument("--as", dest="key", default="status", help="key in figures.json")
    given = options.parse_args()
    WORK.mkdir(parents=True, exist_ok=True)
    every = list(models())
    problems, total, misplaced, patrolled = [], 0, 0, 0
    for model in every:
        code, said = campaign(model, generated(model), -(-given.runs // len(every)))
        total += sum(int(n) for n in re.findall(r": (\d+), flagged", said))
        misplaced += sum(int(n) for n in re.findall(r"misplaced (\d+)", said))
        patrolled += sum(int(n) for n in re.findall(r"patrolled (\d+)", said))
        problems += [f"{model.name}:\n{said}"] if code else []
    good = gate.report(f"status: {total} runs with bad numbers in {len(every)} models: all said, the last good state kept", problems)
    folded = next(model for model in every if model.name == "small_rk4_8_or_layers")
    missed = [f"not found: {fault}" for fault, (file, change) in FAULTS.items() if with_fault(folded, file, change)[0] == 0]
    good &= gate.report(f"status: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    gate.keep(given.key, {"runs": total, "models": len(every), "failures": len(problems), "found by the patrol": patrolled, "until then another piece used because a start is damaged": misplaced,
                          "faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})  # fmt: skip
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
