# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""One thread for the linear algebra: matrices here are small, and threads that wait for each other burn several times the processor
time."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NAMES = tuple(f"{prefix}openblas_{{}}_num_threads{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", "", "_64"))


def _libraries() -> list[tuple[ctypes.CDLL, str]]:
    """OpenBLAS as it is loaded, with the form of its names; nothing for another library, or where there is no list of maps."""
    maps = Path("/proc/self/maps")
    paths = set(re.findall(r"\S*openblas\S*\.so\S*", maps.read_text(encoding="utf-8", errors="replace"))) if maps.exists() else set()
    found = []
    for path in sorted(paths):
        library = ctypes.CDLL(path)
        form = next((n for n in NAMES if hasattr(library, n.format("set")) and hasattr(library, n.format("get"))), None)
        found += [(library, form)] if form else []
    return found


@contextmanager
def one() -> Iterator[None]:
    """One thread until the end of the block."""
    before = []
    for library, form in _libraries():
        before.append((library, form, getattr(library, form.format("get"))()))
        getattr(library, form.format("set"))(1)
    try:
        yield
    finally:
        for library, form, number in before:
            getattr(library, form.format("set"))(number)
