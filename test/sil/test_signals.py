# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Input signals against independent mathematics: quadrature, difference quotients, the spectrum that is promised."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from published_reference import road_of_chirp
from scipy.integrate import quad
from scipy.signal import welch

from penode_sil.signals import ROAD_CLASSES, Bump, Chirp, Constant, Ramp, Road, Samples, Sum, VelocityChirp

SIGNALS = [
    Constant(0.3),
    Chirp(0.01, 0.5, 0.4, 0.2),
    VelocityChirp(0.15, 1.0, 0.25, math.pi / 2),
    VelocityChirp(0.15, 16.0, -0.25, 0.3),
    VelocityChirp(0.15, 2.0, 0.0, 0.3),
    VelocityChirp(0.15, 0.0, 0.0, 0.3),
    Ramp(0.05, 1.0, 0.7),
    Bump(0.1, 1.0, 0.4),
    Road(64e-6, 20.0, 3, 0.5),
    Samples(np.array([0.0, 1.0, 1.5, 4.0]), np.array([0.0, 0.1, -0.1, 0.2])),
    Sum((Bump(0.1, 1.0, 0.4), Chirp(0.01, 0.5, 0.4, 0.2))),
]


@pytest.mark.parametrize("signal", SIGNALS, ids=lambda s: type(s).__name__)
def test_slope_is_the_derivative_of_value(signal):
    t = np.linspace(0.013, 3.9, 401)
    t = t[[all(abs(time - knot) > 1e-3 for knot in signal.knots()) for time in t]]
    step = 1e-5
    quotient = (signal.value(t + step) - signal.value(t - step)) / (2 * step)
    # Central difference: rounding 1e-16 * 0.3 / 1e-5 = 3e-12, truncation step^2/6 * third derivative; the road's waves
    # reach omega = 2 pi 2.83 * 20 = 356 rad/s at some 1e-5 m: 1e-10/6 * 4.5e7 * 1e-5 * sum over waves < 1e-6.
    assert np.max(np.abs(signal.slope(t) - quotient)) < 1e-6


@pytest.mark.parametrize("signal", SIGNALS[2:6], ids=lambda s: f"{s.frequency} Hz {s.rate} Hz/s")
def test_velocity_chirp_is_the_integral_of_its_velocity(signal):
    for end in (0.3, 2.0, 7.7):
        exact, bound = quad(lambda t: float(signal.slope(np.float64(t))), 0.0, end, epsabs=1e-13, epsrel=1e-13, limit=500)
        assert abs(float(signal.value(np.float64(end))) - exact) < bound + 1e-13


def test_published_chirp_agrees_with_quadrature_over_60_s():
    t = np.arange(60_001) * 1e-3
    difference = VelocityChirp(0.15, 1.0, 0.25, math.pi / 2).value(t) - road_of_chirp(t)
    # 60 000 sums of pieces below 1.5e-4 m: rounding at most 60 000 * 2^-53 * 0.03 m (largest partial sum) = 2e-13 m
    assert np.max(np.abs(difference)) < 3e-13


def test_published_chirp_agrees_with_the_published_road(shared):
    table = np.loadtxt(shared / "chirp_reference.csv", delimiter=",", skiprows=1)
    # twelve digits are written of heights below 0.03 m: half a unit of the last is 5e-14 m
    assert np.max(np.abs(VelocityChirp(0.15, 1.0, 0.25, math.pi / 2).value(table[:, 0]) - table[:, 1])) < 1e-13


def test_road_has_the_spectrum_of_its_class():
    speed, rate = 20.0, 200.0
    t = np.arange(0.0, 500.0, 1.0 / rate)
    height = Road(ROAD_CLASSES["B"], speed, 7, 0.0).value(t)
    frequency, density = welch(height, rate, nperseg=16_384)
    n, gd = frequency / speed, density * speed  # spatial frequency [1/m], one-sided density [m^3]
    for low, high in ((0.02, 0.04), (0.05, 0.2), (0.2, 0.8), (0.8, 2.4)):
        band = (n >= low) & (n < high)
        expected = 64e-6 * 0.1**2 * (1 / low - 1 / high)  # integral of Gd(n0) (n/n0)^-2
        measured = np.sum(gd[band]) * (n[1] - n[0])
        # The variance of each wave is set, not drawn; what is left is where waves lie within pieces of 1.1 % at the
        # band's two edges and Welch's leakage over one bin (0.0006 1/m of at least 0.02): a few per cent.
        assert measured == pytest.approx(expected, rel=0.08)


def test_each_class_is_twice_as_high_as_the_one_before():
    t = np.linspace(0.0, 5.0, 100)
    heights = [Road(ROAD_CLASSES[name], 10.0, 1, 0.5).value(t) for name in "ABCD"]  # Gd(n0) grows fourfold
    for lower, higher in itertools.pairwise(heights):
        assert np.allclose(higher, 2.0 * lower, rtol=1e-14, atol=0.0)


def test_road_is_repeatable_and_seeds_differ():
    t = np.linspace(0.0, 5.0, 100)
    first = Road(16e-6, 10.0, 1, 0.5).value(t)
    assert np.array_equal(first, Road(16e-6, 10.0, 1, 0.5).value(t))
    assert not np.allclose(first, Road(16e-6, 10.0, 2, 0.5).value(t))


def test_road_starts_at_rest():
    road = Road(256e-6, 30.0, 5, 0.5)
    assert float(road.value(np.float64(0.0))) == 0.0
    assert float(road.slope(np.float64(0.0))) == 0.0


def test_bump_and_ramp_end_where_they_should():
    bump, ramp = Bump(0.08, 1.0, 0.4), Ramp(0.05, 1.0, 0.7)
    assert bump.value(np.array([0.0, 1.0, 1.2, 1.4, 9.0])) == pytest.approx([0.0, 0.0, 0.08, 0.0, 0.0], abs=1e-17)  # cos(2 pi) is 1 exactly
    assert ramp.value(np.array([0.0, 1.0, 1.35, 1.7, 9.0])) == pytest.approx([0.0, 0.0, 0.025, 0.05, 0.05], abs=1e-16)  # some 2^-53
