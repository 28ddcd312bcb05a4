# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
FMUs and eFMUs that others have published, read with the readers that our own exports are checked with.

PEERS_DIR names a folder with them, at any depth: FMU files, and eFMUs unpacked (a folder with __content.xml). A checkout of
ALSETLab/efmi-pss-use-case is one: FMUs with sources and an eFMU of Dymola 2026x.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest
from efmu_container import Schemas, contents, export, sha1

PEERS = Path(os.environ["PEERS_DIR"]) if os.environ.get("PEERS_DIR") else None
FMUS = sorted(PEERS.rglob("*.fmu")) if PEERS else []
CONTAINERS = sorted(p.parent for p in PEERS.rglob("__content.xml")) if PEERS else []
pytestmark = pytest.mark.skipif(PEERS is None, reason="PEERS_DIR names no folder with published FMUs and eFMUs")


def test_there_are_some() -> None:
    assert FMUS or CONTAINERS, f"PEERS_DIR: {PEERS} has no FMU and no __content.xml"


@pytest.mark.parametrize("path", FMUS, ids=lambda p: p.stem[-12:])
def test_an_fmu_of_others_is_read(path: Path) -> None:
    """FMPy's checks find nothing in it either, and it has what ours have: Co-Simulation, tunable parameters."""
    fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed: pip install penode[fmi]")
    from fmpy.validation import validate_fmu

    description = fmpy.read_model_description(str(path))
    assert validate_fmu(str(path)) == [] and description.coSimulation is not None
    assert any(v.causality == "parameter" and v.variability == "tunable" for v in description.modelVariables)


def files_of(folder: Path) -> dict[str, bytes]:
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.parametrize("folder", CONTAINERS, ids=lambda p: p.parent.name)
def test_an_efmu_of_others_is_read(folder: Path, tmp_path: Path) -> None:
    """Valid against its own schemas, its manifests are those that it lists; a changed byte of one is found."""
    files = files_of(folder)
    assert Schemas(files, tmp_path).errors_of_all(files) == []
    listed = [
        (f"{part.get('name')}/{part.get('manifest')}", part.get("checksum")) for part in ElementTree.fromstring(files["__content.xml"])
    ]
    assert listed and all(sha1(files[name]) == checksum for name, checksum in listed)
    assert sha1(files[listed[0][0]] + b" ") != listed[0][1]


@pytest.mark.parametrize("folder", CONTAINERS, ids=lambda p: p.parent.name)
def test_our_efmu_is_valid_against_the_schemas_of_theirs(folder: Path, nqvm: Any, tmp_path: Path) -> None:
    """In the dialect of the tool that made it."""
    schemas = folder / "schemas"
    version = next(
        (
            v
            for v, d in (("0.10.0", "dymola"), ("0.11.0", "beta1"))
            if f'fixed="{v}"'.encode() in (schemas / "efmiContainerManifest.xsd").read_bytes()
        ),
        None,
    )
    assert version, "a dialect that penode does not know"
    files = contents(export(nqvm, tmp_path, dialect="dymola" if version == "0.10.0" else "beta1", schemas=str(schemas)))
    assert Schemas(files, tmp_path).errors_of_all(files) == []
