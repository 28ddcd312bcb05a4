# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The environment variables that the command and its libraries read, checked before any of them is loaded.

`cli.py` imports this module before all others: numpy reads SOURCE_DATE_EPOCH, and matplotlib MPLBACKEND, when they are imported,
and end in a traceback where the value is none. Only the standard library, and errors, which need no more, are used here.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping
from datetime import MAXYEAR, UTC, datetime
from pathlib import Path

from .errors import WrongUse

LAST = int(datetime(MAXYEAR, 12, 31, 23, 59, 59, tzinfo=UTC).timestamp())  # [s] the last that a date can be written for


def problems(environment: Mapping[str, str]) -> list[str]:
    """A line for each variable whose value nothing can be done with: what it is, and the remedy."""
    found = []
    stamp = environment.get("SOURCE_DATE_EPOCH", "0")
    if not (stamp.isascii() and stamp.isdigit() and len(stamp) <= len(str(LAST)) and int(stamp) <= LAST):
        found.append(f"SOURCE_DATE_EPOCH: '{stamp[:40]}' is not a time in seconds; remove it or give a whole number")
    folder = environment.get("PENODE_BUILD", "")
    if folder and Path(folder).exists() and not Path(folder).is_dir():
        found.append(f"PENODE_BUILD: {folder} is a file; name a directory, or remove it")
    return found


def refuse(environment: Mapping[str, str]) -> None:
    """Ends the process with code 2 where there are problems, which --json gets too (guard.py)."""
    found = problems(environment)
    for problem in found:
        print(f"penode: {problem}", file=sys.stderr)
    if found and "--json" in sys.argv:
        print(json.dumps(WrongUse(*found).as_json(), indent=2))
    if found:
        raise SystemExit(WrongUse.exit)


refuse(os.environ)
os.environ["MPLBACKEND"] = "Agg"  # pictures are files
