# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Archives that are the same to the byte whenever their contents are: names sorted, no clock, no owner."""

from __future__ import annotations

import io
import zipfile

_FIRST = (1980, 1, 1, 0, 0, 0)  # the earliest time that a zip can hold


def zipped(files: dict[str, bytes | str]) -> bytes:
    """A zip of path -> contents; texts as UTF-8. Paths have forward slashes. FMUs are archives already: stored as they are."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:
        for name in sorted(files):
            contents = files[name]
            info = zipfile.ZipInfo(name, _FIRST)
            info.compress_type = zipfile.ZIP_STORED if name.endswith(".fmu") else zipfile.ZIP_DEFLATED
            info.create_system = 3  # Unix: the permissions count
            info.external_attr = 0o100644 << 16
            archive.writestr(info, contents.encode() if isinstance(contents, str) else contents)
    return stream.getvalue()
