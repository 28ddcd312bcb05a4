# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Several parameters outside of their tolerances: another plant, or the gain of the input."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from penode_sil.diagnosis import verdict
from penode_sil.diagnosis.catalogue import drives
from penode_sil.diagnosis.result import Cause, Value

UNITS = {"m": "kg", "c": "N/m", "d": "N*s/m", "delay": "s"}


def plant(unit: str = "N", inputs: int = 1, sensor: str = "m", tolerance: float = 0.03) -> SimpleNamespace:
    """A mass on spring and damper, each known to 3 %."""
    return SimpleNamespace(
        parameters={k: SimpleNamespace(value=v, tolerance=tolerance) for k, v in {"m": 50.0, "c": 3e4, "d": 900.0, "delay": 0.01}.items()},
        bodies=[SimpleNamespace(mass="m")],
        inputs=[SimpleNamespace(name="push", unit=unit)] * inputs,
        sensors=[SimpleNamespace(name="x", unit=sensor)],
    )


def fitted(model: SimpleNamespace, **factors: float) -> dict[str, Value]:
    """Parameters that are so many times what the file has, known to 2 %."""
    sizes = {k: model.parameters[k].value * f for k, f in factors.items()}
    return {k: Value(v, UNITS[k], (0.98 * v, 1.02 * v)) for k, v in sizes.items()}


def gain_of(model: SimpleNamespace, limit: float = 0.03, **factors: float) -> Cause | None:
    return drives.common_gain(model, fitted(model, **factors), dict.fromkeys(factors, limit))


def test_one_factor_is_the_gain_of_the_input():
    gain = gain_of(plant(), m=1.37, c=1.35, d=1.39, delay=1.0)
    assert gain is not None and (gain.kind, gain.where) == ("input_gain", "push")
    # weights are those of intervals 4 % of each factor wide; truth: their mean is within a tenth of a per cent of 1.37
    assert gain.parameters["gain"].value == pytest.approx(1.0 / 1.37, rel=2e-3)
    low, high = gain.parameters["gain"].ci95
    assert low < 1.0 / 1.39 and high > 1.0 / 1.35
    assert {a.where for a in gain.alternatives} == {"m", "c", "d"}


def test_without_tolerances_one_factor_is_a_gain_too():
    """Of values uncertain by 5 %."""
    model = plant(tolerance=0.0)
    gain = gain_of(model, 0.05, m=1.17, c=1.18)
    assert gain is not None and (gain.kind, gain.where) == ("input_gain", "push")
    assert gain_of(model, 0.05, m=1.17, c=1.40) is None


@pytest.mark.parametrize(
    "model, factors",
    [
        (plant(), {"m": 1.37, "c": 1.25, "d": 1.3}),  # by several factors
        (plant(), {"m": 1.37, "c": 1.37, "d": 1.0}),  # one is as the file has it
        (plant(), {"m": 1.37, "c": 1.0, "d": 1.0}),  # one is off
        (plant(), {"c": 1.37, "d": 1.37}),  # the mass is exact, or not known at all
        (plant(), {"m": 1.0, "c": 1.37, "d": 1.37}),  # it is as the file has it: forces are known
        (plant(), {"m": 1.02, "c": 1.03, "d": 1.01}),  # within tolerance
        (plant("m"), {"m": 1.37, "c": 1.37}),  # a road has no gain of forces
        (plant(inputs=2), {"m": 1.37, "c": 1.37}),
        (plant(sensor="N"), {"m": 1.37, "c": 1.37}),  # a load cell shows the forces themselves
    ],
)
def test_other_factors_are_parameters(model, factors):
    assert gain_of(model, **factors) is None


def test_several_parameters_out_of_tolerance_are_another_plant():
    model = plant()
    causes = tuple(Cause("wrong_parameter", n, {n: v}, 0.99) for n, v in fitted(model, m=1.37, c=1.25).items())
    assert verdict._plausible(model, causes[:1]) == (causes[:1], [])
    left, notes = verdict._plausible(model, causes)
    assert left == () and "another plant" in notes[0]
    assert verdict._plausible(plant(tolerance=0.0), causes) == (causes, [])
