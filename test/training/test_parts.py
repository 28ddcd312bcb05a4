# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The parts of training: exact sensitivities, curves, curves as networks, limits, noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_gen.model import Promises
from penode_gen.reading.untrained import untrained
from penode_gen.sets import promises
from penode_sil.training import bands, curve, data, dense, drive, promised, unfold
from penode_sil.training.engine import Engine
from penode_sil.training.settings import SETTINGS
from penode_sil.training.solve import Limits, least

HERE = Path(__file__).parent


@pytest.mark.parametrize(("method", "activation"), [("euler", "tanh"), ("heun", "sigmoid"), ("rk4", "softplus"), ("rk4", "relu")])
def test_sensitivities_are_those_of_the_discrete_step(method: str, activation: str) -> None:
    """Against central differences of the simulation: parameters, start states, weights; two networks, substeps, rates of the input."""
    model = replace(penode_gen.load(HERE / "quarter_two.toml"), method=method, substeps=2)
    network = untrained({"layers": [5, 4], "activation": activation}, 2, "both_net")
    shape = dense.like(network, np.array([0.03, 0.6]), 900.0, True, 3)
    shape = shape.with_theta(shape.theta * 4.0)
    engine = Engine(model, ["m_b", "c_t", "d_t"])
    t = np.arange(200) * 1e-3
    d = drive.drive(model, (0.02 * np.sin(9.0 * t) + 0.004 * np.sin(70.0 * t))[:, None], False)
    p, start = np.array([q.value for q in model.parameters.values()]), np.array([0.01, 0.0, 0.0, 0.1])
    columns = 3 + 4 + shape.columns
    found = np.concatenate([b.jacobian.copy() for b in engine.blocks(d, p, [shape], start, columns)])
    names = list(model.parameters)
    for column in (0, 1, 2, 3, 6, 7, 8, 12, 20, 30, columns - 2):

        def moved(by: float, column: int = column) -> np.ndarray:
            q, x, theta = p.copy(), start.copy(), shape.theta.copy()
            if column < 3:
                q[names.index(engine.free[column])] += by
            elif column < 7:
                x[column - 3] += by
            else:
                theta[column - 7] += by
            return engine.simulate(d, q, [shape.with_theta(theta)], x)[0]

        step = 1e-5 * p[names.index(engine.free[column])] if column < 3 else 1e-6 if column < 7 else 1e-5
        differences = (moved(step) - moved(-step)) / (2.0 * step)
        # differences: their own error is of second order, 1e-10 of what bends, and rounding of some hundred operations, 1e-14 of the
        # signal, over the step of 1e-5; a relu that switches in between changes what follows by the share of the step, 1e-5, times its kink
        error = (
            np.max(np.abs(found[:, :, column] - differences))
            if activation != "relu"
            else np.median(np.abs(found[:, :, column] - differences))
        )
        assert error < (1e-4 if activation == "relu" else 1e-5) * np.max(np.abs(differences)) + 1e-9 * np.max(np.abs(found)), column


