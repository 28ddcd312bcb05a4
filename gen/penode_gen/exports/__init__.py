# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Exports of a model into the formats of other tools: a package for each family of formats, a line of FORMATS for each format."""

from __future__ import annotations

from functools import cache
from importlib import import_module
from pathlib import Path

from ..model import Model
from .interface import Exporter, ExportError, Option, Options, run

__all__ = ["FORMATS", "ExportError", "Exporter", "Option", "Options", "export", "exporter"]

# Name on the command line -> module of this package, whose EXPORTER it is. A new format is a new line.
FORMATS: dict[str, str] = {
    "fmu3": "fmi.fmu3",
    "fmu2": "fmi.fmu2",
    "modelica": "modelica.modelica",
    "ssp": "ssp.ssp",
    "a2l": "a2l.a2l",
    "efmu": "efmu.efmu",
}


@cache
def exporter(name: str) -> Exporter:
    """The exporter of a format. Raises KeyError for an unknown one."""
    found: Exporter = import_module(f".{FORMATS[name]}", __name__).EXPORTER
    return found


def export(model: Model, name: str, path: Path, options: Options | None = None) -> bytes:
    """
    The bytes of `model` in a format, for the file `path`, which is not written.

    Raises ExportError, and KeyError for an unknown format.
    """
    return run(exporter(name), name, model, path, options or {})
