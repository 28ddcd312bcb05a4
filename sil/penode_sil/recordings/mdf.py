# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""MDF files (.mf4, .mdf), read in a process of their own: a broken one can take asammdf's compiled part down."""

from __future__ import annotations

import io
import json
import logging
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError
from .named import plain

Array = NDArray[np.float64]
# units, columns and (name, text) by key; one is time [s]
Group = tuple[dict[str, str | None], dict[str, Array], dict[str, tuple[str, str]]]
Found = tuple[dict[str, str | None], dict[str, Array], dict[str, str]]  # the same with the name alone


def read(path: Path, names: frozenset[str] | None) -> tuple[list[Group], list[str]]:
    """Groups with the channels that may be called `names` (None: all that are numbers), invalid samples NaN; and the names
    of all channels of the file. UserError if it cannot be read, or if what is asked for holds no numbers."""
    asked = json.dumps(None if names is None else sorted(names))
    code, out = apart(path, asked)
    if code != 0:
        raise RecordingError(f"{path}: it is not a valid MDF file (its reader gave up); export it again")
    with np.load(io.BytesIO(out)) as file:
        said = json.loads(str(file["said"]))
        if "problem" in said:
            raise RecordingError(f"{path}: {said['problem']}")
        groups: list[Group] = []
        for g, (units, called) in enumerate(said["groups"]):
            columns = {key: file[f"{g},{c}"] for c, key in enumerate(units)}
            groups.append((units, columns, {key: (name, name) for key, name in called.items()}))
        return groups, said["known"]


def apart(path: Path, asked: str) -> tuple[int, bytes]:
    """`_main` in a process of its own: exit code and output. UserError if it does not end: a broken file can lead its reader in circles."""
    limit = 120.0 + 2e-6 * path.stat().st_size if path.exists() else 120.0  # [s] a thousandth of the speed of a good file's
    try:
        run = subprocess.run([sys.executable, "-m", __name__, str(path), asked], capture_output=True, check=False, timeout=limit)
    except subprocess.TimeoutExpired as error:
        raise RecordingError(f"{path}: it is not a valid MDF file (its reader came to no end in {limit:.0f} s); export it again") from error
    return run.returncode, run.stdout


class _Problem(Exception):
    """What is wrong with the file, and the remedy."""


def _wanted(name: str, names: set[str] | None) -> bool:
    """May a channel be one of those that are asked for: by its name, in other letters, with a unit or device behind it?"""
    if names is None or name in names:
        return True
    low = plain(name)
    return any(low == plain(one) or low.startswith(plain(one) + "_") for one in names if plain(one))


def _groups(file: Any, names: set[str] | None) -> list[Found]:
    groups: list[Found] = []
    problems: dict[str, str] = {}
    for group, content in enumerate(file.groups):
        master = file.masters_db.get(group)
        timed = master is not None and getattr(content.channels[master], "sync_type", 1) == 1
        often = Counter(channel.name for index, channel in enumerate(content.channels) if index != master)
        seen = Counter[str]()
        units: dict[str, str | None] = {"time": "s"}
        columns: dict[str, Array] = {}
        called = {"time": "time"}
        for index, channel in enumerate(content.channels):
            name = channel.name
            if index == master or not _wanted(name, names):
                continue
            seen[name] += 1
            if not timed:
                problems[name] = f"channel {name} is not recorded over time; record it with a time"
                continue
            signal = file.get(group=group, index=index, ignore_invalidation_bits=True)
            values = np.asarray(signal.samples)
            if values.ndim != 1 or values.dtype.kind not in "fiub":
                problems[name] = f"channel {name} holds no numbers; record the value itself"
                continue
            key = f"{name}#{seen[name]}" if often[name] > 1 or name == "time" else name
            columns["time"] = np.asarray(signal.timestamps, dtype=np.float64)
            columns[key] = values.astype(np.float64)
            if signal.invalidation_bits is not None:
                columns[key][np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
            units[key], called[key] = signal.unit.strip() or None, name
        if columns:
            groups.append((units, columns, called))
    found = {name for *_, called in groups for name in called.values()}
    for name, problem in problems.items():
        if names is not None and name in names and name not in found:
            raise _Problem(problem)
    return groups


def _main(path: str, asked: str) -> None:
    from asammdf import MDF  # slow to load

    out, sys.stdout = sys.stdout.buffer, sys.stderr
    logging.getLogger("asammdf").setLevel(logging.CRITICAL + 1)
    names = json.loads(asked)
    said: dict[str, object]
    arrays: dict[str, Array] = {}
    try:
        file = MDF(path)
        groups = _groups(file, None if names is None else set(names))
        masters = {file.groups[g].channels[c].name for g, c in file.masters_db.items()}
        said = {"groups": [(units, called) for units, _, called in groups], "known": sorted(set(file.channels_db) - masters)}
        arrays = {
            f"{g},{c}": values for g, (units, columns, _) in enumerate(groups) for c, values in enumerate(columns[name] for name in units)
        }
    except _Problem as problem:
        said = {"problem": str(problem)}
    except Exception as exc:  # a broken file makes the reader raise a dozen kinds
        what = next(iter(str(exc).splitlines()), "") or type(exc).__name__
        said = {"problem": f"it is not a valid MDF file ({what}); export it again"}
    np.savez(out, allow_pickle=False, said=json.dumps(said), **arrays)


if __name__ == "__main__":
    _main(*sys.argv[1:])
