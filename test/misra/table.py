# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The table in DEVIATIONS.md names every rule and directive once, and says "addon" exactly where cppcheck's addon checks.

Every gate that the table names must be a target of the Makefile. Exit code 1 with what is wrong, else one line of figures.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
# MISRA C:2012 with amendments 1 to 4, which is MISRA C:2023: how many each chapter has; and what the 2025 edition adds.
RULES = [5, 8, 2, 2, 9, 3, 6, 17, 7, 8, 10, 6, 6, 4, 7, 7, 13, 10, 2, 14, 26, 20, 8]
DIRECTIVES = [2, 1, 1, 15, 3]
LATER = ["8.18", "8.19", "11.11", "19.3"]


def numbers(chapters: list[int], prefix: str = "") -> list[str]:
    """All numbers of these chapters."""
    return [f"{prefix}{chapter}.{n}" for chapter, count in enumerate(chapters, 1) for n in range(1, count + 1)]


def addon() -> set[str]:
    """The rules for which the installed addon has a function."""
    (file,) = (ROOT / "build" / "venv").glob("lib/python3*/site-packages/cppcheck/Cppcheck/addons/misra.py")
    return {f"{a}.{b}" for a, b in re.findall(r"def misra_(\d+)_(\d+)\(", file.read_text())}


def table() -> list[tuple[list[str], str]]:
    """The rows: numbers, and by what they are checked."""
    rows = re.findall(r"^\| ((?:Dir )?\d[^|]*) \|[^|]*\| ([^|]*) \|$", (ROOT / "DEVIATIONS.md").read_text(), re.M)
    return [([("Dir " if cell.startswith("Dir") else "") + n for n in re.findall(r"\d+\.\d+", cell)], by) for cell, by in rows]


def targets() -> set[str]:
    """What make can be asked for."""
    files = [ROOT / "Makefile", *sorted((ROOT / "test").rglob("*.mk"))]
    return {m for file in files for m in re.findall(r"^([a-z][\w-]*):", file.read_text(), re.M)}


def main() -> int:
    rows = table()
    named = [n for numbers_of_row, _ in rows for n in numbers_of_row]
    all_of_them = numbers(RULES) + LATER + numbers(DIRECTIVES, "Dir ")
    by_addon = {n for numbers_of_row, by in rows if by.startswith("addon") for n in numbers_of_row}
    gates = {gate for _, by in rows for gate in re.findall(r"`make ([\w-]+)`", by)}
    problems = [f"missing: {n}" for n in all_of_them if n not in named]
    problems += [f"no such rule: {n}" for n in named if n not in all_of_them]
    problems += [f"twice: {n}" for n in sorted(set(named)) if named.count(n) > 1]
    problems += [f"the addon checks {n}, the table does not say so" for n in sorted(addon() - by_addon)]
    problems += [f"the addon does not check {n}" for n in sorted(by_addon - addon())]
    problems += [f"no such target: make {gate}" for gate in sorted(gates - targets())]
    print("\n".join(problems) or f"{len(named)} rules and directives, {len(by_addon)} of them checked by the addon")
    return int(bool(problems))


if __name__ == "__main__":
    sys.exit(main())
