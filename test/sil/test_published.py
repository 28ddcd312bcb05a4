# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The published case study through generator and C: the accuracy that is promised, measured and printed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from published_reference import QuarterVehicle

from penode_sil.signals import VelocityChirp
from penode_sil.targets import Sil

COLUMNS = {"euler": slice(2, 4), "exact": slice(4, 6)}


@pytest.fixture(scope="module")
def table(shared):
    return np.loadtxt(shared / "chirp_reference.csv", delimiter=",", skiprows=1)


def errors(model, table, column, dtype=np.float32):
    """Largest and RMS difference [m] of z_b, z_w over 60 s, at the rows of the table (each 10 ms)."""
    t = np.arange(60_001) * 1e-3
    run = Sil(model, dtype).run(VelocityChirp(0.15, 1.0, 0.25, math.pi / 2).value(t)[:, None])
    difference = run.y[::10].astype(float) - table[:, COLUMNS[column]]
    assert not run.status.any()
    return np.max(np.abs(difference)), np.max(np.sqrt(np.mean(difference**2, axis=0)))


def test_explicit_euler_in_float(published, table, show):
    largest, rms = errors(published("euler", "held"), table, "euler")
    show(f"explicit Euler 1 ms, held, float32 C against float64: max {largest:.2e} m, RMS {rms:.2e} m")
    # positions below 0.08 m: rounding of the state 2^-25 * 0.06 = 2e-9 m a step, 60 000 steps, forgotten with about
    # 2m/d = 0.9 s (900 steps): random walk 2e-9 * 30 = 6e-8 m
    assert largest < 1e-7


def test_explicit_euler_in_double_is_the_same_method(published, table, show):
    largest, _ = errors(published("euler", "held"), table, "euler", np.float64)
    show(f"explicit Euler 1 ms, held, float64 C against float64: max {largest:.2e} m")
    assert largest < 1e-12  # twelve digits are written of values below 0.1 m, and both round in the 16th


def test_runge_kutta_with_linear_input(published, table, show):
    largest, rms = errors(published("rk4", "linear"), table, "exact")
    show(f"RK4 1 ms, linear, float32 C against the continuous solution: max {largest:.2e} m, RMS {rms:.2e} m")
    # the wheel follows the road at up to 16 Hz: a straight line over 1 ms misses it by h^2/8 * 0.15 * 2 pi 16 = 1.9e-6 m
    # at the end; RK4's own error at the wheel's 9.2 Hz and the kinks of the networks add to it (in float64: 1.6e-5)
    assert largest < 2e-5
    assert rms < 3e-6


def test_four_substeps_leave_the_error_of_the_sampled_road(published, table, show):
    largest, rms = errors(published("rk4", "linear", 4), table, "exact")
    show(f"RK4 1 ms, linear, 4 substeps, float32 C against the continuous solution: max {largest:.2e} m, RMS {rms:.2e} m")
    assert largest < 4.5e-6  # the straight lines of the road set 3.9e-6 m, float adds less than 4e-8 m


@pytest.mark.parametrize("altered", [False, True])
def test_single_euler_steps_against_equations_by_hand(published, shared, altered):
    """One step from many states: independent of any trajectory, for both sets."""
    vehicle, draw = QuarterVehicle(shared, altered), np.random.default_rng(3)
    instance = Sil(published("euler", "held"), np.float64).instance("altered" if altered else "default")
    for _ in range(200):
        x, road = draw.normal(size=4) * [0.05, 0.05, 0.5, 1.0], draw.normal(size=2) * 0.05
        instance.step(road[:1])  # the input from which the next step starts
        instance.set_state(x)
        after, _, status = instance.step(road[1:])
        # 16 additions of products up to 1e4 N a layer, 2^-53 each, divided by 90 kg and times 1 ms: below 1e-15 * 1e3
        assert status == 0 and np.max(np.abs(after - (x + 1e-3 * vehicle.rates(x, road[0])))) < 1e-12
