# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a signal measures: a state itself, or states of a sensor that follow it, like those of a filter or a delay."""

from __future__ import annotations

import re
from collections.abc import Iterable

from .. import model as m


def measures(name: str, expression: str, equations: Iterable[m.Equation]) -> bool:
    """Does a signal with this expression measure the state `name`: by having it in the expression, or states whose equations have it, and
    on which it does not depend itself?"""
    texts = {state: q.text for q in equations for state in re.findall(r"\bder\((\w+)\)", q.text)}
    if _has(expression, name):
        return True
    followed, acting = (_behind(text, texts, {name}) - {name} for text in (expression, texts.get(name, "")))
    return any(_has(texts[x], name) for x in followed) and not followed & acting


def _behind(text: str, texts: dict[str, str], seen: set[str]) -> set[str]:
    """All states that a text depends on: those that it names, and those behind them in their equations."""
    for name in texts:
        if name not in seen and _has(text, name):
            seen = _behind(texts[name], texts, seen | {name})
    return seen


def _has(text: str, name: str) -> bool:
    return re.search(rf"\b{name}\b", text) is not None
