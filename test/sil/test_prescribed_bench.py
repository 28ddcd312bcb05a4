# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The bench of a damper whose motion is prescribed, and the force there with forms of causes in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_gen.model import Element
from penode_sil.diagnosis.evidence import bench
from penode_sil.diagnosis.evidence.observer import Record, augmented, with_probes
from penode_sil.diagnosis.plant import plant

RIG = Path(__file__).resolve().parents[1] / "diagnosis" / "rigs" / "labcontrol_mr"  # its model: spring and damper, whose motion is an input


@pytest.fixture
def model():
    return penode_gen.load(RIG / "damper.toml")


@pytest.mark.parametrize("period", [0.8, 2.4])
def test_prescribed_motion_is_judged_sixteen_times_a_period(model, period: float) -> None:
    """Whatever the length of the recording; nothing is unmodelled where nothing moves, and the values are those of the damper."""
    t = np.arange(2000) * model.sample_time
    x, v = 0.012 * np.sin(2.0 * np.pi * t / period), 0.012 * 2.0 * np.pi / period * np.cos(2.0 * np.pi * t / period)
    force = 1200.0 * x + 500.0 * v + 3.0 * np.random.default_rng(1).standard_normal(len(t))
    made = bench.build(model, plant.places(model), [Record("r", 0.01, x[:, None], force[:, None])], np.array([3.0]), 0.0)
    assert made.update == round(period / 16 / 0.01)
    assert not made.model.extra_states
    assert abs(made.fit.value("c") / 1200.0 - 1.0) < 0.02 and abs(made.fit.value("d") / 500.0 - 1.0) < 0.02


def test_the_force_at_a_place_has_that_of_forms(model) -> None:
    (place,) = plant.places(model)
    form = Element("x90_0_0", place.ends, "coulomb_friction", {"force": "x_f", "transition": "x_t"})
    wide = plant.extend(augmented(model), [form], {"x_f": (10.0, "N"), "x_t": (0.01, "m/s")}, [place])
    own, whole = (next(s.expression for s in with_probes(wide, [place]).sensors if s.name == f"{q}_of_probe0") for q in ("F", "all"))
    assert own == "+ F_spring + F_damper" and whole == f"{own} + F_x90_0_0"
