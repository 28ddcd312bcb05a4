# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Many runs at once: the bits of the generated step in every lane, whatever varies, and whatever fails beside it."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import numpy as np
import pytest
from places import HERE
from samples import sample

import penode_gen
from penode_sil import batch as library
from penode_sil.batch import Batch
from penode_sil.errors import UserError
from penode_sil.status import FLAGS
from penode_sil.targets import Sil

TYPES = [np.float32, np.float64]
HOLDING, OUTSIDE = 0xF, 1 << FLAGS.index("outside")

# Everything the generator knows: a tunable mass, networks of one and two inputs, smooth and sharp friction, a state that is
# not mechanical, an algebraic loop, the rate of an input, a division by what is not constant.
RICH = """
[model]
name = "rich"
sample_time = "1 ms"
method = "{method}"
substeps = {substeps}
input = "{input}"
outside = "{outside}"
fade_width = 0.5
{folding}
[parameters]
m = {{ value = 2, unit = "kg", tunable = true }}
k = {{ value = 50, unit = "N/m" }}
tau = {{ value = 50, unit = "ms" }}
q_0 = {{ value = 10, unit = "mm" }}
d_0 = {{ value = 2, unit = "N*s/m" }}
[inputs]
F = {{ unit = "N" }}
z = {{ unit = "m" }}
[bodies]
mass = {{ mass = "m", position = "q", velocity = "v_q", start_position = "10 mm" }}
other = {{ mass = "m", position = "r", velocity = "v_r" }}
[elements]
foot = {{ between = ["mass", "z"], law = "linear_spring", stiffness = "k" }}
{foot_damper}
friction = {{ between = ["mass", "ground"], law = "stribeck_friction", breakaway = "3 N", coulomb = "2 N", \
stribeck = "0.2 m/s", transition = "0.3 m/s" }}
stop = {{ between = ["mass", "other"], law = "bump_stop", stiffness = "3000 N/m", gap = "1 mm" }}
both = {{ between = ["mass", "other"], law = "expression", force = "k*s/(1 + (s/q_0)^2) + where(v < 0, d_0, 2*d_0)*v" }}
net = {{ between = ["mass", "ground"], law = "network", network = "two", inputs = ["deflection", "rate"] }}
straight = {{ between = ["mass", "other"], law = "network", network = "one" }}
push = {{ between = ["mass", "ground"], law = "expression", force = "F_lag - F" }}
[states]
F_lag = {{ unit = "N", start = 0.5 }}
[variables]
x = {{ unit = "N" }}
[equations]
lag = "der(F_lag)*tau = x - F_lag"
loop = "2*x - F = 0.5*x + 0.3*F_foot"
[networks]
two = {{ inputs = ["m", "m/s"], output = "N" }}
one = {{ inputs = ["m/s"], output = "N" }}
[outputs]
q = {{ value = "q", unit = "m" }}
a = {{ value = "der(v_q)", unit = "m/s^2" }}
[sensors]
x = {{ value = "x", unit = "N" }}
v = {{ value = "v_q", unit = "m/s" }}
[sets.default]
two = "two.json"
one = "one.json"
[sets.heavy]
m = "4 kg"
"""

# Functions of one input, without any state.
BARE = """
[model]
name = "bare"
sample_time = "1 ms"
input = "held"
[inputs]
u = { unit = "1" }
[outputs]
of_exp = { value = "exp(min(u, 80))", unit = "1" }
of_tanh = { value = "tanh(u)", unit = "1" }
of_sigmoid = { value = "sigmoid(u)", unit = "1" }
of_softplus = { value = "softplus(u)", unit = "1" }
of_abs = { value = "abs(u)", unit = "1" }
of_sign = { value = "sign(u)", unit = "1" }
of_max = { value = "max(u, 0.5)", unit = "1" }
of_where = { value = "where(u <= 1, 2, u)", unit = "1" }
"""


