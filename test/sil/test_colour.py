# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise of sensors that is not white, and signals between their samples: against noise drawn here, and closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from penode_sil.diagnosis.evidence.colour import Colour, is_white
from penode_sil.diagnosis.evidence.latency import amplified, earlier, without_lag

UPDATE, COUNT, FREQUENCIES, BEFORE = 4, 200_000, 2048, 8
POLE, SLOW = 0.95, 0.8  # of the noise of a sensor with unit power: this share of it is slow


def slow_spectrum() -> np.ndarray:
    """[f, 1], in closed form."""
    turn = np.exp(-1j * np.pi * np.linspace(0.0, 1.0, FREQUENCIES + 1))
    return ((1.0 - SLOW) + SLOW * (1.0 - POLE**2) / np.abs(1.0 - POLE * turn) ** 2)[:, None]


def slow_noise(seed: int = 1) -> np.ndarray:
    """[samples]: AR(1) beside white noise."""
    rng = np.random.default_rng(seed)
    slow, steps = np.zeros(COUNT), rng.normal(size=COUNT) * np.sqrt(SLOW * (1.0 - POLE**2))
    for k in range(1, COUNT):
        slow[k] = POLE * slow[k - 1] + steps[k]
    return slow + rng.normal(size=COUNT) * np.sqrt(1.0 - SLOW)


def means(x: np.ndarray) -> np.ndarray:
    return x.reshape(-1, UPDATE).mean(axis=1)[:, None]


def test_slow_noise_becomes_white() -> None:
    """50 000 updates: correlations within 4.5 of 1/sqrt(n), and the variance within 4.5 sqrt(2/n) of that stated. The means themselves
    are correlated by more than half."""
    shape = slow_spectrum()
    colour = Colour.of(shape, np.sqrt([np.min(shape)]), UPDATE, BEFORE)
    raw, white = means(slow_noise()), colour.white(means(slow_noise()))[:, 0]
    n = len(white)
    assert np.mean(raw[1:] * raw[:-1]) > 0.5 * np.var(raw)
    assert max(abs(np.mean(white[k:] * white[:-k])) / np.var(white) for k in range(1, 13)) < 4.5 / np.sqrt(n)
    assert np.var(white) == pytest.approx(colour.variance[0], rel=4.5 * np.sqrt(2.0 / n))


def test_white_noise_stays_as_it_is() -> None:
    shape, nu = np.ones((FREQUENCIES + 1, 2)), np.random.default_rng(2).normal(size=(3, 50, 2))
    colour = Colour.of(shape, np.array([0.1, 2.0]), UPDATE, BEFORE)
    assert colour.variance == pytest.approx(np.array([0.01, 4.0]) / UPDATE)
    np.testing.assert_allclose(colour.white(nu), nu, atol=1e-12)
    assert np.array_equal(Colour.none(np.array([0.1, 2.0]), UPDATE).white(nu), nu)
    assert is_white(shape) and not is_white(slow_spectrum())


def test_an_update_without_a_measurement_stays_one() -> None:
    """It predicts nothing, and the others keep their numbers."""
    nu = np.random.default_rng(3).normal(size=(40, 1))
    colour = Colour.of(slow_spectrum(), np.ones(1), UPDATE, BEFORE)
    holed = nu.copy()
    holed[7] = np.nan
    zero = nu.copy()
    zero[7] = 0.0
    assert np.flatnonzero(np.isnan(colour.white(holed)[:, 0])).tolist() == [7]
    assert np.array_equal(np.delete(colour.white(holed), 7, 0), np.delete(colour.white(zero), 7, 0))


def test_each_run_and_sensor_is_whitened_for_itself() -> None:
    """Against the sum over taps, update by update: eight products of at most 4 rounded to 1.1e-16 each, and their sum as often. Runs beside
    one change no bit of it: slopes along what has no effect are 0."""
    rng = np.random.default_rng(5)
    nu, colour = np.clip(rng.normal(size=(3, 40, 2)), -4.0, 4.0), Colour(rng.uniform(-1.0, 1.0, (BEFORE, 2)), np.ones(2))
    nu[1, 7, 0] = np.nan
    white, known = colour.white(nu), np.nan_to_num(nu)
    for k in range(40):
        before = sum(colour.taps[i - 1] * known[:, k - i] for i in range(1, min(k, BEFORE) + 1))
        assert np.nanmax(np.abs(white[:, k] - (nu[:, k] - before))) < 16 * 4 * 9 * 1.1e-16
    assert np.isnan(white[1, 7, 0]) and np.sum(np.isnan(white)) == 1
    assert all(np.array_equal(colour.white(own), both, equal_nan=True) for own, both in zip(nu, white, strict=True))


