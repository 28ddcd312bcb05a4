# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Imports of weights from the files of other tools: one file a format, one line of SUFFIXES for each."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from ..networks import Network
from .interface import ImportProblem, Options

__all__ = ["SUFFIXES", "ImportProblem", "Options", "read", "text_of"]

# Suffix of the file -> module of this package, whose `networks` reads it. A new format is a new line.
SUFFIXES = {".mo": "modelica"}


def read(path: Path, options: Options) -> dict[str, Network]:
    """The networks in a file, by name. Raises ImportProblem."""
    text = text_of(path)
    found: dict[str, Network] = import_module(f".{SUFFIXES[path.suffix.lower()]}", __name__).networks(text, path, options)
    return found


def text_of(path: Path) -> str:
    """A file of one of the known formats, as text. Raises ImportProblem."""
    if path.suffix.lower() not in SUFFIXES:
        raise ImportProblem(f'{path}: a file that ends in "{path.suffix}" cannot be imported; known are {", ".join(SUFFIXES)}')
    try:
        return path.read_bytes().decode("utf-8")
    except OSError as error:
        raise ImportProblem(f"{path}: {error.strerror}; name a file that can be read") from None
    except UnicodeDecodeError as error:
        raise ImportProblem(f"{path}: byte {error.start} is no UTF-8; save it as text in UTF-8") from None
