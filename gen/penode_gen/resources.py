# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
Where files that are installed with the packages lie: templates, and in native/ the C of runtime, ports and firmware.

In a checkout native/ consists of symbolic links to the folders themselves; setuptools follows them, so that a wheel holds what they hold.
"""

from __future__ import annotations

import importlib.resources
from pathlib import Path


def resource(package: str, *parts: str) -> Path:
    """A file or folder of a package, by its place below the package's folder."""
    return Path(str(importlib.resources.files(package).joinpath(*parts)))


def native(*parts: str) -> Path:
    """A file or folder of native/, which is laid out as the repository is: inc, src, port, sil/firmware, LICENSE; without symbolic links.
    Raises FileNotFoundError."""
    return resource("penode_gen", "native", *parts).resolve(strict=True)
