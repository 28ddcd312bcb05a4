# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An eFMU as files, and what may be wrong between them: schemas, names, checksums, identifiers, references."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from penode_gen import exports


def export(model: Any, folder: Path, **options: Any) -> Path:
    path = folder / f"{model.name}.fmu"
    path.write_bytes(exports.export(model, "efmu", path, options))
    return path


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name.removeprefix("eFMU/"): archive.read(name) for name in archive.namelist() if name.startswith("eFMU/")}


def problems(files: dict[str, bytes]) -> list[str]:
    """What is wrong between the files of a container: names, checksums, identifiers and references."""
    found: list[str] = []
    content = ElementTree.fromstring(files["__content.xml"])
    listed = {"__content.xml"} | {name for name in files if name.startswith("schemas/")}
    sums = {name: hashlib.sha1(data).hexdigest() for name, data in files.items()}
    for part in content:
        folder, manifest = part.get("name"), f"{part.get('name')}/{part.get('manifest')}"
        root = ElementTree.fromstring(files[manifest])
        found += [f"{manifest}: checksum"] * (part.get("checksum") != sums[manifest]) + [f"{manifest}: id"] * (part.get("manifestRefId") != root.get("id"))
        listed |= {manifest}
        for file in root.findall("Files/File"):
            name = f"{folder}/{file.get('path').removeprefix('./')}{file.get('name')}"
            listed |= {name}
            found += [f"{name}: missing"] if name not in files else [f"{name}: checksum"] * (file.get("checksum") != sums[name])
        ids = [e.get("id") for e in root.iter() if e.get("id")]
        found += [f"{manifest}: the id {i} twice" for i in sorted({i for i in ids if ids.count(i) > 1})]
        for e in root.iter():
            own = [(k, v) for k, v in e.attrib.items() if k.endswith("RefId") and k not in ("manifestRefId", "foreignRefId")]
            found += [f"{manifest}: {k} {v}" for k, v in own if v not in ids]
    return found + [f"{name}: not listed" for name in sorted(set(files) - listed)]


class Schemas:
    """The schemas of a container, written to a folder; each is read once."""

    def __init__(self, files: dict[str, bytes], folder: Path):
        self.folder, self._read = folder, {}
        for name, data in files.items():
            if name.startswith("schemas/"):
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                (folder / name).write_bytes(data)

    def errors(self, kind: str, manifest: bytes) -> list[str]:
        """What is wrong with a manifest of a kind, "" for that of the container."""
        import pytest

        xmlschema = pytest.importorskip("xmlschema")

        if kind not in self._read:
            name = f"{kind}/efmi{kind}Manifest.xsd" if kind else "efmiContainerManifest.xsd"
            self._read[kind] = xmlschema.XMLSchema11(str(self.folder / "schemas" / name))
        return [f"{kind}: {e.path}: {e.reason}" for e in self._read[kind].iter_errors(manifest.decode())]

    def errors_of_all(self, files: dict[str, bytes]) -> list[str]:
        """Of every manifest of the container."""
        found = self.errors("", files["__content.xml"])
        for part in ElementTree.fromstring(files["__content.xml"]):
            found += self.errors(str(part.get("kind")), files[f"{part.get('name')}/{part.get('manifest')}"])
        return found
