# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Scores a diagnosis of a wrong world: the effects are named, with their place, and nothing else is."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from itertools import permutations

from claims import claims, judged_by, right, unlikely

OUTSIDE = "outside_taxonomy"
FORCELESS = ("wrong_parameter", "sensor_", "input_", "integration_error")  # causes that need no law
HONEST = ("no_discrepancy", "unexplained", "not_identifiable")  # verdicts of a null world; mis-modelling is real, and may be seen


def names(cause: Mapping, kind: str, where: Sequence[str], parameters: Sequence[str]) -> bool:
    """Whether a cause is of this kind at one of these places; a wrong parameter by its name alone."""
    if cause.get("kind") != kind:
        return False
    if kind == "wrong_parameter":
        return list(cause.get("parameters") or ()) == list(parameters)
    return not where or not cause.get("where") or cause["where"] in where


def explains(cause: Mapping, effect: Mapping) -> bool:
    """The cause is the effect, or an equivalent of it."""
    if names(cause, effect["kind"], effect["where"], list(effect["parameters"])):
        return True
    return any(names(cause, e["kind"], e["where"], e.get("parameters", ())) for e in effect["equivalents"])


def all_by(causes: Sequence[Mapping], effects: Sequence[Mapping]) -> bool:
    """Each cause explains another effect, and none is left."""
    return len(causes) == len(effects) and any(all(map(explains, causes, order)) for order in permutations(effects))


def named(diagnosis: Mapping) -> list[Mapping]:
    """Causes of the answer, small deviations and the one that says that it is not on the list left out."""
    return [c for c in diagnosis.get("causes") or [] if not c.get("small") and c.get("kind") != OUTSIDE]


def together(causes: Sequence[Mapping], effects: Sequence[Mapping]) -> list[Mapping]:
    """Causes, where wrong parameters that only all together are an equivalent count as one."""
    for effect in effects:
        for other in effect["equivalents"]:
            whole = other.get("parameters") or []
            some = [c for c in causes if c.get("kind") == "wrong_parameter" and set(c.get("parameters") or ()) <= set(whole)]
            if whole and {k for c in some for k in c["parameters"]} == set(whole):
                return [*(c for c in causes if c not in some), {"kind": "wrong_parameter", "parameters": dict.fromkeys(whole)}]
    return list(causes)


def without_companions(causes: Sequence[Mapping], effects: Sequence[Mapping]) -> list[Mapping]:
    """Causes, without wrong parameters that only say which side of a named asymmetric curve the file's value is."""
    free = [p for e in effects for p in e.get("companions", ()) if any(names(c, e["kind"], e["where"], ()) for c in causes)]
    return [c for c in causes if not any(names(c, "wrong_parameter", (), [p]) for p in free)]


def outcome(truth: Mapping, diagnosis: Mapping | None) -> str:
    """Right, or what is wrong."""
    if diagnosis is None:
        return "no answer"
    effects = truth["effects"]
    causes = without_companions(together(named(diagnosis), effects), effects)
    if not effects:
        return "false alarm" if causes else "right" if diagnosis.get("verdict") in HONEST else "claim without a name"
    if all_by(causes, effects):
        return "right"
    if any(all_by(x.get("causes") or [], effects) for x in diagnosis.get("explanations") or []):
        return "in the set, not first"
    if not causes:
        return "missed"
    if all(any(explains(c, e) for c in causes) for e in effects):
        return "extra name"
    return "part missed" if all(any(explains(c, e) for e in effects) for c in causes) else "wrong name"


def rightly(causes: Sequence[Mapping], effects: Sequence[Mapping]) -> list[bool]:
    """Which named causes are right. Those that `outcome` does not count by themselves, as companions or parts of a whole, are."""
    counted = without_companions(together(causes, effects), effects)
    correct = right(causes, effects, explains)
    return [ok or not any(c is x for x in counted) for c, ok in zip(causes, correct, strict=True)]


def score(truth: Mapping, diagnosis: Mapping | None, nominal: Mapping[str, float] | None = None) -> dict:
    """One row; `covered`: whether each 95 % interval of a parameter that the truth names holds it; `nominal`: parameters of the model
    file."""
    what, effects = outcome(truth, diagnosis), truth["effects"]
    causes = named(diagnosis or {})
    covered = []
    for cause in causes if what == "right" else []:
        for effect in effects:
            for name, value in (
                effect["parameters"].items() if names(cause, effect["kind"], effect["where"], list(effect["parameters"])) else ()
            ):
                got = (cause.get("parameters") or {}).get(name)
                if isinstance(got, Mapping) and got.get("ci95"):
                    covered.append([f"{effect['kind']}.{name}", bool(got["ci95"][0] <= value <= got["ci95"][1])])
    words = [f"{c.get('kind')} at {c.get('where') or ', '.join(c.get('parameters') or ())}" for c in causes]
    return {
        "case": f"{truth['seed']}:{truth['index']}",
        "stratum": truth["stratum"],
        "group": truth["group"],
        "plant": truth["plant"],
        "tolerance": truth["tolerance"],
        "mismodelling": truth["mismodelling"],
        "kinds": [e["kind"] for e in effects],
        "ratios": [e["ratio"] for e in effects],
        "answer": words,
        "confidence": [c.get("confidence") for c in causes],
        "named": claims(causes, rightly(causes, effects), nominal or {}),
        "unlikely": unlikely(diagnosis or {}, lambda found: rightly(found, effects), nominal or {}),
        "verdict": (diagnosis or {}).get("verdict"),
        "outcome": what,
        "right": what == "right",
        "covered": covered,
    } | judged_by(diagnosis or {})


def small(notes: Sequence[str]) -> list[str]:
    """Kinds that a diagnosis reports as real but small, and keeps in its extended model."""
    return [n.split(" at ")[0].lower().replace(" ", "_") for n in notes if "; not named, but in model_extended.toml" in n]


def added_laws(nominal: str, extended: str, kinds: Sequence[str]) -> tuple[int, int]:
    """Elements that the extended model has beyond the nominal one, and how many of the kinds reported act by a law of their own."""
    before, after = (tomllib.loads(x).get("elements", {}) for x in (nominal, extended))
    return len([k for k in after if k not in before]), sum(not k.startswith(FORCELESS) for k in kinds)
