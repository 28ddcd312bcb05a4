# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Errors that a user can mend: one line each, what, where and the remedy. The command prints them and ends with 2."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class UserError(Exception):
    """Something the user can mend; `problems` has one line for each thing that is wrong."""

    def __init__(self, *problems: str):
        self.problems = list(problems)
        super().__init__("\n".join(problems))


def hint(name: str, known: Iterable[str]) -> str:
    """The remedy for a name that is not known: the nearest one if there is one, else all."""
    known = list(known)
    near = difflib.get_close_matches(name, known, n=1)
    if near:
        return f'did you mean "{near[0]}"?'
    return f"use one of: {', '.join(known)}" if known else "there is none here: remove it"
