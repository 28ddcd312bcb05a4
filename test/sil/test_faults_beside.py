# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Sensors at fault beside what innovations say: their faults are seen in the samples, whatever else is wrong."""

from __future__ import annotations

from typing import Any

import pytest

from penode_sil.diagnosis.result import UNKNOWN, Cause
from penode_sil.diagnosis.verdict import beside_faults

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
def test_faults_have_names_beside_causes(verdict: str, causes: tuple[Cause, ...], expected: tuple[str, Any]) -> None:
    assert beside_faults(verdict, causes, [LOST], False) == expected


def test_what_is_unexplained_stays_so() -> None:
    """Where nothing follows the recordings, what is far from the model is no fault of a sensor."""
    assert beside_faults("unexplained", (), [LOST], False) == ("unexplained", (UNKNOWN,))


@pytest.mark.parametrize(
    ("verdict", "causes", "expected"),
    [("no_discrepancy", (), ("unexplained", (UNKNOWN,))), ("explained", (RUBS,), ("partly_explained", (RUBS,)))],
)
def test_a_tone_has_no_name(verdict: str, causes: tuple[Cause, ...], expected: tuple[str, Any]) -> None:
    assert beside_faults(verdict, causes, [], True) == expected
