# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a step and a packet to the XCP slave that pre-empt each other at any instruction tear no set and no sample."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import gate

import penode_gen
from penode_sil.targets import FLAGS, MACHINES, PORT, generated

WORK = gate.BUILD / "xcp-preempt"
MACHINE = "m4f"

# Faults of the slave: file, and what gate.faulty makes of it.
FAULTS = {
    "a set that waits is taken for one that runs": ("pen_xcp_cal.c", ("pen_tuning_settle(tuning) ?", 0, "true ?")),
    "a sample can be sent before it is whole": ("pen_xcp_daq.c", ("        uint32_t n = 2U;\n        if (list->mode", 0, "        uint32_t n = 2U;\n        pen_port_store(&daq->head, (head + 1U) % daq->slots);\n        if (list->mode")),
    "lists change while a sample is taken": ("pen_xcp_daq.c", ("pen_port_store(&daq->busy, 1U);", 0, "")),
    "lists change while they run": ("pen_xcp_daq.c", ("    if (code == 0xd6U) {", 0, "    if (false) {")),
}  # fmt: skip


def program(name: str, replaced: dict[str, Path]) -> Path:
    """xcp_preempt.c with a model called small and the runtime; files by name from other places."""
    source = generated(penode_gen.load(gate.HERE / "small" / "small.toml"))
    elf = WORK / f"{name}.elf"
    elf.parent.mkdir(parents=True, exist_ok=True)
    runtime = [replaced.get(path.name, path) for path in sorted((gate.ROOT / "src").glob("*.c"))]
    gate.make(
        [PORT / "cc", MACHINES[MACHINE], *FLAGS, "-O2", "-Wall", "-Wextra", "-fno-strict-aliasing", f"-I{source}", f"-I{PORT}",
         "-o", elf, gate.HERE / "xcp_preempt.c", source / "small.c", source / "small_params.c", *runtime]
    )  # fmt: skip
    return elf


def interrupted(elf: Path) -> tuple[str, int]:
    """What the program says, and its exit code."""
    done = gate.run([PORT / "run", MACHINES[MACHINE], elf], WORK, env=os.environ | {"SHIFT": "10", "LIMIT": "300"})
    return done.stdout + done.stderr, done.returncode


def main() -> int:
    said, code = interrupted(program("right", {}))
    seen = {key: int(value) for key, value in re.findall(r"^(packets|steps) interrupted (\d+)$", said, re.M)}
    good = gate.report(f"xcp-preempt: a step in a packet, a packet in a step, at each of {sum(seen.values())} boundaries", [said] if code != 0 else [])
    missed = []
    for k, (fault, (file, change)) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}-{file}"
        copy.write_text(gate.faulty((gate.ROOT / "src" / file).read_text(), change))
        missed += [f"not found: {fault}"] if interrupted(program(f"fault{k}", {file: copy}))[1] == 0 else []
    good &= gate.report(f"xcp-preempt: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults of the slave found", missed)
    gate.keep("xcp-preempt", {"runs": seen, "failures": int(code != 0), "faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
