# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The search by innovations for what a model lacks: the forms accepted, and those large enough to be named."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .evidence.bench import Bench
from .evidence.blocks import Blocks
from .reconsider import reconsidered
from .rounds import Accepted, Rounds, terms_of
from .terms import Term


@dataclass(frozen=True, eq=False)
class Found:
    """What a search ends with: the bench with all accepted `terms` in it; `plain`, a bench with only the forms worth naming (`named`, with their
    terms there); and `small`, the other forms."""

    bench: Bench
    terms: tuple[Term, ...]
    plain: Bench
    named: tuple[Accepted, ...]
    small: tuple[Accepted, ...]


def search(bench: Bench, log: Callable[[str], None]) -> Found:
    """Accepts causes round by round, revises early choices once later ones are known, and puts the large forms in a bench of their own."""
    rounds = Rounds(bench, Blocks.of([len(r) // bench.update for r in bench.records]), log)
    end = reconsidered(rounds, rounds.grow())
    large = [a for a, big in zip(end.accepted, end.large) if big]
    small = tuple(a for a, big in zip(end.accepted, end.large) if not big)
    plain, _, named = rounds.beside(large) if small else (end.bench, end.scores, large)
    return Found(end.bench, tuple(terms_of(end.accepted)), plain, tuple(named), small)
