# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The reference simulation against solutions that are known without it."""

from __future__ import annotations

import math

import numpy as np

from penode_sil import mil
from penode_sil.scenario import Exchange, Instance
from penode_sil.signals import Chirp, Constant, Samples, VelocityChirp

M, C, D, STIFF = 2.0, 800.0, 4.0, 20.0  # of models/oscillator.toml
# SciPy's local errors are below 1e-11 * 0.1 + 1e-13 a step, about 200 steps a second, damped with 1 s: 3e-10. The compiled ones are less.
ACCURACY = 5e-10


def transition(d: float, t: float) -> np.ndarray:
    """exp(A t) of the free oscillator, A = [[0, 1], [-C/M, -d/M]]; under-damped, closed form."""
    a, w = d / (2 * M), math.sqrt(C / M - (d / (2 * M)) ** 2)
    return math.exp(-a * t) * (np.eye(2) * math.cos(w * t) + np.array([[a, 1.0], [-C / M, -a]]) * math.sin(w * t) / w)


def forced(d: float, amplitude: float, omega: float, t: np.ndarray) -> np.ndarray:
    """From rest, foot = amplitude * sin(omega t): the steady answer and the free one that cancels it at 0, [n, 2]."""
    answer = C * amplitude / complex(C - M * omega**2, d * omega)
    steady = np.column_stack([(answer * np.exp(1j * omega * t)).imag, (1j * omega * answer * np.exp(1j * omega * t)).imag])
    return steady - np.array([transition(d, time) @ steady[0] for time in t])


def test_sine_under_the_foot(oscillator):
    t = np.arange(3001) * 1e-3
    run = mil.solve(oscillator, Instance("i", "default"), {"foot": Chirp(0.01, 2.0, 0.0, 0.0)}, 3.0, t, 1)
    exact = forced(D, 0.01, 4 * math.pi, t)
    assert np.max(np.abs(run.x - exact)) < ACCURACY * 30  # velocities are up to 30 times the positions
    assert np.max(np.abs(run.y[:, 0] - exact[:, 0])) < ACCURACY
    acceleration = (C * (0.01 * np.sin(4 * math.pi * t) - exact[:, 0]) - D * exact[:, 1]) / M
    assert np.max(np.abs(run.z[:, 0] - acceleration)) < ACCURACY * 900  # omega^2 < 900


def test_exchange_changes_the_set_exactly_at_its_time(oscillator):
    t = np.arange(2001) * 1e-3
    instance = Instance("i", "default", (Exchange(0.7, "stiff", "select"), Exchange(1.2, "", "rollback")))
    run = mil.solve(oscillator, instance, {"foot": Constant(0.0)}, 2.0, t, 1, {"z": 0.1, "v": 0.5})
    x = np.array([0.1, 0.5])
    for k, time in enumerate(t):
        if time <= 0.7:
            exact = transition(D, time) @ x
        elif time <= 1.2:
            exact = transition(STIFF, time - 0.7) @ transition(D, 0.7) @ x
        else:
            exact = transition(D, time - 1.2) @ transition(STIFF, 0.5) @ transition(D, 0.7) @ x
        assert np.max(np.abs(run.x[k] - exact)) < ACCURACY * 30
    assert run.adopted == (701, 1201)


def test_state_stands_still_while_held(oscillator):
    t = np.arange(1001) * 1e-3
    # a set of 100 values by 1: 99 samples of staging before the sample of the exchange
    instance = Instance("i", "default", (Exchange(0.5, "stiff", "write", 1, True),))
    run = mil.solve(oscillator, instance, {"foot": Constant(0.0)}, 1.0, t, 100, {"z": 0.1})
    held = transition(D, 0.401) @ np.array([0.1, 0.0])
    assert np.max(np.abs(run.x[401:501] - held)) < ACCURACY * 30
    assert np.array_equal(run.x[401], run.x[500])
    assert np.max(np.abs(run.x[700] - transition(STIFF, 0.2) @ held)) < ACCURACY * 30


def test_straight_lines_of_a_recording(oscillator):
    # a ramp of 1 mm/s that stops: z = r (t - 2a/(w^2+a^2)) + free answer; here through exp(A t) on the moving solution
    t = np.arange(1001) * 1e-3
    foot = Samples(np.array([0.0, 0.4, 1.0]), np.array([0.0, 0.4e-3, 0.4e-3]))
    run = mil.solve(oscillator, Instance("i", "default"), {"foot": foot}, 1.0, t, 1)
    rate, lag = 1e-3, D / C  # the particular solution is rate * (t - d/c), rate
    for k, time in enumerate(t):
        ramp = min(time, 0.4)
        exact = np.array([rate * (ramp - lag), rate]) - transition(D, ramp) @ np.array([-rate * lag, rate])
        if time > 0.4:
            exact = np.array([0.4e-3, 0.0]) + transition(D, time - 0.4) @ (exact - np.array([0.4e-3, 0.0]))
        assert np.max(np.abs(run.x[k] - exact)) < ACCURACY


def test_published_chirp_agrees_with_the_published_trajectory(published, shared, show):
    table = np.loadtxt(shared / "chirp_reference.csv", delimiter=",", skiprows=1)[:1001]
    chirp = {"z_road": VelocityChirp(0.15, 1.0, 0.25, math.pi / 2)}
    run = mil.solve(published(), Instance("i", "default"), chirp, 10.0, table[:, 0], 1196)
    error = np.max(np.abs(run.x[:, :2] - table[:, 4:6]))
    show(f"MiL against the published continuous trajectory, 10 s: {error:.2e} m")
    assert error < 1e-8  # what the published trajectory claims of itself
