# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Gate: what `make misra` and `make symbols` find, counted; no rule is switched off; what is put in is found."""

from __future__ import annotations

import re
import shutil
import sys
from pathlib import Path

import gate

from penode_sil.targets import MACHINES

WORK = gate.BUILD / "rules"
FAULTS = {
    "a function of the C library": "#include <math.h>\nfloat f(float x) { return expf(x); }",
    "memory from the heap": "#include <stdlib.h>\nvoid *f(size_t n) { return malloc(n); }",
    "a large struct copied at once": "typedef struct { int i[99]; } t;\nvoid f(t *a, const t *b) { *a = *b; }",
    "double on an FPU for floats": "double f(double x) { return x * x; }",
}  # each needs a name that it does not define
# What would keep cppcheck from saying something: a comment, code that it does not see, an option but the two that are no rules.
OFF = re.compile(
    r"cppcheck-suppress|__cppcheck__|--inline-suppr|--suppressions-list|--suppress-xml|--disable=|--file-filter"
    r"|--suppress=(?!(?:missingIncludeSystem|checkersReport)(?:\s|$))",
    re.IGNORECASE,
)
OFF_FAULTS = (
    "/* cppcheck-suppress misra-c2012-15.5 */",
    "#ifndef __cppcheck__",
    "--inline-suppr",
    "--suppressions-list=list.txt",
    "--disable=style",
    "--suppress=misra-c2012-8.9",
    "--suppress=checkersReport* --suppress=*:src/pen_set.c",
    "--file-filter=src/pen_set.c",
)
# All that cppcheck reads, and all that says how: folder, and which files of it.
READ = {
    "src": "*.[ch]",
    "inc": "*.h",
    "port": "*.[ch]",
    "gen/nqvm/c": "*.[ch]",
    "gen/penode_gen/emission/templates": "*.j2",
    "sil/firmware": "*.[ch]",
    "test/misra": "*[!c]",
    "test": "test.mk",
}


def suite(name: str, least: int) -> tuple[int, list[str], list[str]]:
    """Result of a suite of `make test`: how many checks were good, what is wrong with it, and what bad checks said, line by line.

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


def read(root: Path, folder: str) -> list[Path]:
    """The files of one of the folders."""
    return [path for path in sorted((root / folder).rglob(READ[folder])) if path.is_file()]


def switched_off(root: Path) -> tuple[int, list[str]]:
    """How many files under a root are read, and where they switch a rule off, or are not there."""
    found, files = [], 0
    for folder, pattern in READ.items():
        own = read(root, folder)
        files += len(own)
        found += [] if own else [f"{folder}: there is no {pattern}"]
        for path in own:
            lines = enumerate(path.read_text().splitlines(), 1)
            found += [f"{path.relative_to(root)}:{n}: {line.strip()}" for n, line in lines if OFF.search(line)]
    return files, found


def unnoticed() -> list[str]:
    """Faults that are put into the first and the last file of each folder of a copy, and folders taken away, and not found."""
    copy, missed = WORK / "copy", []
    shutil.rmtree(copy, ignore_errors=True)
    for folder in READ:
        for path in read(gate.ROOT, folder):
            target = copy / path.relative_to(gate.ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(path, target)
    for folder, pattern in READ.items():
        texts = {path: path.read_text() for path in read(copy, folder)}
        for path in (min(texts), max(texts)):
            for fault in OFF_FAULTS:
                path.write_text(f"{texts[path]}{fault}\n")
                missed += [] if switched_off(copy)[1] else [f"not found: {fault} in {path.relative_to(copy)}"]
            path.write_text(texts[path])
        missed += [f"found without a fault: {line}" for line in switched_off(copy)[1]]
        for path in texts:
            path.unlink()
        missed += [] if switched_off(copy)[1] else [f"not found: no {pattern} in {folder}"]
        for path, text in texts.items():
            path.write_text(text)
    return missed


def needs_a_name(code: str) -> bool:
    """Does test/symbols refuse this C on a Cortex-M4F?"""
    source = WORK / "fault.c"
    source.write_text(code + "\n")
    compiler = [gate.ROOT / "port" / "cortex-m" / "cc", MACHINES["m4f"], "-std=c99", "-O2"]
    done = gate.run([gate.ROOT / "test" / "symbols", "", *compiler, source])
    return done.returncode != 0 and done.stdout.strip() != ""


def main() -> int:
    WORK.mkdir(parents=True, exist_ok=True)
    models = len(list((gate.ROOT / "gen" / "nqvm" / "c").glob("*_selftest.c")))
    checks, bad, found = suite("misra", models + 4)  # each model, twice what GCC alone sees, the canary, the table
    programs, more, others = suite("misra-long", models)  # each model with the whole runtime
    bad, found, programs = bad + more, found + others, programs + checks - 3
    canary = gate.run([gate.ROOT / "test" / "misra" / "check", "canary", gate.ROOT / "test" / "misra" / "canary.c"])
    broken = int(re.match(r"(\d+) rules", canary.stdout)[1])
    table = gate.run([sys.executable, gate.ROOT / "test" / "misra" / "table.py"]).stdout
    rules, by_addon = re.match(r"(\d+) rules .* (\d+) of them", table).groups()
    files, suppressed = switched_off(gate.ROOT)
    good = gate.report(f"rules: MISRA: {len(found)} findings in {programs} readings, a bad file breaks {broken} rules", bad + found)
    good &= gate.report(f"rules: {len(suppressed)} places in {files} files switch a rule off", suppressed)
    missed = unnoticed()
    missed += [] if suite("no-such-suite", 0)[1] else ["not found: a suite that stops"]
    missed += [] if suite("help", 1)[1] else ["not found: a suite without checks"]
    good &= gate.report("rules: what switches a rule off or stops a suite is found", missed)
    builds, bad, outside = suite("symbols", 3 * (len(MACHINES) + 1))  # levels; each core, the host with gcc and with clang
    good &= gate.report(f"rules: {len(outside)} names from outside in {builds} builds", bad + outside)
    missed = [f"not found: {fault}" for fault, code in FAULTS.items() if not needs_a_name(code)]
    good &= gate.report(f"rules: {len(FAULTS) - len(missed)} of {len(FAULTS)} names from outside found", missed)
    gate.keep(
        "rules",
        {
            "readings": programs,
            "findings": len(found),
            "suppressed": len(suppressed),
            "broken by the bad file": broken,
            "rules": int(rules),
            "by the addon": int(by_addon),
            "builds": builds,
            "names from outside": len(outside),
            "faults": list(FAULTS),
            "faults found": len(FAULTS) - len(missed),
        },
    )
    return int(not good)


if __name__ == "__main__":
    sys.exit(main())
