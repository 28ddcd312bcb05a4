# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Sensors that clip or drop out, by made-up samples beside a simulation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis.checks import broken

ROWS = 10_000


@pytest.mark.parametrize(
    "high, model, kinds",
    [
        (2.5, 3.0, ["sensor_clipping"]),  # 15 samples at the greatest value there is, and the model goes on beyond
        (2.5, 1.0, ["sensor_dropout"]),  # the model is below: the sensor was held
        (9.0, 10.0, ["sensor_dropout"]),  # the value was exceeded elsewhere
    ],
)
def test_a_rail_may_be_met_once(high, model, kinds):
    """Flat samples that no statistics of the record shows, for they are too few, are a rail if the sensor never shows more."""
    y, at = np.zeros(ROWS), slice(5000, 5015)
    y[100], y[at] = min(high, 2.4) if high < 9.0 else high, 2.5
    quality = SimpleNamespace(rows=ROWS, low=None, high=None, quantum=0.0, held=0, missing=0, spikes=0)
    measured = SimpleNamespace(
        z={"a": y}, mask={"a": np.ones(ROWS, bool)}, shown={"a": np.ones(ROWS, bool)}, quality=SimpleNamespace(channels={"a": quality})
    )
    study = SimpleNamespace(experiments=[SimpleNamespace(time=np.arange(ROWS))], levels=[np.full((1, 1), 1e-4)])
    sensors = SimpleNamespace(sensors=[SimpleNamespace(name="a", unit="m/s^2")])
    simulated, burst = y.copy(), np.zeros((ROWS, 1), bool)
    simulated[at], burst[at] = model, True
    found = broken.broken_sensors(sensors, [measured], study, [simulated[:, None]], [burst])
    assert [c.kind for c in found] == kinds
    if kinds == ["sensor_clipping"]:
        assert found[0].parameters["high"].value == found[0].parameters["limit"].value == 2.5


@pytest.mark.parametrize("lost", [0, 30])
def test_between_two_rails_a_sensor_goes_on(lost):
    """Six samples on either rail are one burst with the eight between them, which the model agrees with. Of a hole elsewhere all count,
    near the model or not."""
    y = np.zeros(ROWS)
    y[5000:5020] = np.clip(np.linspace(-7.0, 7.0, 20), -2.5, 2.5)
    quality = SimpleNamespace(rows=ROWS, low=None, high=None, quantum=0.0, held=0, missing=0, spikes=0)
    measured = SimpleNamespace(
        z={"a": y}, mask={"a": np.ones(ROWS, bool)}, shown={"a": np.ones(ROWS, bool)}, quality=SimpleNamespace(channels={"a": quality})
    )
    study = SimpleNamespace(experiments=[SimpleNamespace(time=np.arange(ROWS))], levels=[np.full((1, 1), 1e-4)])
    sensors = SimpleNamespace(sensors=[SimpleNamespace(name="a", unit="m/s^2")])
    simulated, burst = y.copy(), np.zeros((ROWS, 1), bool)
    simulated[5000:5020], burst[5000:5020] = np.linspace(-7.0, 7.0, 20), True
    simulated[7000 : 7000 + lost], burst[7000 : 7000 + lost] = np.linspace(-1.0, 1.0, lost + 1)[:lost], True
    cause, *others = broken.broken_sensors(sensors, [measured], study, [simulated[:, None]], [burst])
    assert cause.kind == "sensor_clipping" and {k: v.value for k, v in cause.parameters.items()} == {"limit": 2.5, "low": -2.5, "high": 2.5}
    assert [(c.kind, c.parameters["share"].value) for c in others] == [("sensor_dropout", lost / ROWS)] * bool(lost)


def test_a_sensor_that_drops_out_does_so_near_its_value_too():
    """Zeros in two recordings, some of them while the model goes through zero: all count, and their ends say how sure that is."""
    t = np.arange(ROWS) * 1e-3
    model = np.sin(np.pi * t)
    recordings, simulated = [], []
    for holes in ((5490, 30, True), (7990, 20, False)), ((2490, 4, True),):
        y, mask = model + 0.01 * np.random.default_rng(len(holes)).normal(size=ROWS), np.ones(ROWS, bool)
        for first, n, seen in holes:
            y[first : first + n], mask[first : first + n] = 0.0, not seen
        held = int(np.count_nonzero(~mask))
        quality = SimpleNamespace(rows=ROWS, low=None, high=None, quantum=0.0, held=held, missing=0, spikes=0)
        channels = SimpleNamespace(channels={"a": quality})
        recordings.append(SimpleNamespace(z={"a": y}, mask={"a": mask}, shown={"a": np.ones(ROWS, bool)}, quality=channels))
        simulated.append(model[:, None])
    study = SimpleNamespace(experiments=[SimpleNamespace(time=t)] * 2, levels=[np.full((1, 1), 1e-4)] * 2)
    sensors = SimpleNamespace(sensors=[SimpleNamespace(name="a", unit="m/s^2")])
    (cause,) = broken.broken_sensors(sensors, recordings, study, simulated, [np.zeros((ROWS, 1), bool)] * 2)
    share = cause.parameters["share"]
    assert share.value == pytest.approx((30 + 20 + 4) / (2 * ROWS))
    assert share.ci95[0] < share.value < share.ci95[1] < 1.15 * share.value


@pytest.mark.parametrize(
    "held, away, quantum, told", [(3, 0.25, 0.0, True), (2, 0.25, 0.0, False), (4, 0.15, 0.0, False), (4, 0.25, 0.05, False)]
)
def test_few_samples_that_are_far_off_are_enough(held, away, quantum, told):
    """Three zeros, 25 deviations of the noise from the model; not two, not at 15, nor of a sensor that is coarse."""
    y, mask = np.full(ROWS, away) + 0.01 * np.random.default_rng(1).normal(size=ROWS), np.ones(ROWS, bool)
    y[5000 : 5000 + held], mask[5000 : 5000 + held] = 0.0, False
    quality = SimpleNamespace(rows=ROWS, low=None, high=None, quantum=quantum, held=held, missing=0, spikes=0)
    measured = SimpleNamespace(
        z={"a": y}, mask={"a": mask}, shown={"a": np.ones(ROWS, bool)}, quality=SimpleNamespace(channels={"a": quality})
    )
    study = SimpleNamespace(experiments=[SimpleNamespace(time=np.arange(ROWS))], levels=[np.full((1, 1), 1e-4)])
    sensors = SimpleNamespace(sensors=[SimpleNamespace(name="a", unit="m/s^2")])
    found = broken.broken_sensors(sensors, [measured], study, [np.full((ROWS, 1), away)], [np.zeros((ROWS, 1), bool)])
    assert [c.kind for c in found] == ["sensor_dropout"] * told
