# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a bit that flips in an instance or in its banks never makes it write beside them or hang; how often it is told."""

from __future__ import annotations

import argparse
import os
import re
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import gate
import penode_gen
from penode_sil.targets import FLAGS, generated, model_options

WORK = gate.BUILD / "flip"
MODELS = ("nqvm", "nqvm_folded")
SET = gate.ROOT / "src" / "pen_set.c"
EVERY = 101  # bits of the banks, and ten times as many of the instance

# Faults of pen_set.c: see gate.faulty.
FAULTS = {
    "an address is written to unchecked": ("(tuning->bank[0] == tuning->bank_again[0]) &&", 0, ""),
    "waits instead of saying that a set waits": ("    pen_port_barrier();\n    return done;", 0, "    while (pen_port_load(&tuning->pending) != NO) {\n    }\n    return done;"),
}  # fmt: skip


def campaign(name: str, every: int = EVERY, pen_set: Path = SET) -> tuple[int, str]:
    """Exit code and words of flip.c for a model of gen/nqvm."""
    model, elf = penode_gen.load(gate.ROOT / "gen" / "nqvm" / f"{name}.toml"), WORK / f"{name}-{pen_set.stem}"
    source, sets = generated(model), ",".join(f"&{name}_set_{other}" for other in model.sets)
    elf.parent.mkdir(parents=True, exist_ok=True)
    sources = [path for path in sorted((gate.ROOT / "src").glob("*.c")) if path != SET]
    gate.make(
        ["clang-19", "-fsanitize=address", "-fsanitize-recover=address", *FLAGS, "-D_GNU_SOURCE", "-O2", "-g", "-Wall", "-Wextra",
         f"-I{gate.ROOT}/inc", f"-I{gate.ROOT}/port/gnu", f"-I{source}", *model_options(model), f"-DMODEL_SETS={sets}", "-o", elf,
         gate.HERE / "flip.c", source / f"{name}.c", source / f"{name}_params.c", *sources, pen_set]
    )  # fmt: skip
    options = "halt_on_error=0:handle_segv=0:handle_sigbus=0:detect_leaks=0"
    done = gate.run([elf, every], limit=100_000, env=os.environ | {"ASAN_OPTIONS": options})
    return done.returncode, done.stdout + done.stderr


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--every", type=int, default=EVERY, help="which bits: 1 is all")
    options.add_argument("--as", dest="key", default="flip", help="key in figures.json")
    given = options.parse_args()
    problems, figures, total = [], {}, 0
    with ThreadPoolExecutor() as pool:
        results = list(pool.map(lambda name: campaign(name, given.every), MODELS))
    for name, (code, said) in zip(MODELS, results, strict=True):
        counts = {what: int(n) for what, n in re.findall(r"^([a-z ]+): (\d+)$", said, re.M)}
        total += sum(counts.values())
        figures[name] = counts
        problems += [f"{name}:\n{said}"] if code or not counts else []
    good = gate.report(f"flip: {total} flipped bits: no write outside, no hang", problems)
    missed = []
    for k, (fault, change) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}.c"
        copy.write_text(gate.faulty(SET.read_text(), change))
        missed += [] if campaign("nqvm", pen_set=copy)[0] else [f"not found: {fault}"]
    good &= gate.report(f"flip: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    gate.keep(given.key, figures | {"faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
