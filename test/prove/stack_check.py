# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: on each core each entry of a model keeps within a bound of its stack, known from its machine code."""

from __future__ import annotations

import re
import sys

import gate
import numpy as np

sys.path.insert(0, str(gate.ROOT / "test" / "bench"))
import programs

import penode_gen
from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "stack"
SOURCE = gate.HERE / "stack.c"
CALLS = re.findall(r"call_\w+", re.search(r"call\[\]\)\(void\) = \{(.*?)\}", SOURCE.read_text(), re.S)[1])
FAULTS = {
    "recursion": "int f(int n) { return (n > 0) ? n * f(n - 1) + f(n - 2) : 1; }",
    "a call through a pointer": "int f(int n, int (*g)(int)) { return g(n) + 1; }",
    "a frame of variable size": "void g(char *); void f(int n) { char c[n]; g(c); }\nvoid g(char *c) { *(volatile char *)c = 1; }",
}  # each must be refused: it has no bound


def refused(fault: str, code: str) -> bool:
    """Is there no bound for a function f of this C?"""
    source, elf = WORK / f"{fault.split()[-1]}.c", WORK / f"{fault.split()[-1]}.elf"
    source.write_text(code + "\nint main(void) { return 0; }\n")
    gate.make([PORT / "cc", MACHINES["m4f"], "-O1", "-Wl,-uf", "-Wl,--undefined=f", "-fno-inline", "-o", elf, source])
    try:
        programs.stack_bound(elf, "f")
    except ValueError:
        return True
    return False


def main() -> int:
    WORK.mkdir(parents=True, exist_ok=True)
    good, figures = True, {}
    models = [penode_gen.load(path) for path in sorted((gate.ROOT / "gen" / "nqvm").glob("*.toml"))]
    for machine in [name for name, board in MACHINES.items() if board]:
        problems, row = [], {}
        for model in models:
            for level in ("-O2", "-Os"):
                elf = programs.our_program(model, machine, (level,), SOURCE).elf
                programs.run(programs.Program(elf, "", [], machine), ["used"], WORK)
                painted = dict.fromkeys(CALLS, 0)
                for call, used in zip(CALLS, np.fromfile(WORK / "used", "<u4"), strict=True):
                    painted[call] = max(painted[call], int(used))
                bounds = {call: programs.stack_bound(elf, call) for call in painted}
                problems += [
                    f"{model.name} {level} {call}: {used} B used, bound {bounds[call]} B"
                    for call, used in painted.items()
                    if used > bounds[call]
                ]
                problems += [] if min(painted.values()) > 0 else [f"{model.name} {level}: nothing painted"]
                row[f"{model.name} {level}"] = {
                    name: {"bound": bounds[f"call_{name}"], "painted": painted[f"call_{name}"]}
                    for name in ("step", "step_jacobian", "tune_commit", "verify", "save", "restore")
                }
        good &= gate.report(f"stack: {machine}: {len(set(CALLS))} entries of {len(models)} models: painted within the bound", problems)
        figures[machine] = row
    missed = [f"has a bound: {fault}" for fault, code in FAULTS.items() if not refused(fault, code)]
    good &= gate.report(f"stack: {len(FAULTS) - len(missed)} of {len(FAULTS)} things without a bound refused", missed)
    gate.keep("stack", figures | {"faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
