# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Folded networks: the same function as their layers within a derived bound, everywhere; and what a model file may say."""

from __future__ import annotations

import ctypes
import itertools
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from numpy.typing import NDArray

import penode_gen
from penode_gen.networks import Affine, Dense, Network
from penode_gen.reading.network_files import read_network
from penode_gen.sets import fold
from penode_sil.status import BIT
from penode_sil.targets import Sil

NETWORKS = Path(__file__).resolve().parents[2] / "gen" / "nqvm" / "networks"
PUBLISHED = Path(__file__).resolve().parents[3] / "shared" / "nqvm-published"
FILES = [*sorted(NETWORKS.glob("*.onnx")), PUBLISHED / "spring.json", PUBLISHED / "damper.json"]
OUTSIDE = 0x10
PIECE = np.dtype([("start", "f4"), ("offset", "f4"), ("slope", "f4"), ("status", "u4")])
U = 2.0**-24  # rounding error of one operation in float, relative to its result

MODEL = """
[model]
name = "line"
sample_time = "1 ms"
input = "held"
{more}
[inputs]
x = {{ unit = "1" }}
[networks]
net = {{ inputs = ["1"], output = "1" }}
[variables]
y = {{ unit = "1" }}
[equations]
only = "y = net(x)"
[outputs]
y = {{ value = "y", unit = "1" }}
[sets.default]
net = "net.json"
{sets}
"""


def write(folder: Path, network: Network, name: str = "net") -> None:
    """A network in the JSON form."""
    layers, dense = list(network.layers), [la for la in network.layers if isinstance(la, Dense)]
    data = {"layers": [{"activation": la.activation, "weights": la.weights.tolist(), "bias": la.bias.tolist()} for la in dense]}
    if isinstance(layers[0], Affine):
        data["normalise"] = {"kind": "min-max", "min": layers[0].shift.tolist(), "max": (layers[0].shift + 1.0 / layers[0].factor).tolist()}
    if isinstance(layers[-1], Affine):
        data["denormalise"] = {"kind": "min-max", "min": layers[-1].shift.tolist(), "max": (layers[-1].shift + layers[-1].factor).tolist()}
    if network.input_min is not None:
        data["trained_range"] = {"min": network.input_min.tolist(), "max": network.input_max.tolist()}
    (folder / f"{name}.json").write_text(json.dumps(data))


def model(folder: Path, network: Network, more: str = "", others: Mapping[str, Network] = MappingProxyType({})) -> penode_gen.Model:
    """A model whose output is the network; `more` goes into [model], `others` are further sets."""
    write(folder, network)
    for name, other in others.items():
        write(folder, other, name)
    path = folder / f"line{abs(hash(more))}.toml"
    path.write_text(MODEL.format(more=more, sets="\n".join(f'[sets.{name}]\nnet = "{name}.json"' for name in others)))
    return penode_gen.load(path)


def pieces_of(sil: Sil, capacity: int) -> NDArray[np.void]:
    """The piece table of a fresh instance: it lies at the end of the instance."""
    table = sil.instance().memory[-2 * capacity * PIECE.itemsize :].view(PIECE)
    return table[:capacity].copy()


def in_float(network: Network) -> Network:
    """The network whose float64 parameters are those that the C holds in float."""

    def layer(la):
        names = ("weights", "bias") if isinstance(la, Dense) else ("shift", "factor")
        return replace(la, **{n: getattr(la, n).astype(np.float32).astype(float) for n in names})

    return replace(network, layers=tuple(layer(la) for la in network.layers))


def layers_bound(network: Network, x: NDArray) -> NDArray:
    """
    How far float, layer by layer, may be from the exact value at x [n].

    Each operation errs by at most U of its result, a sum of n products by (n + 1) U of the sum of their sizes; errors of
    the layer before pass through the weights. A ReLU passes errors on and adds none: 0.5 (x + |x|) is exact.
    """
    h, e = x[:, None], np.zeros((x.size, 1))
    for layer in network.layers:
        size = _size(layer, h)
        if isinstance(layer, Affine):
            h, e = _affine(layer, h), np.abs(layer.factor) * e + 2 * U * size
        else:
            h, e = h @ layer.weights.T + layer.bias, e @ np.abs(layer.weights).T + (layer.n_in + 1) * U * size
            h = np.maximum(h, 0.0) if layer.activation == "relu" else h
    return e[:, 0]


