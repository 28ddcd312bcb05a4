# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What an export is. A format is a module below this package that ends in `EXPORTER = Exporter(...)`, and a line of FORMATS."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..model import Model, ModelError

Options = dict[str, Any]  # keyed by Option.name; an option that was not given has its default


class ExportError(ModelError):
    """A model, or an option, that a format has no form for; `problems` has one line for each, with place and remedy."""

    def __init__(self, *problems: str):
        super().__init__(list(problems))
        if all(problem.place.startswith("--") for problem in self.problems):
            self.code = "usage"


@dataclass(frozen=True)
class Option:
    """
    An option of a format; `name` is a Python name, --NAME with hyphens on the command line.

    `kind`: "text", "file" (a Path that exists), "flag", or "number". Formats may share an option: then all declare the same.
    """

    name: str
    help: str
    kind: str = "text"
    choices: tuple[str, ...] = ()
    default: Any = None


@dataclass(frozen=True)
class Exporter:
    """
    A format. `build` returns the bytes of the file: the same for the same model and options, on any day and in any folder.

    It raises ExportError, and never asks for more than `needs` (Python packages, by their import names) beyond what
    penode itself depends on.
    """

    summary: str  # a line for people
    suffixes: tuple[str, ...]  # what the name of the file ends in
    build: Callable[[Model, Options], bytes]
    options: tuple[Option, ...] = ()
    needs: tuple[str, ...] = ()
    extra: str = ""  # that of penode which installs `needs`
    notes: Callable[[Options], list[str]] = lambda options: []  # what the file lacks because something is not installed here, a line each

    def missing(self) -> list[str]:
        """The packages of `needs` that are not installed."""
        return [name for name in self.needs if importlib.util.find_spec(name) is None]


def run(exporter: Exporter, name: str, model: Model, path: Path, options: Options) -> bytes:
    """The bytes of an export that is to be written to `path`. Raises ExportError."""
    missing = exporter.missing()
    if missing:
        packages = " ".join(missing)
        remedy = f"penode[{exporter.extra}]" if exporter.extra else packages
        raise ExportError(f"--format {name}: it needs the Python package {packages}, which is not installed; pip install {remedy}")
    if path.suffix.lower() not in exporter.suffixes:
        raise ExportError(
            f'{path}: a file of the format {name} does not end in "{path.suffix}"; end its name in {_either(exporter.suffixes)}'
        )
    return exporter.build(model, {option.name: option.default for option in exporter.options} | options)


def _either(words: Iterable[str]) -> str:
    return " or ".join(words)
