# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""MDF files (.mf4, .mdf), read in a process of their own: a broken one can take asammdf's compiled part down."""

from __future__ import annotations

import io
import json
import logging
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import UserError, hint

Group = tuple[dict[str, str | None], dict[str, NDArray[np.float64]]]  # units and columns, by channel; one is time [s]


def read(path: Path, names: frozenset[str] | None) -> list[Group]:
    """Groups with the channels `names` or `names`_UNIT (None: all that are numbers); invalid samples are NaN."""
    asked = json.dumps(None if names is None else sorted(names))
    run = subprocess.run([sys.executable, "-m", __name__, str(path), asked], capture_output=True, check=False)
    if run.returncode != 0:
        raise UserError(f"{path}: it is no sound MDF file (its reader gave up); write it anew")
    with np.load(io.BytesIO(run.stdout)) as file:
        said = json.loads(str(file["said"]))
        if "problem" in said:
            raise UserError(f"{path}: {said['problem']}")
        return [
            (units, {name: file[f"{g},{c}"] for c, name in enumerate(units)}) for g, units in enumerate(said["groups"])
        ]


class _Problem(Exception):
    """What is wrong with the file, and the remedy."""


def _groups(file: Any, names: set[str] | None) -> list[Group]:
    groups: list[Group] = []
    for group, content in enumerate(file.groups):
        master = file.masters_db.get(group)
        units: dict[str, str | None] = {"time": "s"}
        columns: dict[str, NDArray[np.float64]] = {}
        for index, channel in enumerate(content.channels):
            name = channel.name
            stems = {name, *(name[:k] for k, letter in enumerate(name) if letter == "_")}
            if index == master or (names is not None and not names & stems):
                continue
            signal = file.get(group=group, index=index, ignore_invalidation_bits=True)
            values = np.asarray(signal.samples)
            if values.ndim != 1 or values.dtype.kind not in "fiub":
                if names is not None and name in names:
                    raise _Problem(f"channel {name} holds no numbers; record the value itself")
                continue
            if master is None or getattr(content.channels[master], "sync_type", 1) != 1:
                raise _Problem(f"channel {name} is not recorded over time; record it with a time")
            if name in columns:
                raise _Problem(f"channel {name} is there twice in one group; rename or remove one")
            columns["time"] = np.asarray(signal.timestamps, dtype=np.float64)
            columns[name] = values.astype(np.float64)
            if signal.invalidation_bits is not None:
                columns[name][np.asarray(signal.invalidation_bits, dtype=bool)] = np.nan
            units[name] = signal.unit.strip() or None
        if columns:
            groups.append((units, columns))
    if not groups:
        known = sorted(set(file.channels_db) - {"time"})
        what = f"none of the channels {', '.join(sorted(names - {'time'}))}" if names else "no channel with numbers"
        raise _Problem(f"it holds {what}; {hint(min(names) if names else '', known)}")
    return groups


def _main(path: str, asked: str) -> None:
    from asammdf import MDF  # slow to load

    out, sys.stdout = sys.stdout.buffer, sys.stderr
    logging.getLogger("asammdf").setLevel(logging.CRITICAL + 1)
    names = json.loads(asked)
    said: dict[str, Any]
    arrays: dict[str, NDArray[np.float64]] = {}
    try:
        groups = _groups(MDF(path), None if names is None else set(names))
        said = {"groups": [units for units, _ in groups]}
        arrays = {f"{g},{c}": values for g, (units, columns) in enumerate(groups)
                  for c, values in enumerate(columns[name] for name in units)}  # fmt: skip
    except _Problem as problem:
        said = {"problem": str(problem)}
    except Exception as exc:  # a broken file makes the reader raise a dozen kinds
        what = next(iter(str(exc).splitlines()), "") or type(exc).__name__
        said = {"problem": f"it is no sound MDF file ({what[:80]}); write it anew"}
    np.savez(out, said=json.dumps(said), **arrays)


if __name__ == "__main__":
    _main(*sys.argv[1:])
