# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a step and a tuning call that pre-empt each other at any instruction never tear, lose or reorder a set."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import gate
from interruption import executed, interrupted, never

import penode_gen
from penode_sil.building import FLAGS, generated
from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "preempt"
CORES = ("m3", "m4f", "m33")
SOURCES = [path for path in sorted((gate.ROOT / "src").glob("*.c")) if path.name != "pen_set.c"]
SET = gate.ROOT / "src" / "pen_set.c"

# Faults of pen_set.c: see gate.faulty.
FAULTS = {
    "begin while a set waits": ("!pen_tuning_settle(tuning)", 0, "false"),
    "select while a set waits": ("!pen_tuning_settle(tuning)", 1, "false"),
    "rollback while a set waits": ("!pen_tuning_settle(tuning)", 2, "false"),
    "pending before the slot is written": (
        "    pen_set_copy(&tuning->slot[slot], ready);",
        0,
        "    pen_port_store(&tuning->pending, command(ADOPT, slot));\n    pen_set_copy(&tuning->slot[slot], ready);",
    ),
    "pending cleared before active is flipped": (
        "            active = other;",
        0,
        "            pen_port_store(&tuning->pending, 0U);\n            active = other;",
    ),
    "pending forgotten by publish": ("pen_port_store(&tuning->pending, tuning->published);", 0, ""),
    "active not flipped": ("            active = other;", 0, ""),
    "not adopted while holding": ("if (pending != 0U) {", 0, "if ((status == PEN_OK) && (pending != 0U)) {"),
    "withdrawn by the tuning context itself": (
        "pen_port_store(&tuning->pending, command(WITHDRAW, slot));",
        0,
        "pen_port_store(&tuning->pending, 0U);",
    ),
    "a withdrawal that came too late is granted": (
        "} else if (pending == command(WITHDRAW, other)) {",
        0,
        "} else if ((pending == command(WITHDRAW, 0U)) || (pending == command(WITHDRAW, 1U))) {",
    ),
    "a withdrawal taken for granted": ("if (tuning->published == command(ADOPT, active ^ 1U)) {", 0, "if (true) {"),
}


def layered() -> Path:
    """small.toml evaluated layer by layer, so that a step reads the slot: some faults do no harm to a folded model."""
    folder = WORK / "layered"
    shutil.copytree(gate.HERE / "small", folder, dirs_exist_ok=True)
    model = folder / "small.toml"
    model.write_text(gate.faulty(model.read_text(), ("pieces = 8\n", 0, "")))
    return model


def program(machine: str, name: str, pen_set: Path, model: Path = gate.HERE / "small" / "small.toml") -> Path:
    """preempt.c with a model called small and the runtime, pen_set.c from another place if that is a faulty one."""
    source = generated(penode_gen.load(model))
    elf = WORK / f"{machine}-{name}.elf"
    elf.parent.mkdir(parents=True, exist_ok=True)
    gate.make(
        [
            PORT / "cc",
            MACHINES[machine],
            *FLAGS,
            "-O2",
            "-Wall",
            "-Wextra",
            "-fno-strict-aliasing",
            f"-I{source}",
            f"-I{PORT}",
            "-o",
            elf,
            gate.HERE / "preempt.c",
            source / "small.c",
            source / "small_params.c",
            *SOURCES,
            pen_set,
        ]
    )
    return elf


def main() -> int:
    good, figures = True, {}
    for machine in CORES:
        elf = program(machine, "right", SET)
        said, code, met = interrupted(WORK, machine, elf)
        problems = [said] if code != 0 else []
        seen = dict(re.findall(r"^(calls|steps) interrupted (\d+)$", said, re.M))
        row: dict[str, object] = {"runs": {key: int(value) for key, value in seen.items()}, "failures": int(code != 0)}
        for what, function, pcs in (("calls", "the_call", met[0]), ("steps", "the_step", met[1])):
            must = executed(WORK, machine, elf, function)
            row[f"addresses of {what}"] = {"executed": len(must), "interrupted": len(must & pcs)}
            problems += never(what, must, pcs)
        total = sum(row["runs"].values())
        good &= gate.report(f"preempt: {machine}: a step in a call, a call in a step, at each of {total} boundaries", problems)
        figures[machine] = row
    missed, model = [], layered()
    for k, (fault, change) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}.c"
        copy.write_text(gate.faulty(SET.read_text(), change))
        missed += [f"not found: {fault}"] if interrupted(WORK, "m4f", program("m4f", f"fault{k}", copy, model))[1] == 0 else []
    good &= gate.report(f"preempt: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults of the protocol found", missed)
    gate.keep("preempt", figures | {"faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
