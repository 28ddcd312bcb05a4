# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A tone in a residual is distinguished from noise of any colour, and from the response of a model to a sine."""

from __future__ import annotations

import numpy as np
import pytest
from samples import sample
from scipy import signal

from penode_sil.diagnosis.checks.tones import DETECTED, Tone, tone
from penode_sil.diagnosis.study.noise import Experiment, Metric


def recording(u: np.ndarray, y: np.ndarray, step: float) -> Experiment:
    n = len(y)
    nothing = np.zeros((n // 2 + 1, 1))
    time = np.arange(n) * step
    return Experiment("", time, u[:, None], y, np.ones(y.shape, bool), u[:, None], u[:, None], nothing, nothing)


def tone_in(u: np.ndarray, y: np.ndarray, step: float, power: np.ndarray | float = 1.0, model: np.ndarray | float = 0.0) -> Tone:
    """The tone of residuals y [n, n_z] beside motion of the model, where noise of the power [f] is expected."""
    sensors = y.shape[1]
    root = np.eye(sensors) / np.sqrt(np.broadcast_to(power, len(y) // 2 + 1))[:, None, None]
    z = np.zeros_like(y) + model
    return tone([recording(u, y + z, step)], [Metric(len(y), root.astype(complex))], [z])


def road(draw: np.random.Generator, n: int) -> np.ndarray:
    return np.cumsum(draw.normal(size=n)) * 1e-4


@pytest.mark.parametrize("rate", sample([500, 1000, 2000], 1000))
@pytest.mark.parametrize("pole", [-0.5, 0.0, 0.9, 0.99])
def test_noise_has_no_tone(rate, pole):
    """In 40 draws of each colour none is more likely a tone: the largest surprise is -4, and 0 if there is none above. By Markov's
    bound one in exp(DETECTED) is detected at the most."""
    draw = np.random.default_rng(rate)
    for _ in range(40):
        y = signal.lfilter([1.0], [1.0, -pole], draw.normal(size=(10 * rate, 2)), axis=0)
        if pole == 0.0:
            y = np.round(y)  # as coarse as the noise
        assert tone_in(road(draw, len(y)), y, 1.0 / rate) == Tone()


@pytest.mark.parametrize("swing, loud, seconds", [(0.0, 1.0, 12), (0.1, 1.0, 12), (0.1, 0.25, 30)])
def test_a_tone_of_varying_frequency_is_found(swing, loud, seconds):
    """Its power is half the noise's, or a thirtieth."""
    draw, t = np.random.default_rng(3), np.arange(seconds * 1000) * 1e-3
    hum = loud * np.sin(2 * np.pi * 31.0 * t - 31.0 * swing / 0.07 * np.cos(2 * np.pi * 0.07 * t))
    y = draw.normal(size=(len(t), 2)) + np.column_stack([0.0 * t, hum])
    found = tone_in(road(draw, len(t)), y, 1e-3)
    assert found.detected and found.sensor == 1
    assert found.frequency == pytest.approx(31.0, rel=0.02 + swing)  # half a bin, and how far it wanders


@pytest.mark.parametrize("step", [0.02, 0.2, 1.0, 10.0])
def test_a_slow_raster_has_none(step):
    y = np.random.default_rng(5).normal(size=(2000, 1))
    assert tone_in(y[:, 0], y, step) == Tone()


@pytest.mark.parametrize("loud, seconds", [(0.35, 12), (0.15, 40)])
@pytest.mark.parametrize("sweep", [False, True])
def test_a_faint_tone_that_stays_is_found(sweep, loud, seconds):
    """Faint: a sixteenth of the noise's power at the most. Under a sweep the residual has three and five times its frequency too."""
    draw, t = np.random.default_rng(7), np.arange(seconds * 1000) * 1e-3
    phase = 2 * np.pi * (0.5 * t + 0.5 * 19.5 / seconds * t**2)
    y = draw.normal(size=(len(t), 2))
    y[:, 1] += loud * np.sin(2 * np.pi * 50.2 * t)
    y[:, 0] += sweep * (np.sin(3 * phase) + 0.3 * np.sin(5 * phase))
    found = tone_in(np.sin(phase) if sweep else road(draw, len(t)), y, 1e-3)
    assert found.detected and found.sensor == 1 and found.frequency == 50.0


@pytest.mark.parametrize("loud, alone", [(0.12, False), (0.2, True)])
def test_a_tone_that_three_sensors_have_is_found_sooner(loud, alone):
    """A part in 140 of the noise's power in each is too little for one sensor in 20 s, one in 50 is enough."""
    draw, t = np.random.default_rng(13), np.arange(20_000) * 1e-3
    y = draw.normal(size=(len(t), 3)) + loud * np.sin(2 * np.pi * 27.0 * t)[:, None]
    assert tone_in(road(draw, len(t)), y[:, :1], 1e-3).detected == alone
    found = tone_in(road(draw, len(t)), y, 1e-3)
    assert found.detected and found.frequency == 27.0


def test_noise_that_sensors_share_is_no_tone():
    """Noise of an input, through a mode, is most of what each sees: the metric knows, and parts it from their own."""
    draw, t = np.random.default_rng(12), np.arange(30_000) * 1e-3
    w, z, loud = 2 * np.pi * 13.0, 0.08, 3.0
    b, a = signal.cont2discrete(([2 * z * w * loud, 0.0], [1.0, 2 * z * w, w * w]), 1e-3, "bilinear")[:2]
    shared = signal.lfilter(b.ravel(), a, draw.normal(size=len(t)))
    y = draw.normal(size=(len(t), 2)) + shared[:, None]
    power = np.abs(signal.freqz(b.ravel(), a, np.linspace(0.0, np.pi, len(t) // 2 + 1))[1]) ** 2
    root = np.linalg.inv(np.linalg.cholesky(power[:, None, None] + np.eye(2))).astype(complex)
    found = tone([recording(road(draw, len(t)), y, 1e-3)], [Metric(len(t), root)], [np.zeros_like(y)])
    assert found.surprise < 0.6 * DETECTED


@pytest.mark.parametrize("damping, loud", [(0.08, 3.0), (0.04, 10.0)])
@pytest.mark.parametrize("known", ["noise", "motion"])
def test_a_resonance_is_none(known, damping, loud):
    """Noise through a mode of 13 Hz with the least damping that a wheel has, or half of it: ten or a hundred times the sensor's power.
    Either its spectrum is known to be noise, or the model has the mode as well, as where its damping is slightly wrong."""
    draw, t = np.random.default_rng(8), np.arange(30_000) * 1e-3
    w, z = 2 * np.pi * 13.0, damping
    mode = signal.cont2discrete(([2 * z * w, 0.0], [1.0, 2 * z * w, w * w]), 1e-3, "bilinear")

    def shaken():
        return signal.lfilter(loud * mode[0].ravel(), mode[1], draw.normal(size=len(t)))[:, None]

    y = draw.normal(size=(len(t), 1)) + shaken()
    response = signal.freqz(loud * mode[0].ravel(), mode[1], np.linspace(0.0, np.pi, len(t) // 2 + 1))[1]
    more = {"power": 1.0 + np.abs(response) ** 2} if known == "noise" else {"model": shaken()}
    assert tone_in(road(draw, len(t)), y, 1e-3).detected, "what neither knows is a limit of it"
    assert tone_in(road(draw, len(t)), y, 1e-3, **more).surprise < 0.6 * DETECTED


def test_a_blow_is_none():
    """One second that rings, a thousand times louder than the rest."""
    draw, t = np.random.default_rng(9), np.arange(12_000) * 1e-3
    ring = np.where(t > 5.0, np.exp(-3.0 * (t - 5.0)) * np.sin(2 * np.pi * 31.0 * t), 0.0)
    y = draw.normal(size=(len(t), 1)) + 1e3 * ring[:, None]
    assert not tone_in(road(draw, len(t)), y, 1e-3).detected


def test_under_a_sine_nothing_is_told():
    t = np.arange(12_000) * 1e-3
    u = np.sin(2 * np.pi * 3.0 * t)
    y = 0.1 * u[:, None] ** 3 + 0.01 * np.random.default_rng(4).normal(size=(len(t), 1))
    assert tone_in(u, y, 1e-3) == Tone()
