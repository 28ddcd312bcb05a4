# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What an import is: a function `networks(text, path, options)` that returns networks by name, or raises ImportProblem."""

from __future__ import annotations

from dataclasses import dataclass

from ..model import ModelError


class ImportProblem(ModelError):
    """A file that cannot be read; `problems` has one line: file, place, what, remedy."""

    def __init__(self, *problems: str):
        super().__init__(list(problems))


@dataclass(frozen=True)
class Options:
    """What the file does not say: the activation of all layers but the last, where no block beside the record names them."""

    activation: str = "relu"