def piece_bound(network: Network, x: NDArray, seen: NDArray, middle: NDArray) -> NDArray:
    """
    How far a piece may be from the exact value at x [n]: it was seen from the point `seen`, and holds around `middle`.

    Value and derivative are computed at `seen` along the pattern of the piece, with rounding errors as above, and are
    followed along a straight line to x: so the derivative's errors count |x - seen| times. The pattern may be wrong for a
    neuron near zero: by its error as seen from here and as seen from the piece before, and because the piece's end was
    rounded: twice its error, and its slope times U of the places. In the end the line itself is evaluated: 4 roundings.
    """
    h, t, e, m = seen[:, None], np.ones((x.size, 1)), np.zeros((x.size, 1)), middle[:, None]
    away, reach = np.abs(x - seen)[:, None], (np.abs(x) + np.abs(seen) + np.abs(middle))[:, None]
    for layer in network.layers:
        size = _size(layer, h)
        if isinstance(layer, Affine):
            h, m, t = _affine(layer, h), _affine(layer, m), t * layer.factor
            e = np.abs(layer.factor) * e + 2 * U * (size + np.abs(t) * away)
            continue
        W, roundings = np.abs(layer.weights).T, (layer.n_in + 1) * U
        e = e @ W + roundings * (size + (np.abs(t) @ W) * away)
        h, m, t = h @ layer.weights.T + layer.bias, m @ layer.weights.T + layer.bias, t @ layer.weights.T
        if layer.activation == "relu":
            e = 2 * e + 2 * U * np.abs(t) * reach
            h, m, t = np.where(m > 0, h, 0.0), np.maximum(m, 0.0), np.where(m > 0, t, 0.0)
    return (e + 4 * U * (np.abs(h) + np.abs(t) * reach))[:, 0]


def _affine(layer: Affine, h: NDArray) -> NDArray:
    return (h - layer.shift) * layer.factor if layer.form == "centre" else h * layer.factor + layer.shift


def _size(layer: Affine | Dense, h: NDArray) -> NDArray:
    """The sum of the magnitudes of the terms of a layer."""
    if isinstance(layer, Dense):
        return np.abs(h) @ np.abs(layer.weights).T + np.abs(layer.bias)
    factor, shift = np.abs(layer.factor), np.abs(layer.shift)
    return np.abs(h - layer.shift) * factor if layer.form == "centre" else np.abs(h) * factor + shift


def compare(network: Network, folder: Path, show, capacity: int = 96, clamp: bool = False) -> None:
    """The folded network against its layers in C and in float64, at all ends of pieces, next to them, and in between."""
    outside = '\noutside = "clamp"' if clamp else ""
    made = model(folder, network, f"pieces = {capacity}{outside}")
    network, folded = replace(made.sets["default"].networks["net"], source=network.source), Sil(made)
    layered = Sil(model(folder, network, outside))
    table = pieces_of(folded, capacity)
    centre, ends = float(table["start"][0]), np.unique(table["start"][1:]).astype(float)
    span = np.ptp(ends) + np.abs(ends).max() + 1.0
    near = np.concatenate([ends, *(np.nextafter(ends.astype(np.float32), np.float32(way)) for way in (-np.inf, np.inf))])
    wide = np.concatenate([np.linspace(ends[0] - span, ends[-1] + span, 4001), np.linspace(ends[0], ends[-1], 4001)])
    inner = np.random.default_rng(1).uniform(ends[:-1], ends[1:], (20, ends.size - 1)).ravel()
    x = np.concatenate([near, wide, inner, [0.0, -0.0, 1e-45, centre]]).astype(np.float32).astype(float)
    run, rival = folded.run(x[:, None]), layered.run(x[:, None])
    assert np.array_equal(run.status, rival.status)  # the trust envelope, to the last float

    left = np.append(-np.inf, ends)
    at = np.searchsorted(ends, x, side="right")
    low, high = left[at], np.append(ends, np.inf)[at]
    seen = np.where(low >= centre, low, high)
    middle = np.where(np.isinf(low), ends[0] - span, np.where(np.isinf(high), ends[-1] + span, 0.5 * (low + high)))
    exact = in_float(network)
    if clamp:
        range_ = network.input_min.astype(np.float32).astype(float), network.input_max.astype(np.float32).astype(float)
        x, seen, middle = np.clip(x, *range_), np.clip(seen, *range_), np.clip(middle, *range_)
    value = exact.evaluate(x[:, None])[:, 0]
    piece, layers = piece_bound(exact, x, seen, middle), layers_bound(exact, x)
    by_pieces, by_layers = np.abs(run.y[:, 0] - value), np.abs(rival.y[:, 0] - value)
    show(
        f"{network.source}: {np.unique(table).size} pieces; error {by_pieces.max():.1e}, by layers {by_layers.max():.1e}; "
        f"at most {(by_pieces / piece).max():.0%} of the bound"
    )
    assert np.all(by_pieces <= piece)
    assert np.all(np.abs(run.y[:, 0] - rival.y[:, 0]) <= piece + layers)
    # bounds are for the worst case; in fact a piece errs like the layers do, once where it was seen and once on its way
    assert by_pieces.max() <= 2.0 * by_layers.max()