@pytest.mark.parametrize("late", (0.25, 0.5, 1.5))
def test_half_a_sample_of_delay_removes_no_noise(late: float) -> None:
    """Straight lines between samples would leave 7/8 of the power of means of four at half a sample, which likelihood takes for a delay."""
    white = np.random.default_rng(4).normal(size=COUNT)
    moved = earlier(white, np.array([late]))[0]
    power = np.var(moved[: (len(moved) // UPDATE - 1) * UPDATE].reshape(-1, UPDATE).mean(axis=1))
    assert power * UPDATE == pytest.approx(1.0, rel=4.5 * np.sqrt(2.0 * UPDATE / COUNT))


@pytest.mark.parametrize("start", (0.0, 0.3))
def test_a_tone_between_samples(start: float) -> None:
    """Its ends are reflected in: what bends there, of a tone with a value there at most 0.2 of it, rings by 0.2/k^2 at most, k samples
    away. The end was not seen."""
    t = np.arange(300.0)
    found = earlier(np.sin(0.4 * np.pi * t + start), np.array([0.0, 0.5, 3.3]))
    away = np.minimum(t, 299.0 - t)
    for row, late in zip(found, (0.0, 0.5, 3.3), strict=True):
        inside = slice(1, 295)
        error = np.abs(row - np.sin(0.4 * np.pi * (t + late) + start))[inside]
        assert np.all(error <= 0.2 / np.maximum(away[inside] - late, 1.0) ** 2 + 1e-9)
    assert np.isnan(found[2, -4:]).all() and np.isfinite(found[2, :-4]).all()


def test_a_start_in_motion_is_no_delay() -> None:
    """A ramp that bends slowly: reflection as a mirror has it would bend it by twice its slope at its ends."""
    t = np.arange(400.0)
    x = 0.2 * t + np.cos(0.01 * t)
    late = earlier(x, np.array([0.5]))[0]
    assert late[:-1] == pytest.approx((0.2 * (t + 0.5) + np.cos(0.01 * (t + 0.5)))[:-1], abs=1e-5)


def test_what_was_not_measured_stays_so() -> None:
    y = np.ones(50)
    y[20] = np.nan
    assert np.flatnonzero(np.isnan(earlier(y, np.array([0.5]))[0])).tolist() == [19, 20, 49]


@pytest.mark.parametrize("lag", (0.5, 4.0))
def test_a_signal_before_it_lagged(lag: float) -> None:
    """A tone behind a lag, which divides it by 1 + j w lag; its ends ring as in `test_a_tone_between_samples`, times the lag."""
    t, w = np.arange(300.0), 0.4
    behind = np.imag(np.exp(1j * w * t) / (1.0 + 1j * w * lag))
    same, before = (x[40:260] for x in without_lag(behind, np.array([0.0, lag])))
    assert same == pytest.approx(behind[40:260], abs=1e-9) and before == pytest.approx(np.sin(w * t)[40:260], abs=0.2 * lag / 40.0**2)
    behind[150] = np.nan
    assert np.flatnonzero(np.isnan(without_lag(behind, np.array([lag]))[0])).tolist() == [150]


def test_what_a_signal_without_its_lag_has_more() -> None:
    """A motion at all frequencies: the mean logarithm of |1 + j w lag| up to that of means of four, by quadrature."""
    steps = np.cumsum(np.random.default_rng(4).normal(size=4096)) + np.linspace(0.0, 1.0, 4096) ** 2
    turns = np.linspace(0.0, np.pi / 4.0, 100_001)
    expected = np.exp(np.mean(np.log(np.hypot(1.0, 3.0 * turns))))
    assert amplified(steps, np.array([0.0, 3.0]), 4) == pytest.approx([1.0, expected], rel=0.01)


def test_only_motion_is_shifted() -> None:
    """Motion up to 0.05 of the sampling rate in white noise of a tenth: half a sample changes both as it changes the motion alone, within
    0.2 of that; with all of the noise shifted too, it would be 0.96."""
    rng, n = np.random.default_rng(4), 20_000
    band = np.zeros(n // 2 + 1, complex)
    band[1 : n // 20] = rng.normal(size=(n // 20 - 1, 2)) @ np.array([1.0, 1.0j])
    motion = np.fft.irfft(band, n)
    motion, noise = motion / np.std(motion), 0.1 * rng.normal(size=n)
    change = earlier(motion + noise, np.array([0.5]))[0] - motion - noise
    alone = earlier(motion, np.array([0.5]))[0] - motion
    inside = slice(50, -50)
    assert np.std((change - alone)[inside]) < 0.2 * np.std(alone[inside])
