# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a step and a packet to the XCP slave that pre-empt each other at any instruction tear no set and no sample."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import gate
from interruption import executed, interrupted, never

import penode_gen
from penode_sil.building import FLAGS, generated
from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "xcp-preempt"
MACHINE = "m4f"

# Faults of the slave: file, and what gate.faulty makes of it.
FAULTS = {
    "a set that waits is taken for one that runs": ("pen_xcp_cal.c", ("pen_tuning_settle(tuning) ?", 0, "true ?")),
    "a sample can be sent before it is whole": (
        "pen_xcp_daq.c",
        (
            "        uint32_t n = 2U;\n        if (list->mode",
            0,
            "        uint32_t n = 2U;\n        pen_port_store(&daq->head, (head + 1U) % daq->slots);\n        if (list->mode",
        ),
    ),
    "lists change while a sample is taken": ("pen_xcp_daq.c", ("pen_port_store(&daq->busy, 1U);", 0, "")),
    "lists change while they run": ("pen_xcp_daq.c", ("    if (code == 0xd6U) {", 0, "    if (false) {")),
}


def program(name: str, replaced: dict[str, Path], *options: str) -> Path:
    """xcp_preempt.c with a model called small and the runtime; files by name from other places; options of the compiler."""
    source = generated(penode_gen.load(gate.HERE / "small" / "small.toml"))
    elf = WORK / f"{name}.elf"
    elf.parent.mkdir(parents=True, exist_ok=True)
    runtime = [replaced.get(path.name, path) for path in sorted((gate.ROOT / "src").glob("*.c"))]
    gate.make(
        [
            PORT / "cc",
            MACHINES[MACHINE],
            *FLAGS,
            "-O2",
            "-Wall",
            "-Wextra",
            "-fno-strict-aliasing",
            f"-I{source}",
            f"-I{PORT}",
            *options,
            "-o",
            elf,
            gate.HERE / "xcp_preempt.c",
            source / "small.c",
            source / "small_params.c",
            *runtime,
        ]
    )
    return elf


def main() -> int:
    right = program("right", {})
    said, code, met = interrupted(WORK, MACHINE, right)
    coarse = interrupted(WORK, MACHINE, program("coarse", {}, "-DTICKS=80U"))[2]  # every fourth instruction or so
    addresses, problems, seeded = {}, [said] if code != 0 else [], []
    for n, (what, function) in enumerate((("packets", "the_call"), ("steps", "the_sample"))):
        must = executed(WORK, MACHINE, right, function)
        addresses[what] = {"executed": len(must), "interrupted": len(must & met[n])}
        problems += never(what, must, met[n])
        seeded += [] if never(what, must, coarse[n]) else [f"{what}: boundaries that were left out are not noticed"]
    seen = {key: int(value) for key, value in re.findall(r"^(packets|steps) interrupted (\d+)$", said, re.M)}
    good = gate.report(f"xcp-preempt: a step in a packet, a packet in a step, at each of {sum(seen.values())} boundaries", problems)
    good &= gate.report("xcp-preempt: boundaries that are left out are found", seeded)
    missed = []
    for k, (fault, (file, change)) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}-{file}"
        copy.write_text(gate.faulty((gate.ROOT / "src" / file).read_text(), change))
        missed += [f"not found: {fault}"] if interrupted(WORK, MACHINE, program(f"fault{k}", {file: copy}))[1] == 0 else []
    good &= gate.report(f"xcp-preempt: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults of the slave found", missed)
    gate.keep(
        "xcp-preempt",
        {
            "runs": seen,
            "addresses": addresses,
            "failures": int(code != 0),
            "faults": list(FAULTS),
            "faults found": len(FAULTS) - len(missed),
        },
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
