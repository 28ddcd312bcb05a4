# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Changes of the nominal file by an extended model, and its cost on a controller."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import penode_gen
from penode_gen.model import Model

from ...errors import UserError
from ...targets import build_object

CORE = "m4f"


def difference(nominal: Path, extended: Path) -> list[tuple[str, str]]:
    """What the extended file changes: lines with the sign " ", "-" or "+". An entry that both files have shows as a
    change; what [model] says of the file itself does not."""
    known = _entries(nominal.read_text(encoding="utf-8"))
    found: list[tuple[str, str]] = []
    section = ""
    for text in extended.read_text(encoding="utf-8").splitlines():
        if text.startswith("["):
            section = text.strip()
        key = (section, text.partition("=")[0].strip())
        same = not text or text[0] in "[#" or section == "[model]" or text == known.get(key)
        if key in known and not same:
            found.append(("-", known[key]))
        found.append((" " if same else "+", text))
    while found and not found[-1][1]:
        found.pop()
    return found


def _entries(text: str) -> dict[tuple[str, str], str]:
    """Lines `key = value` of a TOML text by section and key."""
    found, section = {}, ""
    for entry in text.splitlines():
        if entry.startswith("["):
            section = entry.strip()
        elif re.match(r"\w+\s*=", entry):
            found[section, entry.partition("=")[0].strip()] = entry.rstrip()
    return found


def price(model: Model, extended: Path) -> list[tuple[str, int, int]]:
    """Sizes of the C on a Cortex-M4F: name, bytes of the nominal and of the extended model; empty without a compiler."""
    if not shutil.which("arm-none-eabi-gcc") or not shutil.which("arm-none-eabi-size"):
        return []
    try:
        sizes = [_sizes(m) for m in (model, penode_gen.load(extended))]
    except (UserError, OSError, subprocess.CalledProcessError):
        return []
    return [(what, sizes[0][k], sizes[1][k]) for k, what in enumerate(("code and constants", "parameter sets"))]


def _sizes(model: Model) -> tuple[int, int]:
    """Bytes of NAME.c and of NAME_params.c."""
    out = build_object(model, CORE, f"{model.name}.c"), build_object(model, CORE, f"{model.owner}_params.c")
    size = subprocess.run(["arm-none-eabi-size", *map(str, out)], capture_output=True, text=True, check=True)
    code, sets = (int(line.split()[0]) for line in size.stdout.splitlines()[1:])
    return code, sets