def network(path: Path, sizes: list[int], activations: list[str]) -> None:
    """A random network, trained on [-0.3, 0.3]: the runs below leave that."""
    draw = np.random.default_rng(len(sizes) + sum(sizes))
    layers = [
        {"activation": a, "weights": (draw.standard_normal((n, m)) / np.sqrt(m)).tolist(), "bias": (0.3 * draw.standard_normal(n)).tolist()}
        for (m, n), a in zip(itertools.pairwise(sizes), activations, strict=True)
    ]
    n = sizes[0]
    scaling = {
        "normalise": {"kind": "min-max", "min": [-0.5] * n, "max": [1.5] * n},
        "denormalise": {"kind": "min-max", "min": [0.5], "max": [3.0]},
    }
    path.write_text(json.dumps(scaling | {"layers": layers, "trained_range": {"min": [-0.3] * n, "max": [0.3] * n}}))


def rich(
    folder: Path,
    method: str = "rk4",
    input: str = "linear",
    outside: str = "extrapolate",
    substeps: int = 1,
    activation: str = "tanh",
    folding: str = "",
) -> penode_gen.Model:
    network(folder / "two.json", [2, 5, 7, 1], [activation, "softplus", "identity"])
    network(folder / "one.json", [1, 21, 16, 3, 1], ["relu", "relu", "relu", "identity"])
    damper = 'foot_d = { between = ["mass", "z"], law = "linear_damper", damping = "3 N*s/m" }' if input != "held" else ""
    path = folder / "rich.toml"
    path.write_text(RICH.format(method=method, input=input, outside=outside, substeps=substeps, foot_damper=damper, folding=folding))
    return penode_gen.load(path)


def drive(samples: int, seed: int = 0) -> np.ndarray:
    """A force and a foot as slow random walks [samples, 2]."""
    return np.cumsum(np.random.default_rng(seed).standard_normal((samples, 2)), axis=0) * [0.3, 0.002]


def first(status: np.ndarray, flags: int) -> int:
    found = np.flatnonzero(status & flags)
    return found[0] if found.size else -1


def same(run, lane: int, single) -> None:
    """All states, outputs and sensors of a lane are those of a run by itself, to the bit (NaN does not occur)."""
    for name in ("x", "y", "z"):
        ours, theirs = getattr(run, name)[lane], getattr(single, name)
        assert np.array_equal(ours, theirs) and np.array_equal(np.signbit(ours), np.signbit(theirs)), name
    assert run.first_bad[lane] == first(single.status, HOLDING)
    assert run.first_outside[lane] == first(single.status, OUTSIDE)


def everything(model) -> dict[str, tuple[str, ...]]:
    return {"outputs": tuple(s.name for s in model.outputs), "states": model.states}


CHOICES = [
    ("euler", "held", "clamp", 3, "sigmoid"),
    ("heun", "linear", "fade", 1, "step"),
    ("rk4", "linear", "clamp", 2, "relu", "pieces = 96"),
    ("ros1", "linear", "fade", 1, "tanh"),
    ("ros1", "held", "extrapolate", 2, "relu", "pieces = 96"),
    ("ros2", "linear", "clamp", 1, "sigmoid", 'pieces = 8\nmore_pieces = "layers"'),
    ("ros2", "held", "fade", 3, "step"),
    ("rk4", "parabola", "extrapolate", 1, "tanh"),
    ("euler", "parabola", "extrapolate", 2, "tanh"),
    ("ros1", "parabola", "clamp", 1, "sigmoid"),
    ("ros2", "parabola", "extrapolate", 2, "tanh"),
    ("rk4", "cubic", "extrapolate", 2, "tanh"),
    ("ros2", "cubic", "clamp", 2, "sigmoid"),
]


@pytest.mark.parametrize(
    "choices, dtype",
    sample([(choices, dtype) for dtype in TYPES for choices in CHOICES], *zip(CHOICES, itertools.cycle(TYPES), strict=False)),
)
def test_each_lane_has_the_bits_of_the_step(tmp_path, monkeypatch, choices, dtype):
    """Of the first calls, which are by code that is compiled sooner (float), and of later ones (double)."""
    monkeypatch.setattr(library, "SHORT", 0 if dtype == np.float64 else library.SHORT)
    model = rich(tmp_path, *choices)
    u = drive(600)
    u[[0, 7, 300], [0, 1, 0]] = np.nan, np.inf, -np.inf
    batch = Batch(model, dtype)
    run = batch.run(u, x0=np.array([model.start] * 3), **everything(model))
    single = Sil(model, dtype).run(u)
    assert first(single.status, HOLDING) == 0 and 0 < np.count_nonzero(single.status & OUTSIDE) < len(u)
    for lane in range(3):
        same(run, lane, single)


