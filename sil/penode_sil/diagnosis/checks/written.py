# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The extended model file, written and read back."""

from __future__ import annotations

import os
from pathlib import Path

import penode_gen
from penode_gen.model import Model

from ..extend.entries import extends, head
from ..result import EXTENDED
from .case import Case

Sections = dict[str, dict[str, str]]


def write_extended(text: str, case: Case) -> Model:
    """Writes the model file with what was learnt beside the rest, with a path to the nominal one such that both can be moved together; the
    model of it."""
    case.output.mkdir(parents=True, exist_ok=True)
    nominal, own = case.nominal.path.resolve(), case.model.path.resolve()
    if own != nominal:
        text = joined(own.read_text(), text.replace(extends(own), extends(nominal), 1).replace(own.name, nominal.name, 1))
    beside = Path(os.path.relpath(nominal, case.output.resolve()))
    (case.output / EXTENDED).write_text(text.replace(extends(nominal), extends(beside), 1))
    return penode_gen.load(case.output / EXTENDED)


def heading(model: Model, learnt: str) -> list[str]:
    """The first lines of a model file that extends another one by what was learnt, down to its parameters."""
    return [*head(model, learnt), "[parameters]"]


def joined(base: str, text: str) -> str:
    """A model file with the entries of another one that it extended, where it does not have them itself; an entry is a line."""
    sections = _sections(text)
    for title, entries in _sections(base).items():
        if title and title != "[model]":
            sections[title] = entries | sections.get(title, {})
    return "\n".join(line for title, entries in sections.items() for line in ([title] * bool(title) + list(entries.values()) + [""]))


def _sections(text: str) -> Sections:
    """Lines by title of their section and key; what is before the first one has the title "", and comments are their own keys."""
    found: Sections = {"": {}}
    title = ""
    for line in filter(None, text.splitlines()):
        if line.startswith("["):
            title = line
            found.setdefault(title, {})
        else:
            found[title][line.partition("=")[0].strip()] = line
    return found
