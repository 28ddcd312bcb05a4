# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: two threads, one that steps and one that tunes: ThreadSanitizer sees no race, and no step is torn."""

from __future__ import annotations

import argparse
import os
import re
import sys
from pathlib import Path

import gate

import penode_gen
from penode_sil.building import FLAGS, generated, model_options

WORK = gate.BUILD / "tsan"
SET = gate.ROOT / "src" / "pen_set.c"
SOURCES = [path for path in sorted((gate.ROOT / "src").glob("*.c")) if path != SET]
RACE = 66  # exit code of ThreadSanitizer
WRITE, STORE = "    pen_set_copy(&tuning->slot[slot], ready);\n", "    pen_port_store(&tuning->pending, tuning->published);\n"
LATE = re.search(re.escape(WRITE) + "(.*?)" + re.escape(STORE), SET.read_text(), re.S)
FAULTS = {
    "begin while a set waits": ("    return done;", 0, "    return done || true;"),
    "slot written after pending": (LATE[0], 0, LATE[1] + STORE + WRITE) if LATE else (WRITE + STORE, 0, ""),
    "active not flipped": ("            active = other;", 0, ""),
    "withdrawn by the tuning context itself": (
        "pen_port_store(&tuning->pending, command(WITHDRAW, slot));",
        0,
        "pen_port_store(&tuning->pending, 0U);",
    ),
}  # of pen_set.c: see gate.faulty


def torture(model: str, sets: int, port: str = "gnu", pen_set: Path = SET, limit: float = 120) -> tuple[int, str]:
    """Exit code and words of tsan.c for a model of small/, a port and a pen_set.c; 124 if it is not done within `limit` seconds."""
    loaded = penode_gen.load(gate.HERE / "small" / f"{model}.toml")
    source, elf = generated(loaded), WORK / f"{model}-{port}-{pen_set.stem}"
    elf.parent.mkdir(parents=True, exist_ok=True)
    gate.make(
        [
            "clang-19",
            "-fsanitize=thread",
            *FLAGS,
            "-D_GNU_SOURCE",
            "-O2",
            "-g",
            "-pthread",
            f"-I{gate.ROOT}/inc",
            f"-I{gate.ROOT}/port/{port}",
            f"-I{source}",
            *model_options(loaded),
            "-o",
            elf,
            gate.HERE / "tsan.c",
            source / f"{model}.c",
            source / f"{loaded.owner}_params.c",
            *SOURCES,
            pen_set,
        ]
    )
    done = gate.run([elf, sets], limit=limit, env=os.environ | {"TSAN_OPTIONS": "halt_on_error=1"})
    return done.returncode, done.stdout + done.stderr


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--sets", type=int, default=100_000)
    sets = options.parse_args().sets
    good, figures = True, {}
    for model in ("small", "small_layers"):
        code, said = torture(model, sets, limit=3600)
        counts = [int(n) for n in re.findall(r"(\d+) (?:adopted|steps|torn|withdrawn)", said)]
        good &= gate.report(
            f"tsan: {model}: {sets} sets, no race, none torn, lost or out of order",
            [said] if code or counts[:1] != [sets] or counts[3:] == [0] else [],
        )
        figures[model] = {
            "sets": sets,
            "races": int(code == RACE),
            "torn": counts[2] if len(counts) == 4 else None,
            "withdrawn": counts[3] if len(counts) == 4 else None,
        }
    faults = {"plain volatile instead of the port's atomic words": torture("small_layers", 2000, "template")[0]}
    for k, (fault, change) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}.c"
        copy.write_text(gate.faulty(SET.read_text(), change))
        faults[fault] = torture("small_layers", 2000, pen_set=copy)[0]
    missed = [f"not found: {fault}" for fault, code in faults.items() if code == 0]
    good &= gate.report(f"tsan: {len(faults) - len(missed)} of {len(faults)} faults found", missed)
    gate.keep("tsan", figures | {"faults": list(faults), "faults found": len(faults) - len(missed)})
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
