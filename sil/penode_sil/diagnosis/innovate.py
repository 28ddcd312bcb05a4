# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The search for what is missing by innovations: what it accepts, and which of that is worth a name."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .evidence.bench import Bench
from .evidence.blocks import Blocks
from .reconsider import reconsidered
from .rounds import Accepted, Grown, Rounds, terms_of, with_accepted
from .terms import Term


@dataclass(frozen=True, eq=False)
class Found:
    """What a search ends with: the bench with all accepted `terms` in it, and a `plain` one with those forms alone that are worth a name,
    `named`, with their terms in it; `small`: the others."""

    bench: Bench
    terms: tuple[Term, ...]
    plain: Bench
    named: tuple[Accepted, ...]
    small: tuple[Accepted, ...]


def search(bench: Bench, log: Callable[[str], None]) -> Found:
    """Causes accepted round by round; early choices are reconsidered when the others are known."""
    rounds = Rounds(bench, Blocks.of([len(r) // bench.update for r in bench.records]), log)
    return _apart(bench, reconsidered(rounds, rounds.grow()))


def _apart(start: Bench, grown: Grown) -> Found:
    """What a search has accepted, the large forms in a bench of their own."""
    large = [a for a, big in zip(grown.accepted, grown.large) if big]
    small = tuple(a for a, big in zip(grown.accepted, grown.large) if not big)
    plain, named = with_accepted(start, large) if small else (grown.bench, large)
    return Found(grown.bench, tuple(terms_of(grown.accepted)), plain, tuple(named), small)
