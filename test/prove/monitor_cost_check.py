# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: a step of a monitor takes, on a Cortex-M4F, the same instructions whatever is measured, and those that gen/README.md states.

One cause, four states, two measurements. The last faults are branches on what is measured or found: each has to be found.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import gate
from ekf_cost_check import PAGE, SHARE, compiler

import penode_gen
from penode_sil.building import FLAGS
from penode_sil.targets import MACHINES, PORT

WORK = gate.BUILD / "monitor-cost"
SOURCE = gate.ROOT / "src" / "pen_monitor.c"
KINDS = ("measured", "not offered", "missing", "holding", "raised")
LEVELS = ("-O2", "-Os")

# Faults of pen_monitor.c: see gate.faulty.
FAULTS = {
    "a measurement that is not used takes a shorter way": (
        "        pen_real_t mean = direct[i];",
        0,
        "        pen_real_t mean = direct[i];\n        if (!used) { continue; }",
    ),
    "a sum at the threshold takes a shorter way": (
        "    const uint32_t up = (sum >= model->threshold) ? 1U : 0U;",
        0,
        "    const uint32_t up = (sum >= model->threshold) ? 1U : 0U;\n    if (up > 0U) { return 1U; }",
    ),
}


def measured(level: str, source: Path = SOURCE, machine: str = "m4f") -> dict[str, tuple[int, int]]:
    """Least and most instructions by kind of sample; bytes of the monitor. SystemExit if one is not of its kind."""
    place = WORK / "model"
    place.mkdir(parents=True, exist_ok=True)
    penode_gen.generate(penode_gen.load(gate.ROOT / "test" / "filter" / "models" / "monitored.toml"), place, self_test=False)
    runtime = [source if path == SOURCE else path for path in sorted((gate.ROOT / "src").glob("*.c"))]
    code = [place / f"monitored{part}.c" for part in ("", "_ekf", "_monitor", "_params")]
    elf = WORK / f"cost{level}-{machine}.elf"
    gate.make([*compiler(machine), *FLAGS, level, f"-I{place}", "-o", elf, *runtime, *code, gate.HERE / "ekf" / "monitor_cost.c"])
    done = gate.run([PORT / "run", MACHINES[machine], elf] if MACHINES[machine] else [elf])
    rows = {name: (int(a), int(b)) for name, a, b in re.findall(r"^(.+) (\d+) (\d+)$", done.stdout, re.M)}
    if done.returncode != 0 or rows.get("wrong") != (0, 0):
        raise SystemExit(f"FAIL  monitor-cost: {done.stdout}{done.stderr}")
    return rows


def spread(rows: dict[str, tuple[int, int]]) -> list[str]:
    """Kinds of samples that do not take what the first one takes."""
    wanted = rows[KINDS[0]][0]
    return [f"{kind}: {rows[kind]}, a measured sample {wanted}" for kind in KINDS if rows[kind] != (wanted, wanted)]


def stated() -> tuple[int, int]:
    """What the page says: -O2, -Os."""
    found = re.search(
        r"^A step of this monitor takes ([\d ]+) instructions \(-O2\), ([\d ]+) \(-Os\)", PAGE.read_text(encoding="utf-8"), re.M
    )
    return (int(found[1].replace(" ", "")), int(found[2].replace(" ", ""))) if found else (0, 0)


def main() -> int:
    found = {level: measured(level) for level in LEVELS}
    uneven = [f"{level}: {line}" for level, rows in found.items() for line in spread(rows)]
    good = gate.report(f"monitor-cost: the same instructions for {len(KINDS)} kinds of samples, in {len(found)} builds", uneven)
    counts, said = tuple(rows[KINDS[0]][0] for rows in found.values()), stated()
    wrong = [f"{counts}, the page says {said}"] * any(abs(a - b) > SHARE * b for a, b in zip(counts, said, strict=True))
    good &= gate.report("monitor-cost: those that gen/README.md states", wrong)
    bits = {machine: measured("-O2", machine=machine)["bits"] for machine in MACHINES}
    good &= gate.report(f"monitor-cost: the same bits on {len(bits)} machines", [str(bits)] if len(set(bits.values())) > 1 else [])
    missed = []
    for k, (fault, change) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}.c"
        copy.write_text(gate.faulty(SOURCE.read_text(), change))
        missed += [] if spread(measured("-O2", copy)) else [f"not found: {fault}"]
    good &= gate.report(f"monitor-cost: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    figures: dict[str, object] = dict(zip(LEVELS, counts, strict=True))
    figures |= {"bytes": found["-O2"]["struct"][0], "faults": len(FAULTS), "faults found": len(FAULTS) - len(missed)}
    gate.keep("monitor-cost", figures)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
