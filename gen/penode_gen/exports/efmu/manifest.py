# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the manifests of an eFMU share: identifiers, checksums, the list of files, and the container's own."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from ...model import Model
from ...version import VERSION
from ..interface import ExportError
from ..templating import render
from .schemas import DIALECTS

MANIFEST = "manifest.xml"
_FIRST = 315532800  # 1980-01-01, the earliest time of an archive: the same model gives the same bytes on any day


@dataclass(frozen=True)
class Representation:
    """A folder of the container: its files by name, and the manifest, complete, about them."""

    folder: str
    kind: str
    id: str
    manifest: str
    files: Mapping[str, str]

    @property
    def checksum(self) -> str:
        """Checksum of the manifest."""
        return sha1(self.manifest)


def sha1(contents: str) -> str:
    """The checksum of eFMI, of a file in UTF-8."""
    return hashlib.sha1(contents.encode(), usedforsecurity=False).hexdigest()


def identifier(model: Model, *of: str) -> str:
    """A UUID in braces: the same for the same model, generator and purpose."""
    digest = hashlib.sha256(repr((VERSION, model.name, model.digest, *of)).encode()).hexdigest()
    return f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"


def time_stamp() -> str:
    """Time of SOURCE_DATE_EPOCH, or a fixed one without it. Raises ExportError where that is no time."""
    given = os.environ.get("SOURCE_DATE_EPOCH", str(_FIRST))
    try:
        return datetime.fromtimestamp(int(given), UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    except (ValueError, OverflowError, OSError) as error:
        raise ExportError(f"SOURCE_DATE_EPOCH: '{given}' is not a time in seconds; remove it or give a whole number") from error


def shared(model: Model, dialect: str) -> dict[str, Any]:
    """The context of every template."""
    return {"model": model, "version": VERSION, "time": time_stamp(), "dialect": dialect, "xsd": list(DIALECTS[dialect].values())}


def listed(files: Mapping[str, str], roles: Mapping[str, str]) -> list[dict[str, str]]:
    """Entries of a manifest's list of files, by their names' suffixes."""
    return [{"name": n, "id": n, "checksum": sha1(files[n]), "role": roles.get(n.rpartition(".")[2], "other")} for n in sorted(files)]


def content(model: Model, dialect: str, parts: list[Representation]) -> str:
    """__content.xml."""
    return render(
        "efmu/content.xml.j2", **shared(model, dialect), parts=parts, id=identifier(model, "container", dialect), manifest=MANIFEST
    )
