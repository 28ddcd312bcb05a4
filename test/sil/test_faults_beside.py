# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Sensors at fault beside what innovations say: their faults are seen in the samples, whatever else is wrong."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from penode_sil.diagnosis import answers
from penode_sil.diagnosis.result import OUTSIDE, Cause

LOST = Cause("sensor_dropout", "a_wheel", {}, 0.99)
RUBS = Cause("coulomb_friction", "damper", {}, 0.9)


@pytest.mark.parametrize(
    ("verdict", "causes", "expected"),
    [
        ("no_discrepancy", (), ("explained", (LOST,))),
        ("explained", (RUBS,), ("explained", (RUBS, LOST))),
        ("explained", (LOST,), ("explained", (LOST,))),
        ("partly_explained", (RUBS,), ("partly_explained", (RUBS, LOST))),
    ],
)
def test_faults_have_names_beside_causes(monkeypatch: Any, verdict: str, causes: tuple[Cause, ...], expected: tuple[str, Any]) -> None:
    answer = _answer(monkeypatch, verdict, causes)
    assert (answer.verdict, answer.causes) == expected


def test_what_is_unexplained_stays_so(monkeypatch: Any) -> None:
    """Where nothing follows the recordings, what is far from the model is no fault of a sensor."""
    answer = _answer(monkeypatch, "unexplained", ())
    assert answer.verdict == "unexplained" and [c.kind for c in answer.causes] == [OUTSIDE]


def _answer(monkeypatch: Any, verdict: str, causes: tuple[Cause, ...]) -> Any:
    """What `by_innovations` makes of a search with this end, beside whose fit a sensor drops out."""
    monkeypatch.setattr(answers, "write_extended", lambda text, case: None)
    monkeypatch.setattr(answers.explanation, "rows", lambda study: 8)
    monkeypatch.setattr(answers.plausible, "doubt", lambda *of: "")
    fit, empty = object(), {"gain": {}, "numerics": {}, "explanations": (), "notes": ()}
    w: Any = SimpleNamespace(
        study=SimpleNamespace(null=SimpleNamespace(cost=8.0)),
        causes=causes,
        verdict=verdict,
        explained=1.0,
        text="",
        fit=fit,
        held=(),
        withheld=(),
        without=None,
        **empty,
    )
    case: Any = SimpleNamespace(remarks=())
    return answers.by_innovations(case, w, None, lambda seen: [LOST] if seen is fit else []).answer
