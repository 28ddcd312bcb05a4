# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A spring and a damper in series that stand for another mass: which forms of a search are no more than that."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis.catalogue.form import Motion, Moved
from penode_sil.diagnosis.evidence.prior import Stated
from penode_sil.diagnosis.search.reconsider import stands_for_mass
from penode_sil.diagnosis.study.fit import Free

T = 0.01 * np.arange(1000)


def found(mass, tolerance, turn, kind):
    """A form of this kind between a body and ground, in a fit with this mass (1 in the file, with half its tolerance as a deviation), which
    only the law does too, but for the angle `turn`."""
    free = (Stated("m", mass, 0.1, sigma=0.5 * tolerance, origin=1.0), Free("law", 3.0, 0.5, sigma=1.0))
    slopes = np.array([[1.0, 0.0], [np.cos(turn), np.sin(turn)]]).T[:, None, :]
    fit = SimpleNamespace(free=free, slopes=slopes, variance=np.ones(1), used=np.ones((2, 1), bool), values={"m": mass, "law": 3.0})
    fit.value = lambda target: fit.values[target]
    parameters = {"m": SimpleNamespace(value=1.0)}
    model = SimpleNamespace(bodies=[SimpleNamespace(name="mass", mass="m")], elements=[], parameters=parameters)
    form = SimpleNamespace(kind=kind, index=0)
    bench = SimpleNamespace(model=model, fit=fit, places=[SimpleNamespace(ends=("mass", "ground"))])
    motion = Motion.of([Moved(np.sin(3.0 * T), 3.0 * np.cos(3.0 * T), T)], 1.0)
    return bench, SimpleNamespace(trial=SimpleNamespace(form=form)), [motion], 0.02


@pytest.mark.parametrize(
    "mass, turn, kind, stands",
    [
        (1.3, 0.05, "maxwell_bushing", True),  # 30 % off, of which 1.5 % is its own: below three times 2 %
        (1.3, 0.5, "maxwell_bushing", False),  # 14 % is its own: a cause
        (1.08, 0.05, "maxwell_bushing", False),  # within three tolerances
        (1.3, 0.05, "hidden_resonance", False),  # a mass of its own
        (1.3, 0.05, "input_delay", False),
    ],
)
def test_a_form_may_stand_for_another_mass(mass, turn, kind, stands):
    assert stands_for_mass(*found(mass, 0.03, turn, kind)) is stands