def test_simulation_is_that_of_the_deployed_step() -> None:
    """The same samples as the generated C in double, where the input is a straight line between its samples."""
    from penode_sil.batch import Batch
    from penode_sil.training.judge import with_networks

    model = penode_gen.load(HERE / "quarter.toml")
    knots = curve.spaced(-0.05, 0.05, 21, 1.2)
    zero = int(np.flatnonzero(knots == 0.0)[0])
    spring = curve.Curve(knots, 1e3 * knots + 2e5 * knots**2, zero)
    damper = curve.Curve(knots * 20.0, 40.0 * np.tanh(knots * 100.0), zero)
    networks = {
        n: unfold.unfold(c, model.sets["default"].networks[n], -1.0, 1.0) for n, c in (("spring_net", spring), ("damper_net", damper))
    }
    u = 0.02 * np.arange(400.0)[:, None] / 400.0
    engine = Engine(model, [])
    z, _, good = engine.simulate(
        drive.drive(model, u, False), np.array([p.value for p in model.parameters.values()]), [spring, damper], np.zeros(4)
    )
    run = Batch(with_networks(model, networks, {}), np.float64).run(u, x0=np.zeros(4), sensors=["a_body", "a_wheel"], outputs=["z_b"])
    assert good
    # the spline of a line is the line; its rate at the very first sample is 0 for the C, so the wheel's acceleration there differs
    assert np.allclose(z[1:, :2], run.z[0][1:], rtol=0.0, atol=1e-9) and np.allclose(z[:, 2], run.y[0][:, 0], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("layers", [[8], [8, 8], [16, 16, 16], [6, 9, 7, 5]])
def test_a_curve_is_its_network_exactly(layers: list[int]) -> None:
    network = untrained({"layers": layers}, 1, "net")
    random = np.random.default_rng(len(layers))
    knots = np.sort(np.concatenate([random.uniform(-0.9, 1.3, unfold.capacity(network) - 1), [0.0]]))
    zero = int(np.flatnonzero(knots == 0.0)[0])
    values = random.normal(0.0, 300.0, len(knots))
    values[zero] = 0.0
    found = unfold.unfold(curve.Curve(knots, values, zero), network, -0.9, 1.3)
    x = np.linspace(-3.0, 3.0, 5001)
    expected = curve.Curve(knots, values, zero)(x)
    # some hundred sums of doubles of that size
    assert np.allclose(found.evaluate(x[:, None])[:, 0], expected, rtol=0.0, atol=1e-12 * np.max(np.abs(expected)) * 100.0)
    assert promises._at_zero(found, False) == 0.0
    assert found.architecture == network.architecture
    with pytest.raises(ValueError, match="do not fit"):
        more = np.sort(np.append(knots, 0.5 * (knots[0] + knots[1])))
        unfold.unfold(curve.Curve(more, np.zeros(len(more)), int(np.flatnonzero(more == 0.0)[0])), network, -0.9, 1.3)
    with pytest.raises(ValueError, match="do not fit"):  # all on one side of 0: a kink more
        unfold.unfold(curve.Curve(np.append(0.0, np.sort(np.abs(knots[knots != 0.0]))), np.zeros(len(knots)), 0), network, -0.9, 1.3)


def test_knots_that_matter_stay() -> None:
    """Of 41 knots on a curve of three kinks, the three and the ends are left; a regular grid stays where noise alone says otherwise."""
    knots = np.linspace(-1.0, 1.0, 41)
    kinks = np.array([-1.0, -0.5, 0.0, 0.3, 1.0])
    truth = np.interp(knots, kinks, [3.0, -2.0, 0.0, 1.0, -4.0])
    regular = np.arange(41) % 10 == 0
    kept = curve.fewer(knots, truth, np.eye(41) * 1e-4, 5, regular, 20)
    assert np.allclose(knots[kept], kinks)
    # Where all is noise, risk inflation lets through less than one candidate a choice; without it nearly all are chosen by noise.
    chosen = {True: 0, False: 0}
    for seed in range(20):
        noise = np.where(knots == 0.0, 0.0, np.random.default_rng(seed).normal(0.0, 1.0, 41))
        for grid in chosen:
            found = curve.fewer(knots, noise, np.eye(41), 5, regular & grid, 20)
            chosen[grid] += int(np.sum(found & ~regular))
    assert chosen[True] < 20 < chosen[False]


def test_regular_knots_stay_unless_data_speak() -> None:
    """Wald's test of 20 middles: noise alone does not pass it, a kink in one of ten deviations does."""
    knots, regular = np.linspace(-1.0, 1.0, 41), np.arange(41) % 2 == 0
    draws = [np.random.default_rng(k).normal(0.0, 1.0, 41) for k in range(50)]
    assert sum(curve.bent(knots, d, np.eye(41), regular) for d in draws) <= 2  # 0.4 % of them on average
    kink = np.where(np.arange(41) == 7, 10.0 * np.sqrt(1.5), 0.0)
    assert all(curve.bent(knots, d + kink, np.eye(41), regular) for d in draws)


def test_sag_of_a_smooth_curve_is_in_its_band() -> None:
    """A parabola a x^2 between knots h apart sags by a h^2 / 4 in the middle of each piece; on a straight line next to nothing."""
    knots = np.linspace(-1.0, 1.0, 11)
    assert np.allclose(bands.sag(curve.Curve(knots, 3.0 * knots**2, 5)), 3.0 * 0.2**2 / 4.0)
    assert np.all(bands.sag(curve.Curve(knots, 3.0 * knots, 5)) < 1e-8)


@pytest.mark.parametrize(
    "given",
    [
        Promises(increasing=True, dissipative=0.0, max_slope=4000.0, zero_at_zero=True),
        Promises(decreasing=True, max_slope=2500.0),
        Promises(dissipative=0.5, max_slope=8000.0),
    ],
)
def test_limits_keep_promises_by_exact_arithmetic(given: Promises) -> None:
    """Random curves brought within their limits: their networks keep the promises with the margin of the certificate."""
    network = untrained({"layers": [12, 12]}, 1, "net")
    random = np.random.default_rng(5)
    count = unfold.capacity(network)
    broken_before = 0
    for _ in range(5):
        knots = np.sort(np.concatenate([random.uniform(-1.0, 1.0, count - 1), [0.0]]))
        zero = int(np.flatnonzero(knots == 0.0)[0])
        values = random.normal(0.0, 300.0, count)
        values[zero] = 0.0
        wild = curve.Curve(knots, values, zero)
        for n in range(SETTINGS.story_tries):  # as `written` does
            limits = promised.bound(given, SETTINGS.promised_first * SETTINGS.story_tighter**n)(wild)
            step = least(np.eye(wild.columns), np.zeros(wild.columns), limits, wild.theta)
            kept = wild.with_theta(wild.theta + step)
            if not promises.broken(given, unfold.unfold(kept, network, -1.0, 1.0), False):
                break
        broken_before += bool(promises.broken(given, unfold.unfold(wild, network, -1.0, 1.0), False))
        assert promises.broken(given, unfold.unfold(kept, network, -1.0, 1.0), False) == []
    assert broken_before == 5  # the check can fail: without limits every one breaks


def test_least_step_within_limits() -> None:
    """A step from where the free optimum is beyond a wall: onto the wall, at the place of least cost there."""
    curvature, slope = np.array([[2.0, 0.5], [0.5, 1.0]]), np.array([3.0, 1.0])
    wall = Limits(np.array([[-1.0, 0.0]]), np.array([-0.5]))  # first unknown at most 0.5
    found = least(curvature, slope, wall, np.zeros(2))
    assert np.allclose(found, [0.5, (1.0 - 0.25) / 1.0], atol=1e-9)
    assert np.allclose(least(curvature, slope, Limits(-wall.rows, np.array([-9.0])), np.zeros(2)), np.linalg.solve(curvature, slope))


def test_colour_of_noise_is_found() -> None:
    random = np.random.default_rng(1)
    new = random.normal(0.0, 0.3, 40_000)
    slow = np.zeros_like(new)
    for k in range(1, len(new)):
        slow[k] = 0.8 * slow[k - 1] + new[k]
    white = data.Noise(np.ones(2), (np.zeros(0), np.zeros(0)), np.ones(2))
    residual = np.stack([slow, new], axis=1)
    good = np.ones(residual.shape, dtype=bool)
    found = data.of_residuals([residual], [good], white, coloured=True)
    # 1 / sqrt(40 000) is 0.5 %; five of that
    assert abs(found.colour[0][0] - 0.8) < 0.025 and len(found.colour[1]) == 0 and np.allclose(found.sigma, 0.3, rtol=0.025)
    good[100, 0] = False
    e = found.white(residual, good)
    assert np.all(e[100:105, 0] == 0.0) and np.all(e[100:105, 1] != 0.0)


def test_a_band_holds_95_of_100_about_what_is_known_to_be_away() -> None:
    """Drawn errors about 0 to 10 deviations away: 1.96 of the band's own hold 95 %, by four deviations of the draw."""
    random = np.random.default_rng(1)
    for away in (0.0, 0.3, 1.0, 3.0, 10.0):
        errors = away + random.standard_normal(20_000)
        held = np.abs(errors) < 1.96 * float(bands.wide(np.array([away]), np.ones(1))[0])
        assert abs(held.mean() - 0.95) < 4.0 * np.sqrt(0.05 * 0.95 / 20_000), away


def test_what_is_left_of_a_sag_is_nothing_at_knots_and_middles() -> None:
    knots = np.linspace(-1.0, 1.0, 11)
    parabola = curve.Curve(knots, 3.0 * knots**2, 5)
    assert np.allclose(bands.rest(parabola, np.array([0.2, 0.3, 0.4])), 0.0)
    assert np.allclose(bands.rest(parabola, np.array([0.25, 0.35])), 3.0 * 0.2**2 / 16.0)