@pytest.mark.parametrize("compiler", ["gcc", "clang-19"])
@pytest.mark.parametrize("dtype", TYPES)
def test_any_compiler_gives_the_same_bits(tmp_path, monkeypatch, dtype, compiler):
    monkeypatch.setattr(library, "_compiler", lambda model: compiler)
    monkeypatch.setattr(library, "SHORT", 0)
    model, u = rich(tmp_path, "ros2", "cubic", "clamp", 2, "sigmoid"), drive(600)
    run = Batch(model, dtype).run(u, x0=np.array([model.start] * 3), **everything(model))
    same(run, 2, Sil(model, dtype).run(u))


def test_clang_compiles_where_it_is_faster(tmp_path, oscillator, monkeypatch):
    """Models without networks; without it gcc compiles all."""
    assert library._compiler(oscillator) == "clang-19" and library._compiler(rich(tmp_path)) == "gcc"
    monkeypatch.setattr(library.shutil, "which", lambda name: None)
    assert library._compiler(oscillator) == "gcc"


@pytest.mark.parametrize("compiler", ["gcc", "clang-19"])
@pytest.mark.parametrize("dtype", TYPES)
def test_functions_have_the_bits_of_pen_math(tmp_path, monkeypatch, dtype, compiler):
    monkeypatch.setattr(library, "_compiler", lambda model: compiler)
    monkeypatch.setattr(library, "SHORT", 0)
    (tmp_path / "bare.toml").write_text(BARE)
    model = penode_gen.load(tmp_path / "bare.toml")
    draw = np.random.default_rng(3)
    with np.errstate(over="ignore"):
        numbers = draw.standard_normal(20_000) * 10.0 ** np.concatenate([draw.uniform(-320, 300, 2000), draw.uniform(-9, 3, 18_000)])
        u = np.concatenate([numbers, [0.0, -0.0, 0.625, -0.625, 1.0, 20.0, -104.0, 710.5, np.inf, np.nan]]).astype(dtype)[:, None]
    run, single = Batch(model, dtype).run(u, **everything(model)), Sil(model, dtype).run(u)
    same(run, 0, single)


@pytest.mark.parametrize("dtype", TYPES)
def test_a_parameter_in_a_lane_is_that_parameter_in_the_model_file(tmp_path, oscillator, dtype):
    u = 0.01 * np.sin(np.arange(400) * 0.05)[:, None]
    values = {"m": [2.0, 1.7, 2.3], "c": [800.0, 800.0, 1234.5], "d": [4.0, 3.3, 7.0]}
    run = Batch(oscillator, dtype).run(u, parameters=values, **everything(oscillator))
    text = (HERE / "models" / "oscillator.toml").read_text()
    for lane, (m, c, d) in enumerate(zip(*values.values(), strict=True)):
        varied = (
            text.replace("value = 2,", f"value = {m},")
            .replace("value = 800,", f"value = {c},")
            .replace('d = "4 N*s/m"', f'd = "{d} N*s/m"')
        )
        (tmp_path / "varied.toml").write_text(varied)
        same(run, lane, Sil(penode_gen.load(tmp_path / "varied.toml"), dtype).run(u))


