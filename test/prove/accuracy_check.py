# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: exp, tanh, sigmoid and softplus are as near as pen_math.h says, and monotone, at every STRIDE-th float."""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import gate

WORK = gate.BUILD / "accuracy"
SOURCE = gate.ROOT / "src" / "pen_math.c"
FUNCTIONS = ("pen_exp", "pen_tanh", "pen_sigmoid", "pen_softplus")
HEADER = gate.ROOT / "inc" / "penode" / "pen_math.h"

# Faults of pen_math.c: see gate.faulty.
FAULTS = {
    "a digit of a coefficient is lost": ("-0.4999999F", 0, "-0.499999F"),
    "the two ways to tanh meet too early": ("((pen_real_t)0.625)", 0, "((pen_real_t)0.3)"),
    "NaN is taken for a limit": ("(x < low) ? low : x", 0, "(x > low) ? x : low"),
    "infinity comes too early": ("#define EXP_HIGH      89.0F", 0, "#define EXP_HIGH      88.0F"),
}


def measure(stride: int, source: Path = SOURCE) -> tuple[int, int, dict[str, dict[str, float]]]:
    """Inputs, NaN failures, and for each function its largest error in ulp and how often it is not monotone."""
    WORK.mkdir(parents=True, exist_ok=True)
    elf = WORK / source.stem
    gate.make(
        [
            "gcc",
            "-std=c99",
            "-O2",
            "-ffp-contract=off",
            "-pthread",
            f"-I{gate.ROOT}/inc",
            f"-I{gate.ROOT}/port/gnu",
            "-o",
            elf,
            gate.ROOT / "test" / "accuracy" / "pen_math_accuracy.c",
            source,
            "-lm",
        ]
    )
    said = gate.run([elf, stride, 2], limit=7200).stdout
    inputs, bad = re.search(r"^(\d+) inputs, NaN failures (\d+)", said, re.M).groups()
    rows = re.findall(r"^(\w+) +max error ([\d.]+) ulp .*not monotone at (\d+)", said, re.M)
    seen = {name: {"ulp": float(ulp), "not monotone": int(falls)} for name, ulp, falls in rows}
    return int(inputs), int(bad), seen


def beyond(bad: int, seen: dict[str, dict[str, float]]) -> list[str]:
    """What pen_math.h does not say of these errors."""
    promised = dict(re.findall(r"^ \* +(pen_\w+) +([\d.]+) +[\d.]+ +\d+ /", HEADER.read_text(), re.M))
    found = [f"NaN did not give NaN, {bad} times"] if bad else []
    for name in FUNCTIONS:
        ulp = round(seen[name]["ulp"], 2)
        found += [] if ulp <= float(promised[name]) else [f"{name}: {ulp} ulp, {promised[name]} promised"]
        found += [f"{name}: not monotone"] if seen[name]["not monotone"] else []
    return found


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--stride", type=int, default=64)
    options.add_argument("--as", dest="key", default="accuracy", help="key in figures.json")
    given = options.parse_args()
    inputs, bad, seen = measure(given.stride)
    good = gate.report(f"accuracy: {', '.join(FUNCTIONS)} at {inputs} floats: as the header says", beyond(bad, seen))
    missed = []
    for k, (fault, change) in enumerate(FAULTS.items()):
        copy = WORK / f"fault{k}.c"
        copy.write_text(gate.faulty(SOURCE.read_text(), change))
        missed += [] if beyond(*measure(4096, copy)[1:]) else [f"not found: {fault}"]
    good &= gate.report(f"accuracy: {len(FAULTS) - len(missed)} of {len(FAULTS)} faults found", missed)
    faults = {"faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)}
    gate.keep(given.key, {"inputs": inputs, "NaN lost": bad} | seen | faults)
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
