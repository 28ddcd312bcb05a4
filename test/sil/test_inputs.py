# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a noisy input most likely was: noise is damped where that is all there is, a bump is kept, and `unsure` tells what is left."""

from __future__ import annotations

import numpy as np
import pytest

from penode_sil.diagnosis.study import noise

STEP, SAMPLES, SIGMA = 0.001, 20_000, 3e-5
TIME = STEP * np.arange(SAMPLES)
NEAR = np.abs(TIME - 10.0) < 0.05  # a bump


def prepared(true: np.ndarray, rng: np.random.Generator) -> noise.Experiment:
    measured = true + SIGMA * rng.standard_normal(SAMPLES)
    still = np.zeros((SAMPLES, 1))
    return noise.prepare("", TIME, measured[:, None], still, np.ones((SAMPLES, 1), bool), np.array([SIGMA]), [None])


def road(rng: np.random.Generator) -> np.ndarray:
    """Height [m] with a falling spectrum that goes under in the noise at some 60 Hz."""
    f = np.fft.rfftfreq(SAMPLES, STEP)
    return np.fft.irfft(np.where(f > 0.3, 1e-2 / np.maximum(f, 0.3) ** 2, 0.0) * np.exp(2j * np.pi * rng.random(f.size)), SAMPLES) * 100.0


def test_a_bump_is_kept_in_mostly_noise():
    """
    30 ms of 10 mm in 20 s that are flat: its error is its noise, and no longer that most of the time there is none.

    Over 10 recordings of 100 values the power of white noise is known to sqrt(2 / 1000) = 4.5 %; a bump of 30 ms has nothing above
    some 200 Hz, where noise is damped, so that the error is less than its noise.
    """
    rng = np.random.default_rng(3)
    bump = 0.01 * np.cos(np.pi * np.clip((TIME - 10.0) / 0.03, -0.5, 0.5)) ** 2
    errors = [(prepared(bump, rng).drive[:, 0] - bump)[NEAR] for _ in range(10)]
    assert np.mean(np.square(errors)) < SIGMA**2


def test_unsure_is_what_the_input_is_off_by():
    """
    With bumps in it or not, the error's power is that of `unsure`, within a fifth: it is damped by what the noisy spectrum seems to be,
    over bands of 1 Hz with 20 values each, that is to 1 / sqrt(20) = 22 % of it in a band and less in all.
    """
    rng = np.random.default_rng(4)
    bumps = sum(0.005 * np.cos(np.pi * np.clip((TIME - at) / 0.04, -0.5, 0.5)) ** 2 for at in (3.0, 9.0, 16.0))
    for true in (road(rng), road(rng) + bumps):
        e = prepared(true, rng)
        error = np.fft.rfft(e.drive[:, 0] - true)[: e.band]
        assert np.mean(np.abs(error) ** 2) / SAMPLES == pytest.approx(np.mean(e.unsure[: e.band, 0] ** 2), rel=0.2)


def test_an_even_road_has_no_bumps(monkeypatch):
    """
    What is kept beside what is damped by the mean spectrum is less than a hundredth of the noise.

    Where noise is damped, seven bins or more are added up, five of them independent: by chance they come to four times their mean in
    2e-5 of all cases (the tail of a gamma distribution of order 5 beyond 20), and keep up to six times the noise; the ends of a
    recording, where its rate has a kink, are 4 of 160 parts.
    """
    rng = np.random.default_rng(5)
    true = road(rng)
    drives = []
    for loud in (noise.LOUD, np.inf):
        monkeypatch.setattr(noise, "LOUD", loud)
        drives.append(prepared(true, np.random.default_rng(6)).drive)
    assert np.mean((drives[0] - drives[1]) ** 2) < 0.01 * SIGMA**2
