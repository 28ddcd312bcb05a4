# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An eFMU as files, and what may be wrong between them: schemas, names, checksums, identifiers, references."""

from __future__ import annotations

import hashlib
import importlib.util
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from penode_gen import exports

SCHEMAS = pytest.mark.skipif(
    importlib.util.find_spec("rumoca") is None, reason="rumoca, which has the schemas, is not installed: pip install penode[efmu]"
)


def export(model: Any, folder: Path, **options: Any) -> Path:
    path = folder / f"{model.name}.fmu"
    path.write_bytes(exports.export(model, "efmu", path, options))
    return path


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name.removeprefix("eFMU/"): archive.read(name) for name in archive.namelist() if name.startswith("eFMU/")}


def problems(files: dict[str, bytes]) -> list[str]:
    """What is wrong between the files of a container: names, checksums, identifiers and references, within and across manifests."""
    found: list[str] = []
    listed = {"__content.xml"} | {name for name in files if name.startswith("schemas/")}
    roots: dict[str, tuple[str, ElementTree.Element]] = {}
    for part in ElementTree.fromstring(files["__content.xml"]):
        manifest = f"{part.get('name')}/{part.get('manifest')}"
        root = ElementTree.fromstring(files[manifest])
        found += [f"{manifest}: checksum"] * (part.get("checksum") != sha1(files[manifest])) + [f"{manifest}: id"] * (
            part.get("manifestRefId") != root.get("id")
        )
        found += [f"{manifest}: kind"] * (part.get("kind") != root.get("kind"))
        roots[str(root.get("id"))] = manifest, root
        listed |= {manifest}
        for file in root.findall("Files/File"):
            name = f"{part.get('name')}/{str(file.get('path')).removeprefix('./')}{file.get('name')}"
            listed |= {name}
            found += [f"{name}: missing"] if name not in files else [f"{name}: checksum"] * (file.get("checksum") != sha1(files[name]))
    for manifest, root in roots.values():
        found += _references(manifest, root, files, roots)
    return found + [f"{name}: not listed" for name in sorted(set(files) - listed)]


def sha1(data: bytes) -> str:
    """As eFMI writes it."""
    return hashlib.sha1(data).hexdigest()


def identifiers(root: ElementTree.Element) -> list[str]:
    """All ids of a manifest."""
    return [str(e.get("id")) for e in root.iter() if e.get("id")]


def _references(
    manifest: str, root: ElementTree.Element, files: dict[str, bytes], roots: dict[str, tuple[str, ElementTree.Element]]
) -> list[str]:
    """Within a manifest, and to the one that it was made from."""
    ids = identifiers(root)
    found = [f"{manifest}: the id {i} twice" for i in sorted({i for i in ids if ids.count(i) > 1})]
    foreign: dict[str, list[str]] = {}
    for e in root.iter("ManifestReference"):
        of = roots.get(str(e.get("manifestRefId")))
        found += [f"{manifest}: origin"] if of is None or e.get("checksum") != sha1(files[of[0]]) else []
        foreign[str(e.get("id"))] = identifiers(of[1]) if of else []
    for e in root.iter():
        own = [(k, v) for k, v in e.attrib.items() if k.endswith("RefId") and k not in ("manifestRefId", "foreignRefId")]
        found += [f"{manifest}: {k} {v}" for k, v in own if v not in ids]
        if e.get("foreignRefId"):
            found += [f"{manifest}: foreignRefId {e.get('foreignRefId')}"] * (
                e.get("foreignRefId") not in foreign.get(str(e.get("manifestReferenceRefId")), [])
            )
    return found


def unmapped(files: dict[str, bytes], folder: str) -> list[str]:
    """What of the block a Production Code does not map once: variables, the error signals, methods."""
    block = ElementTree.fromstring(files["AlgorithmCode/manifest.xml"])
    wanted = (
        [str(v.get("id")) for v in block.findall("Variables/*")]
        + ["block:ErrorSignalStatus"]
        + [str(m.get("id")) for m in block.iter("BlockMethod")]
    )
    logical = ElementTree.fromstring(files[f"{folder}/manifest.xml"]).find("CodeContainer/LogicalData")
    assert logical is not None
    mapped = [str(e.get("foreignRefId")) for e in logical.iter() if e.get("foreignRefId")]
    return [i for i in wanted if mapped.count(i) != 1] + [i for i in mapped if i not in wanted]


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
        xmlschema = pytest.importorskip("xmlschema")

        if kind not in self._read:
            name = f"{kind}/efmi{kind}Manifest.xsd" if kind else "efmiContainerManifest.xsd"
            self._read[kind] = xmlschema.XMLSchema11(str(self.folder / "schemas" / name))
        return [f"{kind}: {e.path}: {e.reason}" for e in self._read[kind].iter_errors(manifest.decode())]

    def errors_of_all(self, files: dict[str, bytes]) -> list[str]:
        """Errors of every manifest of the container."""
        found = self.errors("", files["__content.xml"])
        for part in ElementTree.fromstring(files["__content.xml"]):
            found += self.errors(str(part.get("kind")), files[f"{part.get('name')}/{part.get('manifest')}"])
        return found
