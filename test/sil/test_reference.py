# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The compiled solution against SciPy's, equation by equation and over time."""

from __future__ import annotations

import numpy as np
import pytest
from places import HERE
from test_targets import need

import penode_gen
from penode_gen.networks import Affine, Dense, Network
from penode_gen.twins.exact_c import weights_of
from penode_sil import mil
from penode_sil.errors import ModelError
from penode_sil.reference import compiled, series
from penode_sil.reference.by_scipy import ByScipy
from penode_sil.scenario import Exchange, Instance
from penode_sil.signals import Bump, Chirp, Constant, Road, Samples, Signal, Sum, VelocityChirp

NQVM = HERE.parents[1] / "gen" / "nqvm" / "nqvm.toml"
ROAD = Sum((Road(256e-6, 20.0, 3, 0.2), Bump(0.05, 0.05, 0.1)))


@pytest.mark.parametrize("name", sorted(p.stem for p in (HERE / "models").glob("*.toml") if p.stem not in ("published",)))
def test_equations_are_those_of_the_numeric_twin(name):
    """Rates, outputs and sensors at random points; the two differ by the rounding of some hundred operations."""
    need("gcc")
    model = penode_gen.load(HERE / "models" / f"{name}.toml")
    draw, found, exact = np.random.default_rng(1), compiled.Compiled(model), ByScipy(model)
    n_u = len(model.inputs) + len(model.sampled)
    for set_name in model.sets:
        x = np.array(model.start) + 0.05 * np.abs(draw.normal(size=(20, len(model.states))))
        u, v = 0.02 * draw.normal(size=(20, n_u)), draw.normal(size=(20, n_u))
        rates = np.array([exact._equations[set_name].rates(*row) for row in zip(x, u, v, strict=True)])
        got = np.array([found.rates(set_name, *row) for row in zip(x, u, v, strict=True)])
        for a, b in zip((got, *found.look(set_name, x, u, v)), (rates, *exact.look(set_name, x, u, v)), strict=True):
            assert np.array_equal(np.isnan(a), np.isnan(b))
            assert np.allclose(a, b, rtol=0.0, atol=1e-12 * (1.0 + np.nanmax(np.abs(b), initial=0.0)), equal_nan=True)


@pytest.mark.parametrize("activation", ["relu", "identity", "tanh", "sigmoid", "softplus", "step"])
def test_networks_are_evaluated_alike(activation):
    need("gcc")
    draw = np.random.default_rng(2)
    layers = (
        Affine(draw.normal(size=2), draw.normal(size=2), "centre"),
        Dense(draw.normal(size=(5, 2)), draw.normal(size=5), activation),
        Dense(draw.normal(size=(1, 5)), draw.normal(size=1), "identity"),
        Affine(draw.normal(size=1), draw.normal(size=1), "rescale"),
    )
    network = Network(layers, None, None, "drawn")
    library = compiled.Compiled(penode_gen.load(NQVM))._library  # takes layers of up to 16
    library.exact_network.restype = compiled.ctypes.c_double
    weights = weights_of(network)
    for x in [*draw.normal(size=(50, 2)) * 3.0, np.array([-900.0, 900.0]), np.array([np.nan, 0.0])]:
        point = compiled.ctypes.c_void_p(np.ascontiguousarray(x).ctypes.data)
        got = library.exact_network(compiled.ctypes.c_void_p(weights.ctypes.data), point)
        assert got == pytest.approx(float(network.evaluate(x)[0]), rel=1e-13, abs=1e-13, nan_ok=True)


@pytest.mark.parametrize(
    "signal",
    [
        Constant(3.0),
        Chirp(0.01, 2.0, 0.5, 0.3),
        VelocityChirp(0.15, 1.0, 0.25, 1.0),
        ROAD,
        Samples(np.array([0.0, 0.3, 0.31, 2.0]), np.array([0.0, 1.0, -1.0, 0.5])),
    ],
    ids=["constant", "chirp", "velocity", "road", "samples"],
)
def test_series_follow_a_signal(signal: Signal):
    """Values and slopes within CLOSE of the largest, and the rounding of a phase of some hundred radians."""
    edges = np.array(sorted({0.0, 2.0, *signal.knots()}))
    found = series.fitted((signal,), edges, 1e-3)
    t = np.random.default_rng(3).uniform(0.0, 2.0, 4000)
    k = np.clip(np.searchsorted(found.bounds, t) - 1, 0, len(found.bounds) - 2)
    s = 2.0 * (t - found.bounds[k]) / (found.bounds[k + 1] - found.bounds[k]) - 1.0
    for terms, exact in ((found.value, signal.value(t)), (found.slope, signal.slope(t))):
        got = np.array([np.polynomial.chebyshev.chebval(a, c[0]) for a, c in zip(s, terms[k], strict=True)])
        assert np.max(np.abs(got - exact)) <= 10.0 * series.CLOSE * max(np.max(np.abs(exact)), 1e-300)
    assert np.array_equal(found.bounds[found.first.astype(int)], edges)


