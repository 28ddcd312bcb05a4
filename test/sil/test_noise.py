# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise of known level and colour, under signals more than 40 dB above it, is found again.

Signals are responses of a body on a spring (2 Hz) and a wheel (12 Hz) by scipy.signal.lsim; noise is drawn here.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from penode_sil.recordings.noise import estimate

H = 1e-3
N = 30_000
T = np.arange(N) * H
ALL = np.ones(N, dtype=bool)
SEED = 7


def mode(u: np.ndarray, hertz: float) -> np.ndarray:
    """Position of a mass, damped to 0.3, whose foot moves by u."""
    w = 2.0 * np.pi * hertz
    return signal.lsim(([0.6 * w, w * w], [1.0, 0.6 * w, w * w]), u, T)[1]


def chirp() -> np.ndarray:
    return 0.01 * signal.chirp(T, 0.5, 30.0, 15.0)


def road() -> np.ndarray:
    """A random walk without its lowest frequencies: a road of class C at 20 m/s."""
    steps = np.random.default_rng(SEED).normal(size=N) * np.sqrt(2.0 * np.pi**2 * 256e-6 * 0.01 * 20.0 * 2.0 * H)
    return signal.lfilter(*signal.butter(1, 1e-3, "high"), np.cumsum(steps))


def bumps() -> np.ndarray:
    return sum(np.where(np.abs(T - at) < 0.15, 0.03 * (1.0 + np.cos(np.pi * (T - at) / 0.15)), 0.0) for at in (6.0, 15.0))


def sensors(u: np.ndarray) -> np.ndarray:
    """Acceleration of the body and deflection [n, 2]."""
    wheel = mode(u, 12.0)
    body = mode(wheel, 2.0)
    return np.column_stack((np.gradient(np.gradient(body, H), H), body - wheel))


def noise(draw: np.random.Generator, size: float, pole: float) -> np.ndarray:
    return signal.lfilter([1.0], [1.0, -pole], draw.normal(size=N + 500) * size * np.sqrt(1.0 - pole**2))[500:]


EXCITATIONS = [chirp, road, bumps]


@pytest.mark.parametrize("pole", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("quanta", [0.0, 1.0])
@pytest.mark.parametrize("excitation", EXCITATIONS)
def test_level_and_colour_under_a_signal(excitation, quanta, pole):
    draw = np.random.default_rng(SEED)
    u = excitation()
    z = sensors(u)
    sizes = np.array([0.02, 1e-4])
    x = z + np.column_stack([noise(draw, size, pole) for size in sizes])
    truth = sizes * np.sqrt(1.0 + quanta**2 / 12.0)  # the error of rounding is uniform
    if quanta:
        x = np.round(x / sizes / quanta) * sizes * quanta
    seen = u + 1e-6 * draw.normal(size=N)
    for k, size in enumerate(sizes):
        known = [seen[:, None], np.column_stack((seen, x[:, 1 - k]))]
        law = estimate(x[:, k], ALL, H, known, quantum=quanta * size)
        # White: about 57 stretches of 1024 in 320 bins, two of which are one, and a median's variance is 2.08 times a
        # mean's: density +- sqrt(2.08 * 2 / (57 * 320)) = 1.5 %, level +- 0.8 %; under a road only what is above
        # 100 Hz is left: 1 %. Five of them and 2 % that a signal may be below unseen.
        # Pole 0.5: d std/std = p dp/(1-p^2) = 0.67 dp with dp < 0.05. Pole 0.9: mostly what lies below 16 Hz, under the
        # signal, tells it from 0.95, and that has sqrt((1 - 0.81) / (1 - 0.9025)) = 1.4 times the level.
        # A spectrum that is seen from 45 Hz on only says little of a colour's level, but it is right where it is seen.
        if pole == 0.0 or law.above < 45.0:
            assert law.std == pytest.approx(truth[k], rel={0.0: 0.07, 0.5: 0.08, 0.9: 0.45}[pole])
            assert law.pole == pytest.approx(pole, abs={0.0: 0.08, 0.5: 0.06, 0.9: 0.06}[pole])
        assert law.above < 50.0 or excitation is road
        frequency = np.array([210.0, 300.0])  # where only noise is, the density is the law's within 12 %
        shape = (1.0 - pole**2) / np.abs(1.0 - pole * np.exp(-2j * np.pi * frequency * H)) ** 2
        density = 2.0 * H * size**2 * (shape + quanta**2 / 12.0)
        assert law.density(frequency, H) == pytest.approx(density, rel=0.12)


def test_noise_of_all_channels_from_a_standstill():
    draw = np.random.default_rng(SEED)
    z, rest = sensors(bumps())[:, 0], (T < 5.0) | (T > 20.0)
    for pole in (0.0, 0.9, 0.97):
        law = estimate(z + noise(draw, 0.02, pole), ALL, H, rest=rest)
        assert law.above == 0.0
        # 15 s: dp = sqrt((1 - p^2) / 15000) = 0.002 for 0.97; std goes by 16 dp, four of them and what the window's
        # main lobe hides below 4 bins: 0.35; at 0.9 dp = 0.0036 and std goes by 4.7 dp: a fifth of that
        assert law.std == pytest.approx(0.02, rel={0.0: 0.04, 0.9: 0.1, 0.97: 0.35}[pole])
        assert law.pole == pytest.approx(pole, abs=0.03)


def test_friction_that_two_sensors_feel_is_no_noise():
    draw = np.random.default_rng(SEED)
    u = road()
    z = sensors(u)[:, 0]
    rate = np.gradient(sensors(u)[:, 1], H)
    friction = 60.0 * np.tanh(rate / 0.01)  # N, on a body of 350 kg and a wheel of 90 kg
    body = z - friction / 350.0 + noise(draw, 0.02, 0.0)
    wheel = 5.0 * z + friction / 90.0 + noise(draw, 0.1, 0.0)
    alone = estimate(body, ALL, H, [u[:, None]])
    law = estimate(body, ALL, H, [u[:, None], np.column_stack((u, wheel))])
    # the wheel's noise stands for its share of the friction: at most 0.1 * 90/350 = 0.026 beside 0.02, together 0.033
    assert 0.019 < law.std < 0.034 < alone.std


def test_masked_samples_do_not_count():
    draw = np.random.default_rng(SEED)
    x = 1e-3 * draw.normal(size=N)
    usable = draw.random(N) > 1e-3
    assert estimate(np.where(usable, x, 5.0), usable, H).std == pytest.approx(1e-3, rel=0.05)


def test_too_little_to_tell():
    assert estimate(np.zeros(200), np.ones(200, dtype=bool), H) is None
    assert estimate(np.zeros(N), ~ALL, H) is None


def test_a_channel_without_noise_has_none():
    law = estimate(np.zeros(N), ALL, H)
    assert law is None or law.std == 0.0
