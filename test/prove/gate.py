# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the gates here share: lines for test/tally.py, programs run with a limit, and figures.json."""

from __future__ import annotations

import fcntl
import json
import subprocess
from collections.abc import Sequence
from pathlib import Path

import promises

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build" / "prove"
FIGURES = HERE / "figures.json"


def report(name: str, problems: Sequence[str]) -> bool:
    """Print one line that test/tally.py counts, and what is wrong below it; True if nothing is."""
    print(f"{'FAIL' if problems else 'ok'}{'  ' if problems else '    '}{name}", flush=True)
    for problem in problems:
        print("\n".join(f"    {line}" for line in problem.splitlines()), flush=True)
    return not problems


def run(command: Sequence[object], cwd: Path = ROOT, limit: float = 600, **options) -> subprocess.CompletedProcess[str]:
    """Run a program; its text and exit code, 124 when it took longer than `limit` seconds."""
    words = ["timeout", str(limit), *map(str, command)]
    return subprocess.run(words, cwd=cwd, stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace", **options)


def make(command: Sequence[object], cwd: Path = ROOT) -> None:
    """Run a compiler; SystemExit with its words if it fails."""
    done = run(command, cwd)
    if done.returncode != 0:
        raise SystemExit(f"FAIL  {' '.join(map(str, command))}\n{done.stdout}{done.stderr}")


def faulty(text: str, fault: tuple[str, int, str]) -> str:
    """A source with a fault: text, which of its places (from 0), what stands there instead. SystemExit if there is none."""
    right, which, wrong = fault
    parts = text.split(right)
    if len(parts) < which + 2:
        raise SystemExit(f"FAIL  the source has changed, a fault cannot be put in any more: {right!r}; correct the fault")
    return right.join(parts[: which + 1]) + wrong + right.join(parts[which + 1 :])


def keep(gate: str, figures: dict[str, object]) -> None:
    """Put the figures of a gate into figures.json, one key for each, and into PROMISES.md; others may do so at the same time."""
    with open(HERE / "gate.py") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        known = json.loads(FIGURES.read_text()) if FIGURES.exists() else {}
        text = json.dumps(dict(sorted((known | {gate: figures}).items())), indent=1) + "\n"
        if not FIGURES.exists() or FIGURES.read_text() != text:
            FIGURES.write_text(text)
        promises.PAGE.write_text(promises.page())
