# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Files are written whole or not at all; tables carry their units."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from .errors import WrongUse


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a table: values in `unit`, printed with a printf format."""

    name: str
    unit: str
    values: NDArray[np.float64] | NDArray[np.uint32]
    format: str = "%.9g"


def check_writable(path: Path) -> None:
    """UserError now rather than after long work, if `path` cannot be written."""
    folder = path.parent
    if not folder.is_dir():
        raise WrongUse(f"{path}: there is no directory {folder}; create it or name another file")
    if path.is_dir():
        raise WrongUse(f"{path}: this is a directory; name a file in it")
    if not os.access(folder, os.W_OK):
        raise WrongUse(f"{path}: the directory {folder} is not writable; name another one")


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Yield a name beside `path` to write to; it becomes `path` on success and vanishes on failure."""
    check_writable(path)
    handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    os.close(handle)
    try:
        yield Path(name)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, path)
    except OSError as exc:
        raise WrongUse(f"{path}: cannot be written: {exc.strerror or exc}; free space or name another file") from exc
    finally:
        Path(name).unlink(missing_ok=True)


def write_csv(path: Path, columns: list[Column]) -> None:
    """A table with a header like `time [s],z_road [m]`, in the order of the columns."""
    line = ",".join(column.format for column in columns) + "\n"
    with whole(path) as part, open(part, "w", encoding="utf-8", newline="") as file:
        file.write(",".join(f"{column.name} [{column.unit}]" for column in columns) + "\n")
        rows = zip(*(column.values.tolist() for column in columns), strict=True)
        file.writelines(line % row for row in rows)
