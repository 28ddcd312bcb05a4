# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Scores a diagnosis of a rig: exactly one of the accepted sets is named, beside small effects that are there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

OUTSIDE = "outside_taxonomy"
RIGHT, SMALL, PART, FALSE, MISSED = "right", "right with a small effect", "part missed", "false", "missed"
ALARM, UNSURE, NONE = "false alarm", "unsure", "no answer"
SI = {"mm": 1e-3, "deg": 0.017453292519943295, "%": 0.01}  # units that a diagnosis may give as SI units

Name = Sequence[str]  # kind and place


def at(place: str, allowed: str) -> bool:
    """Is the place, or one of several, among the allowed ones, `a|b`? `*` allows any."""
    return allowed == "*" or bool(set(allowed.split("|")) & {p.strip() for p in place.replace("|", ",").split(",")})


def among(name: Name, names: Sequence[Name]) -> bool:
    return any(name[0] == kind and at(name[1], place) for kind, place in names)


def named(diagnosis: Mapping) -> list[Name]:
    """Kind and place of the causes, those that are marked `small` left out."""
    return [(str(c["kind"]), str(c.get("where") or "")) for c in diagnosis.get("causes") or [] if not c.get("small")]


def whole(names: Sequence[Name], accepted: Sequence[Name]) -> bool:
    """Does each of the accepted ones stand among the names?"""
    return all(any(among(n, [x]) for n in names) for x in accepted)


def outcome(truth: Mapping, diagnosis: Mapping | None) -> str:
    """Right, or what is wrong. A model of a null case is true, so that `outside_taxonomy` is a false alarm there."""
    if diagnosis is None:
        return NONE
    names, verdict = named(diagnosis), diagnosis.get("verdict")
    if truth["null"]:
        return ALARM if names else RIGHT if verdict == "no_discrepancy" else UNSURE
    if verdict in truth["verdicts"] and all(kind == OUTSIDE for kind, _ in names):
        return RIGHT
    for accepted in truth["accepted"]:
        rest = [n for n in names if among(n, accepted) or not among(n, truth["tolerated"])]
        if all(among(n, accepted) for n in rest) and whole(rest, accepted):
            return RIGHT if len(rest) == len(names) else SMALL
    known = [n for n in names if any(among(n, accepted) for accepted in truth["accepted"])]
    wrong = [n for n in names if n not in known and not among(n, truth["tolerated"])]
    return FALSE if wrong else PART if known else MISSED


def beside_expert(truth: Mapping, diagnosis: Mapping | None) -> float | None:
    """Hold-out error of the written model over that of the true law, as fitted, in the sensor where it is largest."""
    gain, expert = (diagnosis or {}).get("gain") or {}, truth["holdout"].get("expert", {})
    found = []
    for sensor, unit in truth["units"].items():
        reported = gain.get(sensor) or {}
        if reported.get("after_rmse") is not None and sensor in expert:
            found.append(reported["after_rmse"] / (1.0 if reported.get("unit") == unit else SI.get(unit, 1.0)) / expert[sensor])
    return round(max(found), 3) if found else None


def score(truth: Mapping, diagnosis: Mapping | None) -> dict:
    """One row of the campaign."""
    what = outcome(truth, diagnosis)
    return {
        "case": f"{truth['seed']}:{truth['index']}",
        "rig": truth["rig"],
        "null": truth["null"],
        "what": truth["what"],
        "answer": [f"{kind} at {place}" for kind, place in named(diagnosis or {})],
        "confidence": [c.get("confidence") for c in (diagnosis or {}).get("causes") or [] if not c.get("small")],
        "verdict": (diagnosis or {}).get("verdict"),
        "outcome": what,
        "beside_expert": beside_expert(truth, diagnosis),
    }
