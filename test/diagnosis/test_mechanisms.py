# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Short cases of the campaign on mechanisms; and that its generator keeps the laws of mechanics."""

import numpy as np
import pytest
from mechanisms import generator
from mechanisms_campaign import LIMIT, model_of, score

from penode_sil.diagnosis.study import missing


@pytest.mark.parametrize(
    "plant, kind, seed", [("halfcar", "friction", 901), ("drive", "backlash", 902), ("drive", "friction", 3), ("drive", "nothing", 903)]
)
def test_places_and_missing_force(plant, kind, seed):
    case = {"halfcar": generator.halfcar, "drive": generator.drive}[plant]([kind], [seed], 3.0)[0]
    found = score(model_of(plant), case)
    assert not found.unseen
    assert found.error < LIMIT
    assert found.verdict in ("", "no_discrepancy")


def test_a_free_angle_of_many_deviations_is_no_force(monkeypatch):
    """The shaft turns by a million deviations of its sensor, and no spring holds it. A filter that forgets the angle, as it did before,
    makes a force of that and misses the true one: so does this one without the weights of its samples."""
    case = generator.drive(["friction"], [3], 3.0)[0]
    monkeypatch.setattr(missing, "_fade", lambda n: np.ones((n, 1)))
    assert score(model_of("drive"), case).error > 2 * LIMIT


def test_generator_keeps_the_balance_of_power():
    """Drive: work of the torque = losses + energy. Trapezoids at 1 kHz of what moves at 12 Hz or less: (2 pi 12/1000)^2/12 = 5e-4; 2e-3
    allowed."""
    case = generator.drive(["friction"], [5], 3.0)[0]
    rng = np.random.default_rng([5, 2])
    p = generator.drawn(rng, jm=0.02, jl=0.8, k=900.0, d=3.0, dl=0.5, dm=0.03)
    motor, load = case.y.T  # noise of 1e-6 rad is 5e-4 rad/s in a rate over 2 ms, of some 2 rad/s
    w_m, w_l = np.gradient(motor, 1e-3), np.gradient(load, 1e-3)
    work = np.trapezoid(case.u[:, 0] * w_m, dx=1e-3)
    lost = np.trapezoid(p["dm"] * w_m**2 + p["dl"] * w_l**2 + p["d"] * (w_m / 3 - w_l) ** 2 + case.hidden * w_l, dx=1e-3)
    stored = 0.5 * (p["jm"] * w_m[-2] ** 2 + p["jl"] * w_l[-2] ** 2 + p["k"] * (motor[-2] / 3 - load[-2]) ** 2)
    assert abs(work - lost - stored) < 2e-3 * abs(work)