@pytest.mark.parametrize("folding", ["", "pieces = 96", 'pieces = 50\nmore_pieces = "layers"'])
def test_inputs_starts_and_sets_of_their_own(tmp_path, folding):
    """19 runs: no multiple of any number of lanes. Each is what it is by itself, with one thread and with two.

    The network has some 50 pieces, so in the last case some sets are folded and some are not.
    """
    model = rich(tmp_path, folding=folding)
    batch, runs = Batch(model), 19
    draw = np.random.default_rng(4)
    u = np.array([drive(200, seed) for seed in range(runs)])
    x0 = draw.standard_normal((runs, len(model.states))) * 0.01
    k = draw.uniform(30, 70, runs)
    values = penode_gen.set_values(model, "default", float) * draw.uniform(0.95, 1.05, (runs, 1))
    together = batch.run(u, x0=x0, parameters={"k": k}, sets=values, **everything(model))
    threads = batch.run(u, x0=x0, parameters={"k": k}, sets=values, threads=2, **everything(model))
    assert together.z.shape == (runs, 200, 2) and together.y.shape == (runs, 200, 2) and together.x.shape == (runs, 200, 5)
    for i in range(runs):
        alone = batch.run(u[i], x0=x0[i], parameters={"k": k[i]}, sets=values[i], **everything(model))
        for name in ("x", "y", "z"):
            assert np.array_equal(getattr(alone, name)[0], getattr(together, name)[i])
            assert np.array_equal(getattr(threads, name)[i], getattr(together, name)[i])
    heavy = batch.run(u[0], set_name="heavy", **everything(model))
    same(heavy, 0, Sil(model, np.float64).run(u[0], set_name="heavy"))


def test_a_run_that_fails_is_reported_and_affects_no_other(oscillator):
    """A mass of 0, a spring that overflows, a NaN in one run's input: held like the step holds, from the first bad sample on."""
    u = np.repeat(0.01 * np.sin(np.arange(300) * 0.05)[None, :, None], 5, axis=0)
    u[3, 100] = np.nan
    batch, wanted = Batch(oscillator, np.float32), everything(oscillator)
    run = batch.run(u, parameters={"m": [2, 0, 2, 2, 2], "c": [800, 800, -1e9, 800, 800]}, **wanted)
    good = Sil(oscillator).run(u[0])
    same(run, 0, good)
    same(run, 4, good)
    same(run, 3, Sil(oscillator).run(u[3]))
    assert run.first_bad[0] == run.first_bad[4] == -1 and run.first_bad[3] == 100
    assert run.first_bad[1] == 0 and not run.x[1].any()  # never left its start
    assert 0 < run.first_bad[2] < 300
    assert np.isfinite(run.x).all() and np.isfinite(run.y).all() and np.isfinite(run.z).all()
    assert (run.x[2, run.first_bad[2] :] == run.x[2, -1]).all()


@pytest.mark.parametrize(
    "choices",
    [("rk4", "linear", "clamp", 4, "softplus"), ("ros2", "linear", "fade", 1, "tanh"), ("rk4", "held", "clamp", 1, "relu", "pieces = 96")],
)
def test_fused_steps_differ_by_rounding_only(tmp_path, choices, monkeypatch):
    """And detect what is not finite as the exact ones do. 600 steps of about 1 000 roundings of 1e-16 each, if all add up. Code of short
    calls fuses nothing."""
    monkeypatch.setattr("penode_sil.batch.SHORT", 0)
    model = rich(tmp_path, *choices)
    u = drive(600)
    u[[0, 7, 300], [0, 1, 0]] = np.nan, np.inf, -np.inf
    exact, quick = (Batch(model, exact=sure).run(u, **everything(model)) for sure in (True, False))
    for name in ("x", "y", "z"):
        a, b = getattr(exact, name), getattr(quick, name)
        assert np.max(np.abs(a - b)) < 600 * 1000 * 1.1e-16 * np.max(np.abs(a)) and not np.array_equal(a, b)
    assert np.array_equal(exact.first_bad, quick.first_bad) and np.array_equal(exact.first_outside, quick.first_outside)


def test_signals_are_kept_in_the_order_asked_for(nqvm):
    u = drive(50)[:, :1]
    batch = Batch(nqvm)
    every = batch.run(u, outputs=("z_b", "z_w"))
    assert every.x.shape == (1, 50, 0)
    some = batch.run(u, sensors=("deflection", "a_body"), outputs=("z_w",), states=("v_w",))
    assert np.array_equal(some.z, every.z[:, :, [2, 0]]) and np.array_equal(some.y, every.y[:, :, 1:])
    assert some.x.shape == (1, 50, 1)
    assert batch.run(u, sensors=()).z.shape == (1, 50, 0)


