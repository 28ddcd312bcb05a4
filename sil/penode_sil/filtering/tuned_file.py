# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A model file with other noises in its filter: it extends the one that was tuned, which stays as it is with its comments."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import penode_gen
from penode_gen.algebra.mechanics import state_unit
from penode_gen.model import Model
from penode_gen.reading.tables import Tables
from penode_gen.version import VERSION

from ..output import check_writable, whole
from ..recordings import units
from .estimates import of
from .variable import Key


def noises(model: Model, factors: Mapping[Key, float]) -> Iterator[tuple[Key, str, str, float, float]]:
    """Table and name, key, unit, and the noise before and after, as numbers of the file."""
    for (table, name), entry, key in _entries(model):
        if (table, name) in factors:
            yield (table, name), key, _unit(model, table, name, key), entry[key], entry[key] * factors[table, name]


def check(model: Model, keys: Iterable[Key], output: Path) -> None:
    """Before a fit: can the file be written, and read back? Raises UserError."""
    with tempfile.TemporaryDirectory() as scratch:
        write(model, dict.fromkeys(keys, 1.0), Path(scratch) / output.name)
    if output.exists() or output.parent.exists():
        check_writable(output)


def write(model: Model, factors: Mapping[Key, float], output: Path) -> None:
    """Write and read back. Raises UserError."""
    with whole(output) as part:
        part.write_text(text(model, factors, output), encoding="utf-8")
        penode_gen.load(part)


def text(model: Model, factors: Mapping[Key, float], output: Path) -> str:
    """Tables of [filter] in which a noise changes, as a whole: those of an extending file replace the ones that it extends."""
    way = Path(os.path.relpath(model.path.resolve(), output.parent.resolve())).as_posix()
    lines = [f"# {model.name} with noises of its filter fitted to recordings by penode {VERSION}.", "", "[model]", f'extends = "{way}"']
    changed = {table for table, _ in factors}
    last = ""
    for (table, name), entry, key in _entries(model):
        if table not in changed:
            continue
        lines += ["", f"[filter.{table}]"] if table != last else []
        last = table
        value = {key: float(f"{entry[key] * factors[table, name]:.6g}")} if (table, name) in factors else {}
        lines.append(f"{name} = {{ {', '.join(f'{k} = {json.dumps(v)}' for k, v in (entry | value).items())} }}")
    return "\n".join(lines) + "\n"


def _entries(model: Model) -> Iterator[tuple[Key, dict[str, Any], str]]:
    """Each entry of sensors, states, inputs and parameters as the file has it, and the key of its noise; a sensor's noise is stated."""
    data = Tables(model.path).data["filter"]
    for table in ("sensors", "states", "inputs", "parameters"):
        for name, entry in data.get(table, {}).items():
            own = {s.name: s.noise for s in of(model).sensors}.get(name, 0.0) if table == "sensors" else 0.0
            given = {"noise": own / units.factor(_unit(model, table, name, "noise"))} | entry if table == "sensors" else entry
            yield (table, name), given, "walk" if "walk" in entry else "noise"


def _unit(model: Model, table: str, name: str, key: str) -> str:
    """Unit of a noise in the file."""
    if table == "states":
        return f"{state_unit(model, name)}/sqrt(s)"
    if table == "parameters":
        return f"{model.parameters[name].unit}/sqrt(s)"
    found = next(s.unit for s in (model.sensors if table == "sensors" else model.inputs) if s.name == name)
    return f"{found}/sqrt(s)" if key == "walk" else found
