# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Faults are put into signals of known truth: all that stand out are found, and a healthy sensor is left in peace."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy import signal

from penode_sil.recordings.quality import examine, quantisation

N = 30_000
T = np.arange(N) * 1e-3
SEED = 20_261_121


def chirp() -> np.ndarray:
    return signal.chirp(T, 0.5, 30.0, 15.0, phi=30.0)


def random() -> np.ndarray:
    """Low-passed noise (10 Hz) of standard deviation 1, like the response to a rough road."""
    x = signal.lfilter(*signal.butter(2, 0.02), np.random.default_rng(SEED).normal(size=N))
    return x / x.std()


def bump(at: float = 5.0) -> np.ndarray:
    return np.where(np.abs(T - at) < 0.25, 0.5 * (1.0 + np.cos(4.0 * np.pi * (T - at))), 0.0)


MOVES = {
    "chirp": chirp,
    "random": random,
    "bump": bump,
    "bump at an offset": lambda: bump() - 2.0,
    "slow sine": lambda: np.sin(0.3 * T),
    "rest, then chirp": lambda: np.where(T > 3.0, np.interp(T - 3.0, T, np.sin(20.0 * T) * T / 30.0), 0.0),
    "from level to level": lambda: np.tanh((T - 5.0) / 0.01),
    "flat turns": lambda: np.sin(0.3 * T) ** 3,
}


@pytest.mark.parametrize("noise", [0.0, 1e-3, 2e-2])
@pytest.mark.parametrize("move", MOVES)
def test_a_healthy_sensor_has_no_faults(move, noise):
    draw = np.random.default_rng(SEED)
    x = MOVES[move]() + noise * draw.normal(size=N)
    size = noise or 1e-3
    writings = [x, x.astype(np.float32).astype(float), np.array([float(f"{v:.6g}") for v in x])]
    for quantum in (0.1 * size, 0.3 * size, size, 3.0 * size, 0.05):
        writings.append(np.round(x / quantum) * quantum)
    for written in writings:
        faults = examine(written)
        assert not faults.any.any() and faults.low is None and faults.high is None and not faults.constant


CASES = [(move, noise, quantum) for move in (chirp, random) for noise in (0.0, 1e-3, 0.05) for quantum in (0.0, 1e-3, 1e-2)]


def measured(move, noise: float, quantum: float) -> tuple[np.ndarray, np.random.Generator]:
    draw = np.random.default_rng(SEED + 1)
    x = move() + noise * draw.normal(size=N)
    return (np.round(x / quantum) * quantum if quantum else x), draw


@pytest.mark.parametrize("move, noise, quantum", CASES)
def test_saturation_is_found_with_its_limits(move, noise, quantum):
    x, _ = measured(move, noise, quantum)
    high, low = np.quantile(x, 0.8), np.quantile(x, 0.15)
    x = np.clip(x, low, high)
    faults = examine(x)
    assert (faults.low, faults.high) == (low, high)
    assert np.array_equal(faults.saturated, (x == low) | (x == high)) and not faults.held.any()


@pytest.mark.parametrize("move, noise, quantum", CASES)
def test_held_samples_are_found_where_the_signal_went_on(move, noise, quantum):
    x, draw = measured(move, noise, quantum)
    y, frozen = x.copy(), np.zeros(N, dtype=bool)
    for at in draw.choice(np.arange(200, N - 200, 100), 25, replace=False):
        length = draw.integers(10, 40)
        y[at : at + length] = x[at]
        # it must differ from what a slow or noisy signal does by itself: a jump at its end of more than ten noises and
        # of eight quanta; how long a row of equal samples must be at smaller ones depends on the noise, in quanta
        frozen[at + 1 : at + length] = abs(x[at + length] - x[at]) > max(10.0 * noise, 8.0 * quantum)
    untouched = x == y
    faults = examine(y)
    assert frozen.sum() > 50
    assert np.mean(faults.held[frozen & ~untouched]) > 0.8  # some rows end beside a turn of the signal
    assert np.mean(faults.any[untouched]) < 2e-3  # of 30000: rows that go on for a few samples by themselves


