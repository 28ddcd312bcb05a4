# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The page of the make targets, from `make help`."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def page() -> str:
    text = subprocess.run(["make", "-s", "help"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    lines = ["# make targets", "", "What `make help` prints. `V=1` shows the commands of a target.", ""]
    for line in text.splitlines():
        if m := re.fullmatch(r"  make (\S+) +(.+)", line):
            lines.append(f"| `make {m[1]}` | {m[2].replace('|', chr(92) + '|')} |")
        elif line:
            lines += ["", f"## {line}", "", "| target | what it does |", "|---|---|"]
    return "\n".join(lines) + "\n"