@pytest.mark.parametrize("clamp", [False, True], ids=["extrapolate", "clamp"])
@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_networks_of_the_project_and_the_published_ones(tmp_path, path, clamp, show):
    if not path.exists():
        pytest.skip(f"{path} is not there")
    network = read_network(path)
    if network.input_min is None and clamp:
        pytest.skip("it has no trained range to be clamped to")
    compare(replace(network, source=path.name), tmp_path, show, clamp=clamp)


@pytest.mark.parametrize("seed", range(12))
def test_random_networks(tmp_path, seed, show):
    """Any depth and width, scaled or not, weights of very different sizes, dead neurons and twins."""
    draw = np.random.default_rng(seed)
    sizes = [1, *draw.integers(1, 24, draw.integers(1, 4)), 1]
    layers: list[Affine | Dense] = []
    for m, n in itertools.pairwise(sizes):
        weights = draw.standard_normal((n, m)) * 10.0 ** draw.uniform(-1.5, 0.5, (n, 1))
        bias = draw.standard_normal(n)
        if n > 2 and seed % 3 == 0:
            weights[1], bias[1] = weights[0], bias[0]  # twins switch at the same place
            weights[2] = 0.0  # dead
        layers.append(Dense(weights, bias, "relu" if len(layers) < len(sizes) - 2 else "identity"))
    low, high = np.sort(draw.uniform(-3.0, 3.0, 2))
    given = seed % 2 == 0
    network = Network(tuple(layers), np.array([low]) if given else None, np.array([high]) if given else None, f"seed {seed}")
    compare(network, tmp_path, show, capacity=256, clamp=given and seed % 4 == 0)


def test_more_room_than_there_may_be(tmp_path):
    with pytest.raises(penode_gen.ModelError, match="99999 is out of range; give room for 4 to 4096 pieces"):
        model(tmp_path, read_network(FILES[0]), "pieces = 99999")


def test_counting_pieces_beforehand(tmp_path):
    """The generator's count, in float64, is what the target finds (kinks closer than a float are one there)."""
    for path in FILES[:3]:
        network = read_network(path)
        for clamp in (False, True):
            outside = 'outside = "clamp"' if clamp else ""
            table = pieces_of(Sil(model(tmp_path, network, f"pieces = 128\n{outside}")), 128)
            assert fold.pieces(network, clamp) == np.unique(table).size


def test_the_slope_is_that_of_the_layers(tmp_path):
    """Exact derivatives: those of the exact network inside every piece, to the rounding of some 50 terms."""
    network = read_network(FILES[2])
    table = pieces_of(Sil(model(tmp_path, network, "pieces = 96")), 96)
    ends = table["start"][1:].astype(float)
    wide = np.flatnonzero(np.diff(ends) > 1e-4)
    middle = 0.5 * (ends[wide] + ends[wide + 1])
    slope = in_float(network).jacobian(middle[:, None])[:, 0, 0]
    np.testing.assert_allclose(table["slope"][wide + 1], slope, rtol=0, atol=50 * U * np.abs(slope).max())


ZIGZAG = Network(
    (Dense(np.ones((40, 1)), -np.linspace(-1.0, 1.0, 40), "relu"), Dense((-1.0) ** np.arange(40)[None, :], np.zeros(1), "identity")),
    np.array([-1.0]),
    np.array([1.0]),
    "zigzag",
)
PLAIN = Network(
    (Dense(np.ones((40, 1)), np.full(40, 9.0), "relu"), Dense(np.ones((1, 40)), np.zeros(1), "identity")),
    np.array([-1.0]),
    np.array([1.0]),
    "plain",
)


def test_too_many_pieces_are_refused_and_the_running_set_stays(tmp_path):
    with pytest.raises(penode_gen.ModelError, match="has 44 straight pieces; give room for 44 or more"):
        model(tmp_path, PLAIN, "pieces = 24", {"rough": ZIGZAG})
    made = model(tmp_path, PLAIN, "pieces = 48", {"rough": ZIGZAG})
    sil = Sil(replace(made, pieces=24))
    instance = sil.instance()
    before = instance.step([0.5])[1][0]
    assert sil.function("tune_select")(instance._self, ctypes.byref(sil.flash_set("rough"))) == 0x80000
    _, after, status = instance.step([0.5])
    assert status == 0 and after[0] == before
    with pytest.raises(AssertionError, match="0x80000"):
        sil.instance("rough")  # init refuses it as well


