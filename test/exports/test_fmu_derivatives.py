# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Directional derivatives of FMUs: of the double build against differences, of the float build against the double one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from case_study import chirp
from master import Master, Unpacked, export

STEP = 1e-3


@pytest.fixture(scope="module")
def double(nqvm: Any, tmp_path_factory: pytest.TempPathFactory) -> Unpacked:
    folder = tmp_path_factory.mktemp("double")
    return Unpacked(export(nqvm, 3, folder, real="double"), folder / "unpacked")


NAMES = ("z_b", "z_w", "a_body", "a_wheel", "deflection", "state.v_b", "state.v_w")


STATES = ("state.z_b", "state.z_w", "state.v_b", "state.v_w")


def by_road(master: Master, u: float, size: int) -> np.ndarray:
    """Derivatives of NAMES by the road over a step of `size` samples, which is done."""
    master.set("z_road", u)
    master.step(size * STEP)
    return np.array([master.derivative(name, "z_road") for name in NAMES])


def differences(master: Master, u: float, size: int, h: float) -> tuple[np.ndarray, np.ndarray]:
    """The same by central differences, and by how much those to either side differ; the instance stays where it is."""
    state, ends = master.save(), []
    for road in (u + h, u, u - h):
        master.set("z_road", road)
        master.fmu.doStep(master.now, size * STEP)
        ends.append(master.get(*NAMES))
        master.restore(state)
    return (ends[0] - ends[2]) / (2 * h), np.abs(ends[0] - 2 * ends[1] + ends[2]) / h


@pytest.mark.parametrize("size", (1, 5))
def test_directional_derivatives(double: Unpacked, size: int) -> None:
    """
    The double build against central differences of 1e-6 m, over steps of one sample and of five.

    Between kinks of the ReLU networks the step is a polynomial of the road, nearly linear: rounding of 1e-16/1e-6 is all that
    differences add. One kink, to either side, puts central differences off by half of what one-sided ones then differ by.
    """
    master = Master(double).initialise(z_road=0.0)
    own, central, bent = [], [], []
    for u in chirp(0.5)[:-1:size, 0].astype(float):
        found = differences(master, u, size, 1e-6)
        central.append(found[0])
        bent.append(found[1])
        own.append(by_road(master, u, size))
    largest = np.abs(own).max(axis=0)
    error, half = np.abs(np.array(own) - central) / largest, np.array(bent) / 2 / largest
    assert (half > 1e-6).any(axis=1).mean() < 0.1, "there are few kinks"
    assert (error <= 1e-6 + half).all()


def test_directional_derivatives_in_float(unpacked: Unpacked, double: Unpacked) -> None:
    """
    The float build against the double one from the same state. A row is a sum of a few hundred products: their rounding, 6e-8
    each, is below 1e-4 of the row's largest unless they cancel. Kinks are where they were, but for rounding of their place.
    """
    master, u = Master(unpacked).initialise(z_road=0.0), chirp(0.5)[:-1, 0].astype(float)
    small, large = [], []
    for x in u:
        state = dict(zip(STATES, master.get(*STATES), strict=True))
        small.append(by_road(master, x, 1))
        twin = Master(double, start_time=0.0).initialise(z_road=x, **state)
        large.append(by_road(twin, x, 1))
        twin.fmu.terminate()
        twin.fmu.freeInstance()
    assert (np.abs(np.array(small) - large) <= 1e-4 * np.abs(large).max(axis=0)).all()
