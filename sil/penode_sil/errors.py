# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Errors of the rooms of penode_sil; the tree of all of them stands in penode_gen.errors."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from penode_gen.errors import InternalError, ModelError, NetworkError, PenodeError, Problem, UserError

__all__ = [
    "InternalError",
    "ModelError",
    "NetworkError",
    "NotConverged",
    "PenodeError",
    "Problem",
    "RecordingError",
    "ScenarioError",
    "TargetError",
    "ToolMissing",
    "UserError",
    "WrongUse",
    "hint",
]


class RecordingError(UserError):
    """A recording that cannot be read, or does not fit the model."""

    code = "recording"


class ScenarioError(UserError):
    """A scenario file that cannot be read, or does not fit the model."""

    code = "scenario"


class NotConverged(UserError):
    """A training that did not come down to the noise, and has nothing to write."""

    code = "not-converged"
    exit = 4


class ToolMissing(UserError):
    """A compiler, an emulator or a Python package that is not installed."""

    code = "tool-missing"


class TargetError(UserError):
    """A board, an emulator or a controller, or the line to it, that does not do what it should."""

    code = "target"


class WrongUse(UserError):
    """Options, paths or variables of the environment that the command cannot work with."""

    code = "usage"


def hint(name: str, known: Iterable[str]) -> str:
    """The remedy for a name that is not known: the nearest one if there is one, else all."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1)
    if near:
        return f'did you mean "{near[0]}"?'
    return f"use one of: {', '.join(known)}" if known else "there is none here: remove it"
