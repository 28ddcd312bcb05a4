# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Several parameters outside of their tolerances: another plant, or the gain of the input."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from penode_sil.diagnosis import verdict
from penode_sil.diagnosis.result import Cause, Value


def plant(unit: str = "N", inputs: int = 1, tolerance: float = 0.03) -> SimpleNamespace:
    """A mass on spring and damper, each known to 3 %."""
    return SimpleNamespace(
        parameters={k: SimpleNamespace(value=v, tolerance=tolerance) for k, v in {"m": 50.0, "c": 3e4, "d": 900.0}.items()},
        bodies=[SimpleNamespace(mass="m")],
        inputs=[SimpleNamespace(name="push", unit=unit)] * inputs,
    )


def wrong(model: SimpleNamespace, **factors: float) -> tuple[Cause, ...]:
    """Causes by parameters that are so many times what the file has, known to 2 %."""
    sizes = {k: model.parameters[k].value * f for k, f in factors.items()}
    return tuple(Cause("wrong_parameter", k, {k: Value(v, "1", (0.98 * v, 1.02 * v))}, 0.99) for k, v in sizes.items())


def test_one_factor_is_the_gain_of_the_input():
    model = plant()
    delay = Cause("sensor_delay", "x", {"delay": Value(1e-3, "s", (9e-4, 1.1e-3))}, 0.9)
    (gain, other), notes = verdict._plausible(model, (*wrong(model, m=1.37, c=1.35, d=1.39), delay))
    assert (gain.kind, gain.where, other) == ("input_gain", "push", delay) and "by a common factor" in notes[0]
    # weights are those of intervals 4 % of each factor wide; truth: their mean is within a tenth of a per cent of 1.37
    assert gain.parameters["gain"].value == pytest.approx(1.0 / 1.37, rel=2e-3)
    low, high = gain.parameters["gain"].ci95
    assert low < 1.0 / 1.39 and high > 1.0 / 1.35
    assert {a.where for a in gain.alternatives} == {"m", "c", "d"}


@pytest.mark.parametrize(
    "model, factors",
    [
        (plant(), {"m": 1.37, "c": 1.25}),  # by several factors
        (plant(), {"c": 1.37, "d": 1.37}),  # the mass is as the file has it: forces are known
        (plant("m"), {"m": 1.37, "c": 1.37}),  # a road has no gain of forces
        (plant(inputs=2), {"m": 1.37, "c": 1.37}),
    ],
)
def test_other_factors_are_another_plant(model, factors):
    causes, notes = verdict._plausible(model, wrong(model, **factors))
    assert causes == () and "another plant" in notes[0]


def test_without_tolerances_one_factor_is_a_gain_too_and_several_are_parameters():
    model = plant(tolerance=0.0)
    (gain,), _ = verdict._plausible(model, wrong(model, m=1.17, c=1.18))
    assert (gain.kind, gain.where) == ("input_gain", "push")
    causes = wrong(model, m=1.17, c=1.40)
    assert verdict._plausible(model, causes) == (causes, [])


def test_one_parameter_is_itself():
    model = plant()
    causes = wrong(model, m=1.37)
    assert verdict._plausible(model, causes) == (causes, [])
