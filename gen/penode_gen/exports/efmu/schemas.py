# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The schemas that an eFMU has to carry: of eFMI 1.0.0 Beta 1 from the Python package rumoca, or of any dialect from a folder.

They are the standard's own (BSD 3-Clause, Modelica Association), with their notice. penode has no copy of them.
"""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path
from xml.etree import ElementTree

from ..interface import ExportError

# The versions that manifests of a dialect name: file of the schema -> version.
DIALECTS = {
    "beta1": {
        "efmiContainerManifest.xsd": "0.11.0",
        "AlgorithmCode/efmiAlgorithmCodeManifest.xsd": "0.14.0",
        "ProductionCode/efmiProductionCodeManifest.xsd": "0.17.0",
    },
    "dymola": {
        "efmiContainerManifest.xsd": "0.10.0",
        "AlgorithmCode/efmiAlgorithmCodeManifest.xsd": "0.13.0",
        "ProductionCode/efmiProductionCodeManifest.xsd": "0.17.0",
    },
}
_BEHAVIOUR = "BehavioralModel/efmiBehavioralModelManifest.xsd"
_MARK = re.compile(rb"schemas/((?:\w+/)?(?:\w+\.(?:xsd|txt|md)|LICENSE))")
_END = b"</xs:schema>"
_LARGEST = 1 << 20  # bytes of a schema


def schemas(dialect: str, folder: str | None) -> dict[str, bytes]:
    """Path below schemas/ -> contents, complete and of the dialect. Raises ExportError."""
    found = _of_folder(Path(folder)) if folder else _of_package(dialect)
    where = f"--schemas {folder}" if folder else "the package rumoca"
    for path in (*DIALECTS[dialect], _BEHAVIOUR):
        if path not in found:
            raise ExportError(f"{where}: it has no {path}; name the folder that holds the schemas of an eFMU with --schemas")
    for path, version in DIALECTS[dialect].items():
        if f'fixed="{version}"'.encode() not in found[path]:
            raise ExportError(
                f"{where}: {path} is not version {version}, which the dialect {dialect} has; choose the other --dialect or other schemas"
            )
    _check(found, where)
    return found


def _of_folder(folder: Path) -> dict[str, bytes]:
    if not folder.is_dir():
        raise ExportError(f"--schemas {folder}: there is no such folder; name the folder schemas/ of an eFMU")
    paths = [
        p
        for p in sorted(folder.rglob("*"))
        if p.is_file() and (p.suffix == ".xsd" or p.name.startswith("LICENSE")) and p.stat().st_size <= _LARGEST
    ]
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in paths}


def _of_package(dialect: str) -> dict[str, bytes]:
    """The schemas inside of rumoca, which keeps each behind its path."""
    if dialect != "beta1":
        raise ExportError(
            f"--dialect {dialect}: its schemas are in no package; name the folder schemas/ of an eFMU of that tool with --schemas"
        )
    spec = importlib.util.find_spec("rumoca")
    if spec is None or not spec.submodule_search_locations:
        raise ExportError(
            "--format efmu: an eFMU carries the schemas of the standard; pip install penode[efmu], or name their folder with --schemas"
        )
    found: dict[str, bytes] = {}
    for place in spec.submodule_search_locations:
        for path in sorted(Path(place).glob("_native*")):
            found |= _of_bytes(path.read_bytes())
    return found


def _of_bytes(data: bytes) -> dict[str, bytes]:
    marks = list(_MARK.finditer(data))
    found: dict[str, bytes] = {}
    for mark, after in zip(marks, [*marks[1:], None], strict=True):
        name = mark[1].decode()
        text = data[mark.end() : after.start() if after else mark.end() + _LARGEST]
        if name.endswith(".xsd") and text.startswith(b"<?xml") and _END in text:
            found.setdefault(name, text[: text.index(_END) + len(_END)] + b"\n")
        elif name == "LICENSE" and text.startswith(b"Copyright"):
            found.setdefault(name, text.rstrip() + b"\n")
    return found


def _check(found: dict[str, bytes], where: str) -> None:
    """Every schema is XML, and all that it includes is there."""
    for path, data in found.items():
        if not path.endswith(".xsd"):
            continue
        try:
            root = ElementTree.fromstring(data)
        except ElementTree.ParseError as error:
            raise ExportError(f"{where}: {path} is no XML ({error}); name other schemas with --schemas") from error
        for include in root.iter("{http://www.w3.org/2001/XMLSchema}include"):
            target = _joined(path, include.get("schemaLocation", ""))
            if target not in found:
                raise ExportError(f"{where}: {path} includes {target}, which is missing; name other schemas with --schemas")


def _joined(path: str, relative: str) -> str:
    parts = path.split("/")[:-1]
    for part in relative.split("/"):
        if part == "..":
            parts = parts[:-1]
        elif part not in ("", "."):
            parts.append(part)
    return "/".join(parts)
