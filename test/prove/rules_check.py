# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: what `make misra` and `make symbols` find, counted; no rule is switched off; what is put in is found."""

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


# What would keep cppcheck from saying something: a comment, or an option of its call but the two that are no rules.
OFF = re.compile(r"cppcheck-suppress|--inline-suppr|--suppressions-list|--suppress-xml|--suppress=(?!missingIncludeSystem\b|checkersReport\b)")
OFF_FAULTS = ["/* cppcheck-suppress misra-c2012-15.5 */", "cppcheck --suppress=misra-c2012-8.9", "--inline-suppr", "--suppressions-list=list.txt"]


def suite(name: str, least: int) -> tuple[int, list[str], list[str]]:
    """Of a suite of `make test`: how many checks were good, what is wrong with it, and what bad checks said, line by line.

    A suite that stops, or has fewer checks than `least`, is bad whatever it says.
    """
    done = gate.run(["make", "--no-print-directory", "-k", name], limit=3600)
    said = done.stdout.splitlines()
    good, bad = sum(line.startswith("ok  ") for line in said), [line for line in said if line.startswith("FAIL")]
    if done.returncode != 0 and not bad:
        bad = [f"make {name} stopped: {done.stderr.strip()[-500:]}"]
    if good + len(bad) < least:
        bad.append(f"make {name} has {good + len(bad)} checks, there should be {least} at least")
    return good, bad, [line for line in said if line.startswith("    ")]


def switched_off(name: str, text: str) -> list[str]:
    """Where a text switches a rule off."""
    return [f"{name}:{n}: {line.strip()}" for n, line in enumerate(text.splitlines(), 1) if OFF.search(line)]


def needs_a_name(code: str) -> bool:
    """Does test/symbols refuse this C on a Cortex-M4F?"""
    source = WORK / "fault.c"
    source.write_text(code + "\n")
    compiler = [gate.ROOT / "port" / "cortex-m" / "cc", MACHINES["m4f"], "-std=c99", "-O2"]
    done = gate.run([gate.ROOT / "test" / "symbols", "", *compiler, source])
    return done.returncode != 0 and done.stdout.strip() != ""


def main() -> int:
    WORK.mkdir(parents=True, exist_ok=True)
    models = len(list((gate.ROOT / "gen" / "nqvm" / "c").glob("*.h")))
    checks, bad, found = suite("misra", 2 * models + 2)  # each model with and without __GNUC__, the canary, the table
    programs = checks - 2
    canary = gate.run([gate.ROOT / "test" / "misra" / "check", "canary", gate.ROOT / "test" / "misra" / "canary.c"])
    broken = int(re.match(r"(\d+) rules", canary.stdout)[1])
    table = gate.run([sys.executable, gate.ROOT / "test" / "misra" / "table.py"]).stdout
    rules, by_addon = re.match(r"(\d+) rules .* (\d+) of them", table).groups()
    sources = [path for folder in ("src", "inc", "port", "gen/nqvm/c", "sil/firmware") for path in (gate.ROOT / folder).rglob("*.[ch]")]
    sources += [gate.ROOT / "test" / "misra" / "check", gate.ROOT / "test" / "test.mk", *(gate.ROOT / "gen" / "penode_gen" / "templates").iterdir()]
    suppressed = [line for path in sources for line in switched_off(str(path.relative_to(gate.ROOT)), path.read_text())]
    good = gate.report(f"rules: MISRA: {len(found)} findings in {programs} readings of whole programs, a bad file breaks {broken} rules", bad + found)
    good &= gate.report(f"rules: {len(suppressed)} places in {len(sources)} files switch a rule off", suppressed)
    missed = [f"not found: {fault}" for fault in OFF_FAULTS if not switched_off("", fault)]
    missed += [] if suite("no-such-suite", 0)[1] else ["not found: a suite that stops"]
    missed += [] if suite("help", 1)[1] else ["not found: a suite without checks"]
    good &= gate.report("rules: what switches a rule off or stops a suite is found", missed)
    builds, bad, outside = suite("symbols", 3 * (len(MACHINES) + 1))  # levels; each core, the host with gcc and with clang
    good &= gate.report(f"rules: {len(outside)} names from outside in {builds} builds", bad + outside)
    missed = [f"not found: {fault}" for fault, code in FAULTS.items() if not needs_a_name(code)]
    good &= gate.report(f"rules: {len(FAULTS) - len(missed)} of {len(FAULTS)} names from outside found", missed)
    gate.keep("rules", {"readings": programs, "findings": len(found), "suppressed": len(suppressed), "broken by the bad file": broken,
                        "rules": int(rules), "by the addon": int(by_addon), "builds": builds, "names from outside": len(outside),
                        "faults": list(FAULTS), "faults found": len(FAULTS) - len(missed)})  # fmt: skip
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
