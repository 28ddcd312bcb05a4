# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: NaN or Inf anywhere, an input out of its range, are reported, and the last good state is kept: every method, layered, folded and
smooth."""

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
from penode_gen.sets.packing import offsets
from penode_sil.building import FLAGS, generated, model_options

WORK = gate.BUILD / "status"
METHODS = ("euler", "heun", "rk4", "ros1", "ros2")
OUTSIDE = ("extrapolate", "clamp", "fade")
OUT_OF_RANGE = ("report", "clamp", "hold")

# Model, file and fault: see gate.faulty. How a model treats an input out of range: OUT_OF_RANGE, in turn.
HOLDS, CLAMPS = "small_rk4_8_or_layers", "small_heun_8_or_layers"
FAULTS = {
    "input not checked": (HOLDS, "model", ("status |= pen_step_check(SMALL_RK4_8_OR_LAYERS_N_U, u1, PEN_INPUT_NONFINITE);", 0, "")),
    "state not checked": (
        HOLDS,
        "model",
        ("status |= pen_step_check(SMALL_RK4_8_OR_LAYERS_N_LAST, self->row[PEN_ROW_LAST], PEN_STATE_NONFINITE);", 0, ""),
    ),
    "result not checked": (HOLDS, "pen_step.h", ("pen_step_check(n_last, &row[PEN_ROW_NOW * n_last], PEN_STEP_NONFINITE)", 0, "PEN_OK")),
    "second copy not kept": (HOLDS, "pen_step.h", ("        row[(PEN_ROW_KEPT * n_last) + i] = value;", 0, "")),
    "bad input kept": (HOLDS, "pen_step.h", ("u[(received * n_kept) + i]", 0, "u[n_kept + i]")),
    "steps not counted": (HOLDS, "pen_step.h", ("pen_status_note_step(&self->log, result);", 0, "")),
    "a missing argument not counted": (HOLDS, "model", ("pen_status_note_step(&self->head.log, status);", 0, "")),
    "a missing argument of a tuning call not counted": (
        HOLDS,
        "pen_status.c",
        ("note(&log->count[PEN_STATUS_STEP], PEN_STATUS_FLAGS - PEN_STATUS_STEP, ", 0, "note(&log->count[PEN_STATUS_STEP], 9U, "),
    ),
    "values of a set not checked": (HOLDS, "pen_set.c", ("!pen_finite(length, set->value)", 0, "false")),
    "scrub stands still": (HOLDS, "pen_step.h", ("self->scrub = at + 1U;", 0, "")),
    "scrub leaves out the last value": (HOLDS, "pen_step.h", ("self->scrub % round", 0, "self->scrub % (round - 1U)")),
    "scrub leaves out the last piece": (HOLDS, "pen_step.h", ("at % pieces", 0, "at % (pieces - 1U)")),
    "scrub does not look at the set": (
        HOLDS,
        "pen_step.h",
        ("nonfinite = looked_at - looked_at;", 0, "nonfinite = (pen_real_t)0 * (pen_real_t)(looked_at == looked_at);"),
    ),
    "scrub does not look at starts": (HOLDS, "pen_step.h", ("nonfinite *= looked_at->start;", 0, "")),
    "finite whatever comes": (HOLDS, "pen_math.h", ("return sum >= (pen_real_t)0;", 0, "return (sum >= (pen_real_t)0) || true;")),
    "above the range not reported": (HOLDS, "pen_step.h", ("(u > most) ? flags : PEN_OK", 0, "(u > most) ? PEN_OK : PEN_OK")),
    "at the edge reported": (HOLDS, "pen_step.h", ("(u < least) ? flags", 0, "(u <= least) ? flags")),
    "an input out of range not held": (HOLDS, "model", ("PEN_INPUT_RANGE | PEN_HELD", 0, "PEN_INPUT_RANGE")),
    "an input out of range held and kept": (
        HOLDS,
        "model",
        ("PEN_INPUT_NONFINITE | PEN_INPUT_RANGE, status", 0, "PEN_INPUT_NONFINITE, status"),
    ),
    "an input above its range not moved": (CLAMPS, "pen_step.h", ("(raised > most) ? most : raised", 0, "raised")),
    "Inf moved into the range unseen": (
        CLAMPS,
        "model",
        ("    status |= pen_step_check(SMALL_HEUN_8_OR_LAYERS_N_U, u1, PEN_INPUT_NONFINITE);\n", 0, ""),
    ),
}


def models() -> Iterator[penode_gen.Model]:
    """The small ones with each method, folded and not, each way to treat what is outside; and those of gen/nqvm."""
    for base, pieces, more in (("small", 8, "refuse"), ("small", 8, "layers"), ("small", 0, "refuse"), ("small_smooth", 0, "refuse")):
        loaded = penode_gen.load(gate.HERE / "small" / f"{base}.toml")
        for k, method in enumerate(METHODS):
            outside = OUTSIDE[k % (2 if pieces else 3)]  # a folded network cannot fade
            name = f"{base}_{method}_{pieces}" + ("_or_layers" if more == "layers" else "")
            guard = replace(loaded.guard, out_of_range=OUT_OF_RANGE[k % 3])
            yield replace(loaded, name=name, method=method, pieces=pieces, more_pieces=more, outside=outside, fade_width=0.5, guard=guard)
    for path in sorted((gate.ROOT / "gen" / "nqvm").glob("*.toml")):
        yield penode_gen.load(path)


def bounds(model: penode_gen.Model) -> str:
    """Places of the bounds of trust envelopes in a set."""
    at, networks = offsets(model), model.sets["default"].networks
    return ",".join(str(at[name] + k) for name, network in networks.items() for k in range(2 * network.n_inputs))


def ranges(model: penode_gen.Model) -> str:
    """Declared range of each input, in C."""
    edges = [["-INFINITY" if i.minimum is None else i.minimum, "INFINITY" if i.maximum is None else i.maximum] for i in model.inputs]
    return ",".join(f"{{(pen_real_t){least},(pen_real_t){most}}}" for least, most in edges)


def campaign(
    model: penode_gen.Model, source: Path, runs: int, inc: Path = gate.ROOT / "inc", src: Path = gate.ROOT / "src"
) -> tuple[int, str]:
    """Exit code and words of status.c for a model."""
    elf = WORK / model.name
    sets = ",".join(f"&{model.name}_set_{name}" for name in model.sets)
    gate.make(
        [
            "gcc",
            *FLAGS,
            "-D_GNU_SOURCE",
            "-O2",
            "-Wall",
            "-Wextra",
            "-fno-strict-aliasing",
            f"-I{inc}",
            f"-I{gate.ROOT}/port/gnu",
            f"-I{source}",
            *model_options(model),
            *(["-DMODEL_FOLDED"] if model.pieces else []),
            f"-D{model.name.upper()}_FOLDS={int(model.pieces > 0)}U",
            f"-D{model.name.upper()}_READS_SET={int(not model.pieces or model.more_pieces == 'layers')}U",
            f"-DMODEL_SETS={sets}",
            f"-DMODEL_BOUNDS={bounds(model)}",
            f"-DMODEL_RANGES={ranges(model)}",
            f"-DMODEL_OUT_OF_RANGE={model.guard.out_of_range.upper()}",
            "-o",
            elf,
            gate.HERE / "status.c",
            source / f"{model.name}.c",
            source / f"{model.owner}_params.c",
            *sorted(src.glob("*.c")),
            "-lm",
        ]
    )
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
    problems, total, misplaced, scrubbed = [], 0, 0, 0
    for model in every:
        code, said = campaign(model, generated(model), -(-given.runs // len(every)))
        total += sum(int(n) for n in re.findall(r": (\d+), flagged", said))
        misplaced += sum(int(n) for n in re.findall(r"misplaced (\d+)", said))
        scrubbed += sum(int(n) for n in re.findall(r"scrubbed (\d+)", said))
        problems += [f"{model.name}:\n{said}"] if code else []
    good = gate.report(f"status: {total} runs with bad numbers in {len(every)} models: all reported, the last good state kept", problems)
    named = {model.name: model for model in every}
    missed = [f"not found: {fault}" for fault, (name, file, change) in FAULTS.items() if with_fault(named[name], file, change)[0] == 0]
    good &= gate.report(f"status: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    gate.keep(
        given.key,
        {
            "runs": total,
            "models": len(every),
            "failures": len(problems),
            "found by the scrub": scrubbed,
            "until then another piece used because a start is damaged": misplaced,
            "faults": list(FAULTS),
            "faults found": len(FAULTS) - len(missed),
        },
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
