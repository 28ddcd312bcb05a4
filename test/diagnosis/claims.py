# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a diagnosis claims, cause by cause, for reliability.py: how sure it is, whether that is right, whether its size may be nothing."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

# Parameters of a kind that are its size; all of them, where a kind is not here
SIZES = {
    "stribeck_friction": ("breakaway",),
    "bouc_wen": ("force",),
    "bump_stop": ("stiffness",),
    "maxwell_bushing": ("stiffness",),
    "hidden_resonance": ("mass",),
    "network_extrapolation": ("force_at_peak",),
}
PAIRS = {
    "asymmetric_damper": ("rebound", "compression"),
    "degressive_damper": ("low_rate_damping", "high_rate_damping"),
}  # size: their difference
NONE = {"scale": 1.0, "gain": 1.0}  # what a size is where nothing is wrong; 0 for others, for a parameter the value of the file


def nominals(model: Path) -> dict[str, float]:
    """Values of the parameters of a model file that a generator here has written, which is in SI units."""
    return {name: float(p["value"]) for name, p in tomllib.loads(model.read_text()).get("parameters", {}).items()}


def _holds(said: object, x: float) -> bool:
    """Does the 95 % interval of a parameter hold x?"""
    ends = said.get("ci95") if isinstance(said, Mapping) else None
    return bool(ends) and ends[0] <= x <= ends[1]


def may_be_nothing(cause: Mapping, nominal: Mapping[str, float]) -> bool:
    """Does the interval of its size hold what the model has without it? Of two values, those of each other."""
    kind, said = str(cause.get("kind")), cause.get("parameters") or {}
    if not isinstance(said, Mapping):
        return False
    if kind == "wrong_parameter":
        return any(name in nominal and _holds(v, nominal[name]) for name, v in said.items())
    if kind in PAIRS:
        two = [said.get(name) for name in PAIRS[kind]]
        return all(isinstance(x, Mapping) for x in two) and _holds(two[0], two[1]["value"]) and _holds(two[1], two[0]["value"])
    return any(_holds(said.get(name), NONE.get(name, 0.0)) for name in SIZES.get(kind, tuple(said)))


def right(causes: Sequence[Mapping], effects: Sequence[Mapping], explains: Callable[[Mapping, Mapping], bool]) -> list[bool]:
    """Which causes explain an effect, each another one: as many as there can be, the first before others."""
    of: dict[int, int] = {}  # effect: its cause

    def placed(cause: int, tried: set[int]) -> bool:
        """Has a cause an effect, those of others moved where they have another?"""
        for e, effect in enumerate(effects):
            if e not in tried and explains(causes[cause], effect):
                tried.add(e)
                if e not in of or placed(of[e], tried):
                    of[e] = cause
                    return True
        return False

    return [placed(c, set()) for c in range(len(causes))]


def claims(causes: Sequence[Mapping], correct: Sequence[bool], nominal: Mapping[str, float]) -> list[dict]:
    """For a row: of each named cause its words, its confidence, whether it is right, and whether its size may be nothing."""
    return [
        {
            "cause": f"{c.get('kind')} at {c.get('where') or ', '.join(c.get('parameters') or ())}",
            "confidence": c.get("confidence"),
            "right": ok,
            "nothing": may_be_nothing(c, nominal),
        }
        for c, ok in zip(causes, correct, strict=True)
    ]


def judged_by(diagnosis: Mapping) -> dict[str, float | None]:
    """For a row: what a diagnosis explains, and the trust in that by which it has multiplied the posterior of its causes."""
    return {"explained": diagnosis.get("explained"), "trust": (diagnosis.get("reliability") or {}).get("trust")}


def unlikely(diagnosis: Mapping, rightly: Callable[[Sequence[Mapping]], list[bool]], nominal: Mapping[str, float]) -> dict:
    """For a row: causes that a diagnosis has found and not named, for such answers are wrong at least as often as right; or empty."""
    found = diagnosis.get("unlikely") or {}
    return {**found, "causes": claims(found["causes"], rightly(found["causes"]), nominal)} if found else {}