def test_too_many_pieces_run_layer_by_layer_where_the_model_says_so(tmp_path):
    """To the bit as a model that was never folded, while a set that fits is folded; and both are swapped."""
    made = Sil(model(tmp_path, PLAIN, 'pieces = 24\nmore_pieces = "layers"', {"rough": ZIGZAG}))
    layered = Sil(model(tmp_path, PLAIN, "", {"rough": ZIGZAG}))
    x = np.linspace(-1.5, 1.5, 301)[:, None]
    for first, second in (("rough", "default"), ("default", "rough")):
        instance, rival = made.instance(first), layered.instance(first)
        for name in (first, second):
            if name == second:
                instance.memory[-24 * PIECE.itemsize :] = 255  # whatever was in the pieces of the next set: NaN, that none looks at
                assert made.function("tune_select")(instance._self, ctypes.byref(made.flash_set(name))) == 0
                assert layered.function("tune_select")(rival._self, ctypes.byref(layered.flash_set(name))) == 0
            steps = [(instance.step(u)[1:], rival.step(u)[1:]) for u in x]
            same = all(a[0][0] == b[0][0] for a, b in steps)
            assert same if name == "rough" else not same
            assert all(a[1] == b[1] for a, b in steps)
            assert max(abs(a[0][0] - b[0][0]) for a, b in steps) <= layers_bound(in_float(PLAIN), np.array([1.5]))[0] * 2


@pytest.mark.parametrize("capacity, more", [(48, "refuse"), (48, "layers"), (192, "layers")])
def test_damage_in_any_piece_or_value_is_found_within_a_round(tmp_path, capacity, more):
    """In a table with less room than the 123 values of the set, and with more; where no step reads the values, in the table only."""
    made = model(tmp_path, PLAIN, f'pieces = {capacity}\nmore_pieces = "{more}"')
    instance, values = Sil(made).instance(), penode_gen.set_values(made, "default")
    assert instance.begin(penode_gen.set_head(made, "default")) == instance.write(0, values) == instance.commit() == 0
    instance.step([0.5])
    bank = next(bank for bank in instance.banks if np.array_equal(bank, values))
    table = instance.memory[-capacity * PIECE.itemsize :].view(PIECE)  # of the second slot
    steps = capacity if more == "refuse" else max(bank.size, capacity)
    assert [instance.step([0.5])[2] for _ in range(2 * steps)] == 2 * steps * [0]
    for numbers in (*([bank] if more == "layers" else []), table["start"], table["offset"], table["slope"]):
        for i, bad in zip(range(numbers.size), itertools.cycle((np.nan, np.inf, -np.inf))):
            good, numbers[i] = numbers[i], bad
            assert any(instance.step([0.5])[2] & BIT["weight_nonfinite"] for _ in range(steps))
            numbers[i] = good


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ('pieces = 96\noutside = "fade"', "a network that fades is not piecewise linear"),
        ("pieces = 3", "3 is out of range; give room for 4 to 4096 pieces"),
        ("pieces = 5000", "5000 is out of range"),
        ('pieces = 96\nmore_pieces = "layer"', "'layer' is unknown; choose one of refuse, layers"),
    ],
)
def test_what_cannot_be(tmp_path, more, message):
    with pytest.raises(penode_gen.ModelError, match=message):
        model(tmp_path, PLAIN, more)


def test_only_networks_that_are_straight(tmp_path):
    smooth = Network((Dense(np.ones((3, 1)), np.zeros(3), "tanh"), Dense(np.ones((1, 3)), np.zeros(1), "identity")), None, None, "smooth")
    with pytest.raises(penode_gen.ModelError, match="no network has one input and only ReLU activations; leave pieces out"):
        model(tmp_path, smooth, "pieces = 96")


def test_room_is_what_the_look_up_can_halve():
    assert [fold.room(n) for n in (0, 4, 5, 7, 9, 13, 49, 64, 65, 96, 97, 4096)] == [0, 4, 6, 8, 12, 16, 64, 64, 96, 96, 128, 4096]


def test_the_table_is_padded_with_its_last_piece(tmp_path):
    """So the look-up may run to the end: +Inf and NaN land there, and come out as what they are."""
    sil = Sil(model(tmp_path, PLAIN, "pieces = 96"))
    table = pieces_of(sil, 96)
    used = np.unique(table[1:]).size + 1
    assert used < 96 and np.all(table[used:] == table[used - 1])
    for bad in (np.nan, np.inf, -np.inf):
        assert sil.instance().step([bad])[2] & 0x1
