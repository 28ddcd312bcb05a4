# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: what `make misra` and `make symbols` find, counted; names from outside that are put in are found."""

from __future__ import annotations

import re
import sys

import gate
from penode_sil.targets import MACHINES

WORK = gate.BUILD / "rules"
FAULTS = {
    "a function of the C library": "#include <math.h>\nfloat f(float x) { return expf(x); }",
    "memory from the heap": "#include <stdlib.h>\nvoid *f(size_t n) { return malloc(n); }",
    "a large struct copied at once": "typedef struct { int i[99]; } t;\nvoid f(t *a, const t *b) { *a = *b; }",
    "double on an FPU for floats": "double f(double x) { return x * x; }",
}  # each needs a name that it does not define


def suite(name: str) -> tuple[int, list[str], list[str]]:
    """Of a suite of `make test`: how many checks were good, those that were not, and what these said, line by line."""
    said = gate.run(["make", "--no-print-directory", "-k", name], limit=3600).stdout.splitlines()
    bad = [line for line in said if line.startswith("FAIL")]
    return sum(line.startswith("ok  ") for line in said), bad, [line for line in said if line.startswith("    ")]


def needs_a_name(code: str) -> bool:
    """Does test/symbols refuse this C on a Cortex-M4F?"""
    source = WORK / "fault.c"
    source.write_text(code + "\n")
    compiler = [gate.ROOT / "port" / "cortex-m" / "cc", MACHINES["m4f"], "-std=c99", "-O2"]
    done = gate.run([gate.ROOT / "test" / "symbols", "", *compiler, source])
    return done.returncode != 0 and done.stdout.strip() != ""


def main() -> int:
    WORK.mkdir(parents=True, exist_ok=True)
    checks, bad, found = suite("misra")
    programs = checks - 2  # with the canary and the table
    canary = gate.run([gate.ROOT / "test" / "misra" / "check", "canary", gate.ROOT / "test" / "misra" / "canary.c"])
    broken = int(re.match(r"(\d+) rules", canary.stdout)[1])
    table = gate.run([sys.executable, gate.ROOT / "test" / "misra" / "table.py"]).stdout
    rules, by_addon = re.match(r"(\d+) rules .* (\d+) of them", table).groups()
    sources = [path for folder in ("src", "inc", "port", "gen/nqvm/c") for path in (gate.ROOT / folder).rglob("*.[ch]")]
    suppressed = sum(path.read_text().count("cppcheck-suppress") for path in sources)
    good = gate.report(f"rules: MISRA: {len(found)} findings in {programs} readings of whole programs, a bad file breaks {broken} rules", bad + found)
    builds, bad, outside = suite("symbols")
    good &= gate.report(f"rules: {len(outside)} names from outside in {builds} builds", bad + outside)
    missed = [f"not found: {fault}" for fault, code in FAULTS.items() if not needs_a_name(code)]
    good &= gate.report(f"rules: {len(FAULTS) - len(missed)} of {len(FAULTS)} names from outside found", missed)
    gate.keep("rules", {"readings": programs, "findings": len(found), "suppressed": suppressed, "broken by the bad file": broken,
                        "rules": int(rules), "by the addon": int(by_addon), "builds": builds, "names from outside": len(outside),
                        "faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})  # fmt: skip
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
