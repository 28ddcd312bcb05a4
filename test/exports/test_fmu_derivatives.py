# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Directional derivatives of FMUs: of the double build against differences, of the float build against the double one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from case_study import NQVM, chirp
from master import Master, Unpacked, export

import penode_gen

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


VARIANTS = {
    "plain": "",
    "folded and tried": "pieces = 96\ntrial = 20\n",
    "delayed": '[actuators]\nlate = { input = "z_road", law = "delay", samples = 7 }\n'
    '[elements]\ntyre = { between = ["wheel", "late"], law = "linear_spring", stiffness = "c_t" }\n',
}


@pytest.mark.parametrize("variant", VARIANTS)
def test_what_is_asked_for_late_is_the_same_and_changes_nothing(variant: str, tmp_path: Path) -> None:
    """Derivatives and sensors after every step, after every fifth, and after a change of inputs and sets that the next step is to see."""
    path = tmp_path / "variant.toml"
    path.write_text(f'[model]\nextends = "{NQVM}"\nname = "variant"\n{VARIANTS[variant]}')
    unpacked = Unpacked(export(penode_gen.load(path), 3, tmp_path), tmp_path / "unpacked")
    asked = ("jacobian.state_state", "jacobian.state_input", "a_body", "a_wheel", "status")
    often, seldom, never = (Master(unpacked).initialise() for _ in range(3))
    for k, u in enumerate(chirp(0.2)[:-1, 0].astype(float)):
        for master in (often, seldom, never):
            master.set("z_road", np.nan if k == 72 else u)
            if k == 50:
                master.set("parameter_set", 2)
            master.step(2 * STEP if k % 3 == 0 else STEP)
        found = often.get(*asked)
        if k % 5 == 2:
            for master in (often, seldom):
                master.set("z_road", u + 0.01)
                master.set("parameter_set", 1 + (k // 5) % 2)
            never.set("parameter_set", 1 + (k // 5) % 2)
            assert np.array_equal(seldom.get(*asked), found)
        state = often.get("z_b", "z_w", *STATES, "set_checksum")
        assert np.array_equal(seldom.get("z_b", "z_w", *STATES, "set_checksum"), state)
        assert np.array_equal(never.get("z_b", "z_w", *STATES, "set_checksum"), state)
    kept = seldom.save()
    seldom.step(STEP)
    seldom.restore(kept)
    assert np.array_equal(seldom.get(*asked), often.get(*asked))
