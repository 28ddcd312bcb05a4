# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Write generated files: all of them, or none."""

from __future__ import annotations

import errno
import os
import tempfile
from pathlib import Path


def write_all(texts: dict[str, str], directory: str | Path) -> list[Path]:
    """Write each text under its name into `directory`, which is made if need be. Raises OSError; then all is as it was."""
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    for path in (directory / name for name in texts):
        if path.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    written: list[tuple[str, Path]] = []
    try:
        for name, text in texts.items():
            handle, temporary = tempfile.mkstemp(dir=directory, prefix=f".{name}.")
            written.append((temporary, directory / name))
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
                file.write(text)
            os.chmod(temporary, 0o644)
        _replace_all(written)
    finally:
        for temporary, _ in written:
            Path(temporary).unlink(missing_ok=True)
    return [path for _, path in written]


def _replace_all(written: list[tuple[str, Path]]) -> None:
    """Put every file in its place; if one cannot be, all places are as they were. Raises OSError."""
    before = {path: path.read_bytes() if path.exists() else None for _, path in written}
    done: list[Path] = []
    try:
        for temporary, path in written:
            os.replace(temporary, path)
            done.append(path)
    except OSError:
        for path in done:
            kept = before[path]
            if kept is None:
                path.unlink()
            else:
                path.write_bytes(kept)
        raise