def test_a_hidden_kink_is_enclosed():
    """A signal whose kink is no knot: only a narrow segment about it is not close."""
    kinked = Samples(np.array([0.0, 0.123, 1.0]), np.array([0.0, 1.0, 0.0]))
    object.__setattr__(kinked, "knots", lambda: ())
    found = series.fitted((kinked,), np.array([0.0, 1.0]), 1.0 / series.TERMS)
    widths = np.diff(found.bounds)
    k = int(np.searchsorted(found.bounds, 0.123)) - 1
    assert widths[k] <= 1.0 / 2**series.TERMS
    assert len(widths) < 40


@pytest.mark.parametrize(
    "inputs", [ROAD, Samples(np.arange(401) * 1e-3, np.cumsum(np.random.default_rng(5).normal(size=401)) * 1e-3)], ids=["road", "recording"]
)
def test_both_solve_the_quarter_vehicle(inputs, monkeypatch):
    """Through an exchange and a hold. SciPy's part: at most twenty steps a millisecond, with errors of up to
    1e-11 of the largest state."""
    need("gcc")
    model = penode_gen.load(NQVM)
    other = sorted(model.sets)[-1]
    instance = Instance("i", "default", (Exchange(0.1, other, "write", 40, True), Exchange(0.15, "", "rollback")))
    t = np.arange(201) * 1e-3
    runs = []
    for there in (True, False):
        monkeypatch.setattr(compiled, "available", lambda there=there: there)
        runs.append(mil.solve(model, instance, {"z_road": inputs}, 0.2, t, 1196))
    a, b = runs
    assert a.adopted == b.adopted
    for got, exact in ((a.x, b.x), (a.y, b.y), (a.z, b.z)):
        assert np.max(np.abs(got - exact)) < 4e-8 * np.max(np.abs(exact))
    assert np.ptp(b.x[:, 0]) > 1e-3


def one_state(path, k: float, rate: str) -> penode_gen.Model:
    """der(x) = rate, from 1, with an input u."""
    path.write_text(
        f"""[model]
name = "one"
sample_time = "1 ms"
method = "ros1"
[inputs]
u = {{ unit = "1" }}
[states]
x = {{ unit = "1", start = 1.0 }}
[parameters]
k = {{ value = {k}, unit = "1/s" }}
[equations]
rate = "der(x) = {rate}"
[outputs]
y = {{ value = "x", unit = "1" }}
"""
    )
    return penode_gen.load(path)


def test_a_stiff_model_is_left_to_an_implicit_method(tmp_path):
    """An explicit method would take 1e8 steps for 6 s."""
    need("gcc")
    model, t = one_state(tmp_path / "stiff.toml", 1e8, "k*(u - x)"), np.arange(6001) * 1e-3
    run = mil.solve(model, Instance("i", "default"), {"u": Chirp(0.01, 1.0, 0.0, 0.0)}, 6.0, t, 1)
    assert np.max(np.abs(run.x[1:, 0] - 0.01 * np.sin(2.0 * np.pi * t[1:]))) < 1e-9  # a lag of 1e-8 s times 0.063/s, and the tolerance


@pytest.mark.parametrize("there", [True, False], ids=["compiled", "SciPy"])
def test_an_unstable_model_is_reported_with_its_time(there, tmp_path, monkeypatch):
    """x' = x^2 from 1 is infinite after 1 s."""
    if there:
        need("gcc")
    monkeypatch.setattr(compiled, "available", lambda: there)
    model = one_state(tmp_path / "burst.toml", 1.0, "k*x^2 + k*u")
    with pytest.raises(ModelError, match=r"cannot be continued after (0\.99|1 )"):
        mil.solve(model, Instance("i", "default"), {"u": Constant(0.0)}, 2.0, np.arange(2001) * 1e-3, 1)
