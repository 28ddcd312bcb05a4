# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Bursts that one sensor alone shows are found wherever they are, and a sensor that is noisier in motion has none."""

from __future__ import annotations

from types import SimpleNamespace as Simple

import numpy as np
import pytest

from penode_sil.diagnosis.checks import dropouts
from penode_sil.diagnosis.checks.broken import WILD, still_wild
from penode_sil.diagnosis.checks.dropouts import bursts, repeats
from penode_sil.diagnosis.study.noise import Experiment

STEP, N = 2e-3, 10_000
T = np.arange(N) * STEP
MOVE = np.sin(2.0 * np.pi * T) + 0.3 * np.sin(2.0 * np.pi * 7.0 * T)


def recording(y: np.ndarray) -> Experiment:
    u, none = np.zeros((N, 1)), np.zeros((N // 2 + 1, 1))
    return Experiment("", T, u, y, np.ones(y.shape, bool), u, u, none, none)


def noisy(seed: int) -> np.ndarray:
    return np.stack([MOVE, MOVE], axis=1) + 0.01 * np.random.default_rng(seed).normal(size=(N, 2))


@pytest.mark.parametrize("first", [3000, N - 30])
def test_a_burst_is_found(first):
    """Six samples of ten times the signal, at least eight from the end; padded by four on either side."""
    y = noisy(1)
    y[first : first + 6, 0] += 10.0 * np.random.default_rng(2).uniform(-1.0, 1.0, 6)
    (found,) = bursts([recording(y)], [np.stack([MOVE, MOVE], axis=1)])
    assert found[first : first + 6, 0].all() and not found[:, 1].any()
    assert not found[: first - 6, 0].any() and not found[first + 12 :, 0].any()


def test_bursts_are_found_though_there_are_many():
    """In a fiftieth of the time."""
    y = noisy(3)
    at = (np.arange(1000, 9000, 400)[:, None] + np.arange(10)).ravel()
    y[at, 0] = np.random.default_rng(5).uniform(-3.0, 3.0, at.size)
    (found,) = bursts([recording(y)], [np.stack([MOVE, MOVE], axis=1)])
    assert np.mean(found[at, 0]) > 0.95 and np.count_nonzero(found[:, 0]) < 3 * at.size and not found[:, 1].any()


def test_a_signal_that_fades_is_found_though_the_motion_turns():
    """Fades from the last value on, to a tenth in 23 samples, while the motion goes through zero."""
    y = noisy(4)
    zero = 3250  # where the motion turns, fast
    first = zero - 31
    y[first : first + 50, 0] = y[first - 1, 0] * np.exp(-np.arange(50) / 10.0)
    (found,) = bursts([recording(y)], [np.stack([MOVE, MOVE], axis=1)])
    far = np.abs(y[:, 0] - MOVE) > 0.06
    assert found[far, 0].all() and not found[:, 1].any() and np.count_nonzero(found) < 60


@pytest.mark.parametrize("falls, quantum, found", [(20, 0.0, True), (7, 0.0, False), (20, 0.02, False)])
def test_what_a_filter_forgets_is_found_however_near(falls, quantum, found):
    """A filter of 30 samples without input, in the noise of the motion and for half of its time constant; a coarse sensor steps."""
    y = np.round(noisy(6) / max(quantum, 1e-12)) * max(quantum, 1e-12)
    begin = MOVE[3000]
    y[3001 : 3001 + falls, 0] = begin * np.exp(-np.arange(falls) / 30.0)
    if quantum:
        y[3001 : 3001 + falls, 0] = np.round(y[3001 : 3001 + falls, 0] / quantum) * quantum
    y[5000:5400:2, 1], y[5001:5400:2, 1] = 0.01, -0.01  # about nothing, from step to step
    told = dropouts._decayed(y)
    assert told[3002 : 3000 + falls, 0].all() == found and told.any() == found


@pytest.mark.parametrize("discharges", [True, False])
def test_what_discharges_is_found_however_often(discharges):
    """In 3 % of all samples, of both signs against the motion; what only sinks would as often be another motion."""
    y = noisy(5)
    for first in range(600, 9600, 1100):
        y[first : first + 40, 0] = (
            y[first - 1, 0] * np.exp(-np.arange(40) / 12.0) if discharges else y[first : first + 40, 0] * (1.0 - 0.97 * np.hanning(40))
        )
    (found,) = bursts([recording(y)], [np.stack([MOVE, MOVE], axis=1)])
    far = np.abs(y[:, 0] - MOVE) > 0.1
    assert found[far, 0].mean() > 0.9 if discharges else not found.any()


@pytest.mark.parametrize("off", [0.5, -0.5, 0.02])
def test_a_first_sample_that_is_far_off_does_not_count(off):
    """What begins at that instant may be in it or not; two deviations of its noise are no more than noise."""
    y = noisy(7)
    y[0] += off
    (found,) = bursts([recording(y)], [np.stack([MOVE, MOVE], axis=1)])
    assert found[0].all() == (abs(off) > 0.1) and not found[1:].any()


@pytest.mark.parametrize("quantum", [0.0, 0.03, 0.1])
def test_a_frozen_value_is_found_and_a_coarse_one_is_none(quantum):
    """A coarse sensor repeats values while it moves by less than a quantum; noise and rounding are within 6 of their deviations."""
    y = noisy(5)
    y = quantum * np.round(y / quantum) if quantum else y
    assert not bursts([recording(y)], [np.stack([MOVE, MOVE], axis=1)])[0].any()
    for first in (2000, 7010):
        y[first : first + 40, 0] = y[first, 0]
    (found,) = bursts([recording(y)], [np.stack([MOVE, MOVE], axis=1)])
    for first in (2000, 7010):
        assert found[first + 1 : first + 40, 0].all()
    assert not found[:, 1].any() and np.count_nonzero(found) < 2 * 60


def test_a_coarse_sensor_that_is_mostly_at_rest_has_none():
    """At rest it says 0 as its model does, in motion one of two values half a quantum away."""
    x = np.where(0.6 * T[-1] > T, 0.0, 1.0) * MOVE
    model = np.stack([x, x], axis=1)
    y = np.stack([0.28 * np.round((x + 0.02 * np.random.default_rng(6).normal(size=N)) / 0.28), x], axis=1)
    assert not bursts([recording(y)], [model])[0].any()
    y[8000:8200, 0] = y[8000, 0]
    assert bursts([recording(y)], [model])[0][8001:8200, 0].all()


@pytest.mark.parametrize("louder", [6.0, 9.0, 12.0])
def test_a_sensor_that_is_noisier_in_motion_has_none(louder):
    """As one of a coarse converter is: at rest it says the same again and again. Beyond 14 deviations at rest are up to 1 % of all."""
    draw = np.random.default_rng(3)
    size = np.where(0.6 * T[-1] > T, 1.0, louder)
    y = np.stack([MOVE + 1e-3 * size * draw.normal(size=N), MOVE], axis=1)
    (found,) = bursts([recording(y)], [np.stack([MOVE, MOVE], axis=1)])
    assert not found.any()


def test_what_is_no_more_than_noise_is_not_wild():
    """Bursts that an explanation leaves are some if they stand out of the noise, and were not halved."""
    wild = np.zeros((N, 2), bool)
    wild[100:120, 0] = True
    y = np.zeros((N, 2))
    study = Simple(experiments=[recording(y)], levels=[np.ones((5, 2))])
    for before, after, said in ((10.0, 9.0, True), (10.0, 5.0, False), (1.2, 1.0, False), (10.0, 0.9 * WILD, False)):
        study.null = Simple(simulated=[np.full((N, 2), before)])
        (found,) = still_wild(study, Simple(simulated=[np.full((N, 2), after)]), [wild])
        assert found.tolist() == [[said, False]]


@pytest.mark.parametrize("quantum, length, so", [(0.0, 4, True), (0.0, 2, False), (0.02, 30, True), (0.02, 5, False)])
def test_rows_too_long_for_noise_repeat(quantum, length, so):
    """Two equal samples of a fine sensor are chance, four are not; of one whose quantum is twice its noise, five are, thirty
    are not."""
    y = noisy(6)[:, 0]
    y = np.round(y / quantum) * quantum if quantum else y
    at = slice(4001, 4000 + length)
    y[4000 : 4000 + length] = y[3999] + 1.0  # where no sample near it has this value
    y[4000 : 4000 + length] = y[4000]
    found = repeats(y, MOVE, np.ones(N, bool), quantum, 0.01)
    assert found[at].all() == so and not found[:4000].any() and not found[4001 + length :].any()


def test_a_model_at_rest_lets_a_sensor_rest():
    y = np.where(T < 2.0, 0.0, noisy(7)[:, 0])
    assert not repeats(y, np.where(T < 2.0, 0.0, MOVE), np.ones(N, bool), 0.0, 0.01).any()
