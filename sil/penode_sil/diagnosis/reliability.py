# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How often named causes were right in simulated cases, by what they explain and by their confidence: the tables that
test/diagnosis/reliability.py --take-over keeps in templates/."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from penode_gen.resources import resource

from .result import OUTSIDE, Cause

TABLE = resource("penode_sil.diagnosis", "templates", "reliability.json")  # beside the page that states it


def trust(explained: float, table: Path | None = None) -> float:
    """How likely the best explanation of the catalogue is right that takes away this share of the avoidable residual: the share that was,
    of the posterior of those which took about as much."""
    return float(level(_levels(table), explained)["share"])


def is_likely(explained: float, table: Path | None = None) -> bool:
    """Were answers that took about this share of the avoidable residual more often right than wrong?"""
    return mostly_right(level(_levels(table), explained))


def trusted(cause: Cause, explained: float) -> Cause:
    """A cause of an answer that takes this share of the avoidable residual, its posterior times the trust in such answers."""
    return replace(cause, confidence=trust(explained) * cause.confidence)


def level(levels: Sequence[Mapping[str, Any]], explained: float) -> Mapping[str, Any]:
    """The one of these levels of trust, the highest first, that an answer is on which takes this share."""
    return next((x for x in levels if explained >= x["explained"]), levels[-1])


def mostly_right(level: Mapping[str, Any]) -> bool:
    """Were more of the causes on a level right than wrong?"""
    return bool(level["right"] > level["named"] - level["right"])


def _levels(table: Path | None) -> list[dict[str, Any]]:
    levels: list[dict[str, Any]] = json.loads((table or TABLE).read_text(encoding="utf-8"))["trust"]
    return levels


def reliability(causes: Sequence[Cause], explained: float, table: Path | None = None) -> dict[str, Any] | None:
    """What is known of these causes, which take the share `explained` of the avoidable residual: its `source`, the `deciles` of confidence
    that they are in, and the `trust` that their posterior was multiplied by; None if no table is kept."""
    table = table or TABLE
    if not table.exists():
        return None
    kept = json.loads(table.read_text(encoding="utf-8"))
    own = [c.confidence for c in causes if c.kind != OUTSIDE]
    deciles = [d for d in kept["deciles"] if any(_in(d, x) for x in own)]
    return {"source": kept["source"], "cases": kept["cases"], "deciles": deciles, "trust": trust(explained, table)}


def _in(decile: dict[str, Any], confidence: float) -> bool:
    top = decile["to"] >= 1.0
    return bool(decile["from"] <= confidence + 1e-9 and (top or confidence + 1e-9 < decile["to"]))


def line(known: dict[str, Any] | None, confidence: float) -> str:
    """What is known of a confidence, with its source."""
    if known is None:
        return "how often causes named with this confidence are right is not recorded"
    found = next((d for d in known["deciles"] if _in(d, confidence)), None)
    if found is None:
        return f"no cause was named with this confidence in simulated cases ({known['source']})"
    low, high = (f"{100 * x:.0f}" for x in found["ci95"])
    band = f"{100 * found['from']:.0f} to {100 * found['to']:.0f} %"
    share = (
        f"{found['right']} of {found['named']} were right ({100 * found['right'] / found['named']:.0f} %, 95 % interval {low} to {high} %)"
    )
    return f"of causes named with {band} confidence in simulated cases, {share}; source: {known['source']}"