@pytest.mark.parametrize("move, noise, quantum", CASES)
def test_zeroed_samples_are_found(move, noise, quantum):
    x, draw = measured(move, noise, quantum)
    lost = np.zeros(N, dtype=bool)
    clear = np.arange(200, N - 200, 100)  # each with healthy samples around it
    for at in draw.choice(clear[np.abs(x[clear]) > 0.5], 25, replace=False):
        lost[at : at + draw.integers(1, 20)] = True
    y = np.where(lost, 0.0, x)
    far = lost & (np.abs(x) > 0.5)
    found = examine(y).any
    assert np.mean(found[far]) > 0.95 and np.mean(found[~lost]) < 1e-3


@pytest.mark.parametrize("move, noise, quantum", CASES)
def test_spikes_are_found(move, noise, quantum):
    x, draw = measured(move, noise, quantum)
    at = draw.choice(np.arange(100, N - 100, 50), 20, replace=False)
    x[at] += draw.choice([-1.0, 1.0], 20) * draw.uniform(1.5, 4.0, 20)  # at least 30 of the largest noise
    assert np.array_equal(np.flatnonzero(examine(x).spikes), np.sort(at))


def test_faults_of_several_kinds_are_distinguished():
    x, _draw = measured(random, 0.02, 1e-3)
    x = np.clip(x, -1.5, 1.5)
    calm = np.flatnonzero(np.abs(x) < 1.0)
    a, b, c = (calm[np.searchsorted(calm, at)] for at in (5000, 9000, 15_000))
    x[a : a + 30] = x[a]
    x[b] += 2.0
    x[12_000:12_100] = np.nan
    x[c : c + 10] = 0.0
    faults = examine(x)
    assert (faults.low, faults.high) == (-1.5, 1.5)
    assert faults.held[a + 1 : a + 30].all() and faults.held[c : c + 10].all() and faults.held.sum() <= 29 + 12
    assert np.flatnonzero(faults.missing).tolist() == list(range(12_000, 12_100))
    assert np.flatnonzero(faults.spikes).tolist() == [b]


@pytest.mark.parametrize("bits", [6, 10, 16])
def test_quantum_is_found_and_none_is_invented(bits):
    draw = np.random.default_rng(SEED)
    x = draw.normal(size=N)
    quantum = 10.0 / 2**bits
    coded = np.round(x / quantum) * quantum
    assert quantisation(coded) == pytest.approx(quantum, rel=1e-3)
    coded[::1000] += 0.3 * quantum  # outliers need not be on a step
    assert quantisation(coded) == pytest.approx(quantum, rel=1e-3)
    assert quantisation(x) == 0.0 and quantisation(x[:20]) == 0.0


def test_values_that_a_fine_sensor_froze_at_are_no_steps_of_a_coarse_one():
    x = np.cumsum(np.random.default_rng(6).standard_normal(13_000))
    for at, long in ((2000, 25), (7000, 6), (9000, 33)):
        x[at : at + long] = x[at]
    found = examine(x)
    assert found.quantum == 0.0
    assert [np.count_nonzero(found.held[at : at + long]) for at, long in ((2000, 25), (7000, 6), (9000, 33))] == [24, 5, 32]


@pytest.mark.parametrize("seed", range(20))
def test_a_vehicle_at_rest_starts_and_stops_without_a_fault(seed):
    """A tenth of a metre per second as step of a speed, ten rows a second: it stands, starts, drives, stops, stands."""
    draw = np.random.default_rng(seed)
    time = np.arange(140) / 10.0
    top, lag = draw.uniform(1.0, 4.0), draw.uniform(0.3, 2.0)
    speed = np.where(time > 2.04, top * (1.0 - np.exp(-(time - 2.04) / lag)), 0.0)
    end = np.searchsorted(time, 9.0)
    speed[end:] = np.maximum(speed[end] - draw.uniform(0.5, 2.0) * (time[end:] - time[end]), 0.0)
    faults = examine(np.round((speed + 0.02 * draw.normal(size=time.size) * (speed > 0.0)) / 0.04) * 0.04)
    assert not faults.held.any() and not faults.spikes.any()
    speed[60] += 6.0 * top
    assert np.flatnonzero(examine(speed).spikes).tolist() == [60]


def test_constant_and_empty_channels():
    assert examine(np.full(100, 3.0)).constant and not examine(np.full(100, np.nan)).constant
    assert not examine(np.empty(0)).any.size


@settings(deadline=None, max_examples=200)
@given(st.lists(st.one_of(st.floats(), st.sampled_from([0.0, 1.0, 2.0, np.nan])), max_size=60))
def test_any_numbers_can_be_examined(values):
    faults = examine(np.array(values, dtype=float))
    assert faults.any.size == len(values) and faults.quantum >= 0.0
