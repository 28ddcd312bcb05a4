# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The generated step: order of every method, exact derivatives, networks of every shape, envelope policies."""

from __future__ import annotations

import itertools
import json
import math

import models
import numpy as np
import pytest
from samples import sample
from scipy.integrate import solve_ivp

import penode_gen
from penode_sil.targets import Sil

ORDERS = {"euler": 1, "heun": 2, "rk4": 4, "ros1": 1, "ros2": 2}
EXTRA = 0x10  # PEN_OUTSIDE
INPUTS = {"cubic": 3, "parabola": 2, "linear": 1, "held": 0}  # how many samples before count
SPAN = list(itertools.product(ORDERS, INPUTS))
SOME = [case for k, case in enumerate(SPAN) if (k // 4 + k) % 2 == 0]  # of each method two inputs, by turns
WIDE = list(itertools.product(ORDERS, INPUTS, ["extrapolate", "clamp", "fade"]))
FEW = [case for k, case in enumerate(WIDE) if (k // 12 + k // 3 + k) % 3 == 0]  # of each method each input, in one of three


@pytest.mark.parametrize("method, input", sample(SPAN, *SOME))
def test_order_of_convergence(tmp_path, method, input, show):
    """Halving the sample time divides the error by 2^order. The inputs are cubics, parabolas, straight lines or constant,
    so that sampling them loses nothing; the reference is the model's equations by hand, integrated by SciPy to 1e-12. The
    steps begin at the fourth sample."""
    slope, bend, twist = float(input != "held"), float(input in ("parabola", "cubic")), float(input == "cubic")

    def force(t):
        return 1.0 + slope * 2.0 * t - bend * 40.0 * t**2 + twist * 60.0 * t**3

    def foot(t):
        return 0.02 + slope * 0.1 * t + bend * 0.5 * t**2 - twist * 0.7 * t**3

    def foot_rate(t):
        return slope * 0.1 + bend * t - twist * 2.1 * t**2

    duration, errors = 0.32, []
    for h in (4e-3, 2e-3, 1e-3):
        path = models.rich(tmp_path, method, h, input)
        n = round(duration / h)
        t = np.arange(-3, n + 1) * h
        u = np.stack([force(t), foot(t)], axis=1)
        instance = Sil(penode_gen.load(path), np.float64).instance()
        instance.run(u[:4])
        instance.set_state(np.array([0.01, 0.0, 0.5]))
        run = instance.run(u[4:])
        assert not np.any(run.status & ~np.uint32(EXTRA))
        data = json.loads((tmp_path / "n2.json").read_text())
        damping = 3.0 if input != "held" else 0.0
        exact = solve_ivp(
            lambda t, x, data=data, damping=damping: models.rich_by_hand(data, t, x, force, foot, foot_rate, damping),
            (0.0, duration),
            [0.01, 0.0, 0.5],
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
        ).y[:, -1]
        errors.append(np.max(np.abs(run.x[-1] - exact)))
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    show(f"{method}, input {input}: error {errors[-1]:.1e} at 1 ms, order {orders[0]:.2f}, {orders[1]:.2f}")
    # the leading error term dominates by about h/tau = 1 ms / 50 ms; what is left moves the slope by that share
    assert abs(orders[-1] - ORDERS[method]) < 0.1


LAW = """
[model]
name = "law"
sample_time = "{h} s"
input = "{input}"
[inputs]
z = {{ unit = "m" }}
[elements]
damper = {{ between = ["z", "ground"], law = "linear_damper", damping = "2 N*s/m" }}
[outputs]
F = {{ value = "F_damper", unit = "N" }}
"""


@pytest.mark.parametrize("input, order, share", [("linear", 1, 1 / 2), ("parabola", 2, 1 / 3), ("cubic", 3, 1 / 4)])
def test_rate_of_an_input_at_a_sample(tmp_path, input, order, share):
    """Of a sine at 5 Hz a line errs by h/2 of the second derivative, the parabola by h^2/3 of the third, the cubic by
    h^3/4 of the fourth (Taylor at the sample); what that leaves out is a share of 2 pi f h = 0.06 at most. Two samples make a line; a bad
    one is passed over."""
    omega = 2 * math.pi * 5
    for h in (2e-3, 1e-3):
        path = tmp_path / f"{input}_{h}.toml"
        path.write_text(LAW.format(h=h, input=input))
        sil, t = Sil(penode_gen.load(path), np.float64), np.arange(500) * h
        z = np.sin(omega * t)
        y = sil.run(z[:, None]).y[:, 0]
        assert y[0] == 0.0 and y[1] == pytest.approx(2 * (z[1] - z[0]) / h, rel=1e-12)
        error = np.max(np.abs(y[order:] - 2 * omega * np.cos(omega * t[order:])))
        assert error == pytest.approx(share * 2 * omega * (omega * h) ** order, rel=omega * h)
        broken = z.copy()
        broken[100] = np.nan
        run = sil.run(broken[:, None])
        assert run.status[100] & 0x1 and run.y[100, 0] == y[99] and np.array_equal(run.y[101 + order :, 0], y[101 + order :])


def flatten(jacobian: np.ndarray, n_x: int, n_u: int, n_y: int, moving: int) -> dict[str, np.ndarray]:
    """The parts of the jacobian struct by name; `moving`: how many inputs before this one the outputs depend on themselves."""
    shapes = {"x_x": (n_x, n_x), "x_u_before": (n_x, n_u), "x_u": (n_x, n_u)}
    shapes |= dict.fromkeys(("x_u_earlier", "x_u_earliest")[: max(moving - 1, 0)], (n_x, n_u))
    shapes |= {"y_x": (n_y, n_x), "y_u": (n_y, n_u)}
    shapes |= dict.fromkeys(("y_u_before", "y_u_earlier", "y_u_earliest")[:moving], (n_y, n_u))
    parts, at = {}, 0
    for name, (rows, columns) in shapes.items():
        parts[name] = jacobian[at : at + rows * columns].reshape(rows, columns)
        at += rows * columns
    return parts


@pytest.mark.parametrize("method, input, outside", sample(WIDE, *FEW))
def test_step_jacobian_against_differences(tmp_path, method, input, outside):
    """Central differences of the discrete step in double, at random states inside, on and outside of the envelope, behind one
    to three samples."""
    model = penode_gen.load(models.rich(tmp_path, method, 5e-3, input, outside, substeps=2, low=-0.3, high=0.3))
    sil, draw, moving = Sil(model, np.float64), np.random.default_rng(11), INPUTS[input]
    n_x, n_u, n_y = 3, 2, 2
    size = n_x * n_x + max(moving + 1, 2) * n_x * n_u + n_y * n_x + n_y * n_u * (1 + moving)

    def started(behind, x, *past):
        instance = sil.instance()
        for u in past[-behind:]:
            instance.step(u)
        instance.set_state(x)
        return instance

    def step(behind, *given):
        state, y, status = started(behind, *given[:-1]).step(given[-1])
        assert status in (0, EXTRA)
        return np.concatenate([state, y])

    def difference(behind, given, of, i):
        d = np.zeros_like(given[of])
        d[i] = 1e-5
        far, near = (step(behind, *(v + sign * d if k == of else v for k, v in enumerate(given))) for sign in (1, -1))
        return (far - near) / 2e-5

    for behind in (1, 2, 3, 3, 3, 3):
        given = draw.uniform(-0.5, 0.5, n_x), *(draw.uniform(-1, 1, (4, n_u)) * [1, 0.1])  # state, then inputs, the earliest first
        instance = started(behind, *given[:-1])
        y, found, status = instance.step_jacobian(given[-1], size)
        assert status in (0, EXTRA)
        plain = step(behind, *given)
        assert np.array_equal(instance.get_state(), plain[:n_x]) and np.array_equal(y, plain[n_x:])  # to the bit
        j = flatten(found, n_x, n_u, n_y, moving)
        # differences: third derivative (about 1e3) * 1e-10 / 6 + rounding 1e-16 / 1e-5 * values of 1e2; relative 1e-6
        tolerance = {"rtol": 1e-6, "atol": 2e-7}
        for i in range(n_x):
            column = difference(behind, given, 0, i)
            np.testing.assert_allclose(j["x_x"][:, i], column[:n_x], **tolerance)
            np.testing.assert_allclose((j["y_x"] @ j["x_x"])[:, i], column[n_x:], rtol=1e-6, atol=1e-5)
        for i in range(n_u):
            column = difference(behind, given, 3, i)
            np.testing.assert_allclose(j["x_u_before"][:, i], column[:n_x], **tolerance)
            direct = j["y_u_before"][:, i] if moving else 0.0
            np.testing.assert_allclose((j["y_x"] @ j["x_u_before"])[:, i] + direct, column[n_x:], rtol=1e-6, atol=1e-5)
            column = difference(behind, given, 4, i)
            np.testing.assert_allclose(j["x_u"][:, i], column[:n_x], **tolerance)
            np.testing.assert_allclose((j["y_x"] @ j["x_u"])[:, i] + j["y_u"][:, i], column[n_x:], rtol=1e-6, atol=1e-5)
            column = difference(behind, given, 2, i)
            along, direct = (j["x_u_earlier"][:, i], j["y_u_earlier"][:, i]) if moving > 1 else (np.zeros(n_x), 0.0)
            np.testing.assert_allclose(along, column[:n_x], **tolerance)
            np.testing.assert_allclose(j["y_x"] @ along + direct, column[n_x:], rtol=1e-6, atol=1e-5)
            column = difference(behind, given, 1, i)
            along, direct = (j["x_u_earliest"][:, i], j["y_u_earliest"][:, i]) if moving > 2 else (np.zeros(n_x), 0.0)
            np.testing.assert_allclose(along, column[:n_x], **tolerance)
            np.testing.assert_allclose(j["y_x"] @ along + direct, column[n_x:], rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("method", ["rk4", "ros1", "ros2"])
def test_jacobian_through_relu_networks(tmp_path, method):
    """The project's nQVM in double: a point on no kink, so differences of 1e-7 see straight lines only."""
    source = (models.Path(__file__).parents[2] / "gen" / "nqvm").resolve()
    path = tmp_path / "nqvm.toml"
    path.write_text((source / "nqvm.toml").read_text().replace('"rk4"', f'"{method}"').replace('"networks/', f'"{source}/networks/'))
    sil, draw = Sil(penode_gen.load(path), np.float64), np.random.default_rng(2)
    for _ in range(20):
        x = draw.uniform(-1, 1, 4) * [0.04, 0.02, 0.5, 0.8]
        before, now = draw.uniform(-0.02, 0.02, (2, 1))

        def start(state, before=before):
            instance = sil.instance()
            instance.step(before)
            instance.set_state(state)
            return instance

        first = start(x)
        _, found, status = first.step_jacobian(now, 4 * 4 + 4 + 4 + 2 * 4 + 2)
        assert status == 0
        j = flatten(found, 4, 1, 2, 0)
        for i in range(4):
            d = np.eye(4)[i] * 1e-9
            column = (start(x + d).step(now)[0] - start(x - d).step(now)[0]) / 2e-9
            # rounding of states of 0.5 by 1e-16 over 1e-9, some ten operations; a kink within 1e-9 m has odds of 1e-4
            np.testing.assert_allclose(j["x_x"][:, i], column, atol=3e-6, rtol=1e-6)


SHAPES = [
    ([1, 1], ["identity"]),
    ([1, 16, 1], ["relu", "identity"]),
    ([1, 16, 16, 16, 1], ["relu", "relu", "relu", "identity"]),
    ([1, 16, 1], ["relu", "relu"]),
    ([3, 5, 1], ["tanh", "identity"]),
    ([2, 20, 37, 1], ["relu", "relu", "identity"]),
    ([4, 32, 16, 1], ["sigmoid", "softplus", "identity"]),
    ([2, 16, 16, 1], ["tanh", "relu", "tanh"]),
    ([1, 7, 4, 1], ["softplus", "step", "identity"]),
    ([3, 64, 64, 1], ["relu", "relu", "sigmoid"]),
    ([1, 256, 1], ["relu", "identity"]),
    ([8, 4, 4, 4, 4, 4, 1], ["relu"] * 5 + ["identity"]),
]


def bare(folder, sizes, activations, seed, outside="extrapolate", low=-1.0, high=1.0):
    data = models.network_file(folder / "net.json", sizes, activations, seed, low, high)
    names = [f"u{i}" for i in range(sizes[0])]
    path = folder / f"bare_{outside}.toml"
    path.write_text(
        models.BARE.format(
            outside=outside,
            units=json.dumps(["1"] * sizes[0]),
            names=", ".join(names),
            inputs="\n".join(f'{n} = {{ unit = "1" }}' for n in names),
        )
    )
    return data, penode_gen.load(path)


@pytest.mark.parametrize("sizes, activations", SHAPES, ids=lambda v: "-".join(map(str, v)))
def test_networks_of_every_shape(tmp_path, sizes, activations):
    data, model = bare(tmp_path, sizes, activations, seed=len(sizes) + sizes[0])
    inputs = np.random.default_rng(4).uniform(-1, 1, (200, sizes[0]))
    expected = np.array([models.network_by_hand(data, x) for x in inputs])
    # sums of up to 256 terms of size 1: relative error below n * eps in double, and n^0.5 * 2^-24 typical in float
    for dtype, tolerance in ((np.float64, 1e-12), (np.float32, 2e-5)):
        run = Sil(model, dtype).run(inputs.astype(dtype))
        if "step" in activations and dtype == np.float32:
            continue  # a rounding error may land on the other side of a step
        np.testing.assert_allclose(run.y[:, 0], expected, rtol=tolerance, atol=tolerance)
        assert not run.status.any()


def test_outside_of_the_envelope(tmp_path):
    """Extrapolate, clamp, fade: value and flag, inside and outside."""
    inputs = np.random.default_rng(6).uniform(-1.2, 1.2, (300, 2))
    low, high, width = -0.4, 0.6, 0.5
    for outside in ("extrapolate", "clamp", "fade"):
        data, model = bare(tmp_path, [2, 9, 1], ["tanh", "identity"], 8, outside, low, high)
        run = Sil(model, np.float64).run(inputs)
        seen = np.clip(inputs, low, high) if outside == "clamp" else inputs
        expected = np.array([models.network_by_hand(data, x) for x in seen])
        if outside == "fade":
            distance = np.maximum(np.maximum(low - inputs, inputs - high), 0.0).max(axis=1)
            expected *= np.clip(1.0 - distance / (width * (high - low)), 0.0, 1.0)
        np.testing.assert_allclose(run.y[:, 0], expected, rtol=1e-12, atol=1e-13)
        leaves = ((inputs < low) | (inputs > high)).any(axis=1)
        assert np.array_equal(run.status == EXTRA, leaves) and np.array_equal(run.status == 0, ~leaves)


def test_tunable_parameter_is_part_of_the_set(tmp_path):
    """Selecting the set "heavy" doubles the mass and nothing else."""
    model = penode_gen.load(models.rich(tmp_path))
    data = json.loads((tmp_path / "n2.json").read_text())
    sil = Sil(model, np.float64)
    for name, mass in (("default", 2.0), ("heavy", 4.0)):
        instance = sil.instance(name)
        _, y, status = instance.step([1.5, 0.03])
        assert status == 0
        rate = models.rich_by_hand(data, 0.0, np.array([0.01, 0.0, 0.5]), lambda t: 1.5, lambda t: 0.03, lambda t: 0.0, mass=mass)
        np.testing.assert_allclose(y, [0.01, rate[1]], rtol=1e-12)
        np.testing.assert_allclose(instance.sensors(), [(1.5 + 0.3 * 50 * (0.01 - 0.03)) / 1.5], rtol=1e-12)


def test_substeps_equal_a_shorter_sample_time(tmp_path):
    """Four substeps of 1 ms are four samples of 0.25 ms of the same straight line, to rounding."""
    fine = Sil(penode_gen.load(models.rich(tmp_path, "rk4", 2.5e-4)), np.float64)
    coarse = Sil(penode_gen.load(models.rich(tmp_path, "rk4", 1e-3, substeps=4)), np.float64)
    t = np.arange(401) * 2.5e-4
    u = np.stack([np.sin(20 * t), 0.01 * np.cos(30 * t)], axis=1)
    knots = u[::4]
    straight = np.stack([np.interp(t, t[::4], knots[:, i]) for i in range(2)], axis=1)
    np.testing.assert_allclose(coarse.run(knots).x, fine.run(straight).x[::4], rtol=1e-9, atol=1e-12)
