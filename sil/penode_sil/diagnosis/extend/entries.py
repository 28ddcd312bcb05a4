# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Entries of an extended model file as text."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from itertools import chain, count
from pathlib import Path

from penode_gen.model import Model


def table(values: Mapping[str, object]) -> str:
    """An inline table."""
    return "{ " + ", ".join(f"{k} = {toml(v)}" for k, v in values.items()) + " }"


def toml(value: object) -> str:
    """A value; numbers to seven digits."""
    if isinstance(value, str):
        return '"' + value.replace("\\", "\\\\").replace('"', '\\"') + '"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, int):
        return str(value)
    return repr(float(f"{value:.7g}"))


def unlike(stem: str, taken: Collection[str]) -> str:
    """A name that is not taken: the stem, or the stem with a number."""
    return next(name for name in chain([stem], (f"{stem}_{n}" for n in count(2))) if name not in taken)


def extends(path: Path) -> str:
    """The line that names the nominal model file."""
    return f"extends = {toml(path.as_posix())}"


def head(model: Model, learnt: str, substeps: int = 1) -> list[str]:
    """The first lines of a model file that extends another one by what was `learnt`, down to the end of [model]."""
    return [
        f"# Extension of {model.path.name} from recordings: {learnt}.",
        "",
        "[model]",
        extends(model.path.resolve()),
        f"name = {toml(model.name + '_extended')}",
        f"sample_time = {toml(f'{model.sample_time:.12g} s')}",
        *[f"substeps = {substeps}"] * (substeps > model.substeps),
        "",
    ]
