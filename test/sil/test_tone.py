# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A tone in a residual is told from noise of any colour, and from what a model makes under a sine."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import signal

from penode_sil.diagnosis.noise import LASTING, PURE, Experiment, Tone, tone


def recording(u: np.ndarray, y: np.ndarray, step: float) -> Experiment:
    n = len(y)
    nothing = np.zeros((n // 2 + 1, 1))
    time = np.arange(n) * step
    return Experiment("", time, u[:, None], y, np.ones(y.shape, bool), u[:, None], u[:, None], nothing, nothing)


def road(draw: np.random.Generator, n: int) -> np.ndarray:
    return np.cumsum(draw.normal(size=n)) * 1e-4


@pytest.mark.parametrize("rate", [500, 1000, 2000])
@pytest.mark.parametrize("pole", [-0.5, 0.0, 0.9, 0.99])
def test_noise_has_no_tone(rate, pole):
    """40 draws of each colour: the purest is far from the limit. By exponential bins (mean 1, the highest of 0.4 rate of them
    with their median from 14) a tone of 40 in half of the 19 overlapping seconds has odds below (800 exp(-20))^9. And a steady
    one has 800 exp(-0.6 LASTING) here, a tenth; in all draws the largest is 4."""
    draw = np.random.default_rng(rate)
    for _ in range(40):
        y = signal.lfilter([1.0], [1.0, -pole], draw.normal(size=(10 * rate, 2)), axis=0)
        if pole == 0.0:
            y = np.round(y)  # as coarse as the noise
        e = recording(road(draw, len(y)), y, 1.0 / rate)
        found = tone([e], [np.zeros_like(y)])
        assert found.purity < 0.6 * PURE and found.steady < 0.6 * LASTING


@pytest.mark.parametrize("swing", [0.0, 0.1])
def test_a_tone_is_found_though_its_frequency_wanders(swing):
    draw, t = np.random.default_rng(3), np.arange(12_000) * 1e-3
    hum = np.sin(2 * np.pi * 31.0 * t - 31.0 * swing / 0.07 * np.cos(2 * np.pi * 0.07 * t))
    y = draw.normal(size=(len(t), 2)) + np.column_stack([0.0 * t, hum])  # its power is half the noise's
    found = tone([recording(road(draw, len(t)), y, 1e-3)], [np.zeros_like(y)])
    assert found.purity > PURE and found.sensor == 1
    assert found.frequency == pytest.approx(31.0, rel=0.02 + swing)  # half a bin, and how far it wanders


@pytest.mark.parametrize("step", [0.02, 0.2, 1.0, 10.0])
def test_a_slow_raster_has_none(step):
    y = np.random.default_rng(5).normal(size=(2000, 1))
    assert tone([recording(y[:, 0], y, step)], [np.zeros_like(y)]) == Tone()


@pytest.mark.parametrize("loud, seconds", [(0.35, 12), (0.15, 40)])
@pytest.mark.parametrize("sweep", [False, True])
def test_a_faint_tone_that_stays_is_found(sweep, loud, seconds):
    """Faint: a sixteenth of the noise's power at the most. Under a sweep the residual has three and five times its frequency too."""
    draw, t = np.random.default_rng(7), np.arange(seconds * 1000) * 1e-3
    phase = 2 * np.pi * (0.5 * t + 0.5 * 19.5 / seconds * t**2)
    y = draw.normal(size=(len(t), 2))
    y[:, 1] += loud * np.sin(2 * np.pi * 50.2 * t)
    y[:, 0] += sweep * (np.sin(3 * phase) + 0.3 * np.sin(5 * phase))
    found = tone([recording(np.sin(phase) if sweep else road(draw, len(t)), y, 1e-3)], [np.zeros_like(y)])
    assert found.steady > LASTING and found.sensor == 1 and found.frequency == 50.0
    assert found.purity < PURE


def test_a_resonance_is_none():
    """Noise through a mode of 13 Hz and 8 % of damping, the least that a wheel has, ten times louder there than around it."""
    draw, t = np.random.default_rng(8), np.arange(30_000) * 1e-3
    w, z = 2 * np.pi * 13.0, 0.08
    mode = signal.cont2discrete(([2 * z * w, 0.0], [1.0, 2 * z * w, w * w]), 1e-3, "bilinear")
    y = (draw.normal(size=len(t)) + 3.0 * signal.lfilter(mode[0].ravel(), mode[1], draw.normal(size=len(t))))[:, None]
    assert tone([recording(road(draw, len(t)), y, 1e-3)], [np.zeros_like(y)]).steady < 0.6 * LASTING


def test_under_a_sine_nothing_is_told():
    t = np.arange(12_000) * 1e-3
    u = np.sin(2 * np.pi * 3.0 * t)
    y = 0.1 * u[:, None] ** 3 + 0.01 * np.random.default_rng(4).normal(size=(len(t), 1))
    assert tone([recording(u, y, 1e-3)], [np.zeros_like(y)]) == Tone()