@pytest.mark.parametrize("every", [3, 4, 1000])
def test_one_sample_in_some_is_the_same_sample(nqvm, every):
    """From the first on; what is kept does not change what happens."""
    u = 0.01 * np.sin(np.arange(101) * 0.05)[:, None]
    batch = Batch(nqvm)
    whole, some = (batch.run(u, outputs=("z_b",), states=("z_b", "v_b"), every=n) for n in (1, every))
    for name in ("x", "y", "z"):
        assert np.array_equal(getattr(some, name), getattr(whole, name)[:, ::every])


def test_central_differences_over_lanes(oscillator, show):
    """Against the derivative of the same RK4 step by complex steps in NumPy, which is exact to rounding.

    With a relative step h the truncation is h^2/6 |z'''| / |z'| in units of the derivative, where each differentiation by
    log c, log m multiplies by at most the phase w t = 20 rad/s * 1 s: 400 h^2 / 6 = 7e-9 at h = 1e-5; the rounding is some
    1000 steps * 1e-16 / (2 h) = 5e-9 of z, which is no larger than z'.
    """
    h, t = 1e-5, np.arange(1000) * 1e-3
    u = (0.01 * np.sin(11.0 * t))[:, None]
    nominal = {"m": 2.0, "c": 800.0, "d": 4.0}
    steps = {
        name: value * (1.0 + h * np.array([(i == j // 2) * (1 - 2 * (j % 2)) for j in range(6)]))
        for i, (name, value) in enumerate(nominal.items())
    }
    z = Batch(oscillator).run(u, parameters=steps, sensors=("a",)).z[:, :, 0]
    worst = 0.0
    for i, name in enumerate(nominal):
        exact = rk4_by_hand(u[:, 0], **nominal | {name: nominal[name] * (1.0 + 1e-30j)}).imag / 1e-30
        ours = (z[2 * i] - z[2 * i + 1]) / (2.0 * h)
        worst = max(worst, float(np.abs(ours - exact).max() / np.abs(exact).max()))
    show(f"central differences over lanes, double, relative step {h:g}: {worst:.1e} of the derivative")
    assert worst < 1.2e-8


def rk4_by_hand(u: np.ndarray, m: complex, c: complex, d: complex, h: float = 1e-3) -> np.ndarray:
    """Acceleration [n] of the oscillator, its foot a straight line between samples."""

    def rate(x: np.ndarray, foot: float) -> np.ndarray:
        return np.array([x[1], -(c * (x[0] - foot) + d * x[1]) / m])

    x, found = np.zeros(2, complex), []
    for before, now in zip(np.append(u[0], u[:-1]), u, strict=True):
        if found:
            k1 = rate(x, before)
            k2 = rate(x + 0.5 * h * k1, 0.5 * (before + now))
            k3 = rate(x + 0.5 * h * k2, 0.5 * (before + now))
            x = x + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(x + h * k3, now))
        found.append(rate(x, now)[1])
    return np.array(found)


@pytest.mark.parametrize(
    "arguments, error, message",
    [
        ({"parameters": {"mass": 1.0}}, UserError, "no parameter 'mass'; it has m, c, d"),
        ({"sensors": ["z"]}, UserError, "no sensor 'z'; it has a"),
        ({"outputs": ["a"]}, UserError, "no output 'a'; it has z"),
        ({"set_name": "soft"}, UserError, "no set 'soft'; it has default, stiff"),
        ({"u": np.zeros((5, 2))}, ValueError, r"u has the shape \(5, 2\); it must be \[n, 1\]"),
        ({"x0": [0.0, np.nan]}, ValueError, "2 finite states"),
        ({"sets": [1.0, 2.0]}, ValueError, r"sets has the shape \(2,\); it must be 1 finite values"),
        ({"parameters": {"m": [[1, 2]]}}, ValueError, r"parameter m has the shape \(1, 2\)"),
        ({"parameters": {"m": [1, 2, 3], "c": [1, 2]}}, ValueError, "runs that do not agree: 2, 3"),
    ],
)
def test_bad_arguments_are_named(oscillator, arguments, error, message):
    with pytest.raises(error, match=message):
        Batch(oscillator).run(arguments.pop("u", np.zeros((5, 1))), **arguments)
