# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Promises of networks: what a model file may say, what the generator finds in its sets, and a sample of `make prove-promise`."""

from __future__ import annotations

import subprocess
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import promise_check
import promise_nets
import promise_reference as reference
import pytest

import penode_gen
from penode_gen.model import NetworkPort, Promises
from penode_gen.networks import Affine, Dense, Network
from penode_gen.sets import exact, promises

PROVE = Path(promise_check.__file__).parent

MODEL = """
[model]
name = "line"
sample_time = "1 ms"
input = "held"
outside = "{outside}"
[inputs]
v = {{ unit = "m/s" }}
[networks]
net = {{ inputs = ["m/s"], output = "N", {says} }}
[variables]
F = {{ unit = "N" }}
[equations]
only = "F = net(v)"
[outputs]
F = {{ value = "F", unit = "N" }}
[sets.default]
net = "net.json"
[sets.other]
net = "other.json"
"""


def bow(a: float, b: float, c: float = 0.0, activation: str = "relu") -> str:
    """max(0, v) a + max(0, -v) b + c on -2 to 2."""
    layers = [
        {"activation": activation, "weights": [[1.0], [-1.0]], "bias": [0.0, 0.0]},
        {"activation": "identity", "weights": [[a, b]], "bias": [c]},
    ]
    return str({"layers": layers, "trained_range": {"min": [-2.0], "max": [2.0]}}).replace("'", '"')


def load(folder: Path, says: str, net: str = bow(3.0, -2.0), other: str = bow(3.0, -2.0), outside: str = "extrapolate") -> penode_gen.Model:
    (folder / "net.json").write_text(net)
    (folder / "other.json").write_text(other)
    (folder / "line.toml").write_text(MODEL.format(says=says, outside=outside))
    return penode_gen.load(folder / "line.toml")


def test_what_is_promised_is_read_in_si_and_printed(tmp_path):
    model = load(
        tmp_path, 'monotone = true, dissipative = true, max_slope = "4 N*s/mm", max_force = "9 N", zero_at_zero = true', outside="clamp"
    )
    port = model.networks["net"]
    assert port.promises == Promises(increasing=True, dissipative=0.0, max_slope=4000.0, max_force=9.0, zero_at_zero=True)
    kinds = "INCREASING DISSIPATIVE MAX_SLOPE MAX_FORCE ZERO_AT_ZERO".split()
    assert promises.initialiser(port, 2) == "{ " + " | ".join(f"PEN_PROMISE_{kind}" for kind in kinds) + ", 96U, 0.0F, 4000.0F, 9.0F }"
    assert load(tmp_path, 'monotone = "increasing", dissipative = "0.1 N"').networks["net"].promises == Promises(
        increasing=True, dissipative=0.1
    )
    assert not load(tmp_path, "monotone = false, dissipative = false, zero_at_zero = false").networks["net"].promises


def test_a_limit_is_not_rounded_up():
    text = promises.initialiser(NetworkPort("net", ("m/s",), "N", promises=Promises(max_force=0.1, max_slope=0.3)), 0)
    force, slope = (np.float32(text.split(", ")[k].rstrip("F }")) for k in (4, 3))
    assert force < 0.1 and slope < 0.3 and float(np.nextafter(force, np.float32(1))) > 0.1


@pytest.mark.parametrize(
    ("says", "message"),
    [
        ('monotone = "up"', "networks.net.monotone: 'up' is not a direction; write true"),
        ("monotone = 1", "monotone: 1 has the wrong type; give true, false or a text"),
        ("zero_at_zero = 0", "zero_at_zero: 0 has the wrong type; give true or false"),
        ('max_slope = "4 N"', "max_slope: '4 N' is not measured in kg*s^-1; give a quantity in N / m/s"),
        ('max_force = "4 m"', "max_force: '4 m' is not measured in"),
        ('max_force = "-4 N"', "max_force: '-4 N' is not a limit; give 0, or"),
        ('dissipative = "2 m"', "dissipative: '2 m' is not measured in"),
        ('max_force = "much"', "max_force: 'much' is not a number with a unit"),
    ],
)
def test_what_cannot_be_promised(tmp_path, says, message):
    with pytest.raises(penode_gen.ModelError) as caught:
        load(tmp_path, says)
    assert message in str(caught.value) and "line.toml:10: " in str(caught.value)


def test_networks_of_which_nothing_can_be_proven(tmp_path):
    with pytest.raises(penode_gen.ModelError, match="for networks of one input with ReLU activations only; remove them"):
        load(tmp_path, "monotone = true", bow(3.0, -2.0, activation="tanh"), bow(3.0, -2.0, activation="tanh"))
    with pytest.raises(
        penode_gen.ModelError, match="a network that fades is not piecewise linear: its promises cannot be proven; choose outside"
    ):
        load(tmp_path, "monotone = true", outside="fade")


@pytest.mark.parametrize(
    ("says", "net", "outside", "message"),
    [
        ("monotone = true", bow(3.0, 2.0), "extrapolate", "breaks its promise monotone at 0"),
        ('monotone = "decreasing"', bow(-3.0, -2.0), "clamp", "breaks its promise monotone at -1"),
        ('max_slope = "2.9 N*s/m"', bow(3.0, -2.0), "clamp", "breaks its promise max_slope at 1"),
        ('max_slope = "3 N*s/m"', bow(3.0, -2.0), "clamp", "keeps its promise max_slope at 1 by less than the margin"),
        ('max_force = "5.9 N"', bow(3.0, -2.0), "clamp", "breaks its promise max_force at 2"),
        ('max_force = "9 N"', bow(3.0, -2.0), "extrapolate", "breaks its promise max_force at 0"),
        ("dissipative = true", bow(3.0, -2.0, 1e-9), "clamp", "breaks its promise dissipative at 0"),
        ('dissipative = "1 N"', bow(-1.0, -2.0), "clamp", "breaks its promise dissipative at"),
        ("zero_at_zero = true", bow(3.0, -2.0, 1e-9), "clamp", "breaks its promise zero_at_zero: 1e-09 is computed at 0"),
    ],
)
def test_a_set_that_breaks_a_promise_is_named(tmp_path, says, net, outside, message):
    with pytest.raises(penode_gen.ModelError) as caught:
        load(
            tmp_path,
            says,
            other=net,
            net=net if "decreasing" in says else bow(0.5, -0.5, 0.0) if outside == "clamp" else bow(3.0, -2.0),
            outside=outside,
        )
    assert f"sets.other.net: {message}" in str(caught.value) and "train the network to keep its promises" in str(caught.value)


def test_pieces_are_the_exact_ones():
    """Against the reference of the proof, which takes all kinks of a layer at once."""
    draw, checked = np.random.default_rng(1), 0
    while checked < 150:
        net = promise_nets.net(draw)
        if net.real is not np.float32 or net.clamp:
            continue
        checked += 1
        layers = [
            Affine(la.weights[0], la.bias, "centre")
            if la.kind == "centre"
            else Affine(la.bias, la.weights[0], "rescale")
            if la.kind == "rescale"
            else Dense(la.weights, la.bias, "relu" if la.kind == "relu" else "identity")
            for la in net.layers
        ]
        line = reference.Line(net)
        found = list(exact.pieces(Network(tuple(layers), None, None, "random")))
        assert found[0].start is None and found[-1].end is None
        assert (found[0].slope, found[-1].slope) == (line.slopes[0], line.slopes[-1])
        places = sorted({Fraction(0), *line.places, *(p.start for p in found[1:])})
        for x in [*places, places[0] - 1, places[-1] + 1]:
            here = next(p for p in found if (p.start is None or p.start <= x) and (p.end is None or x <= p.end))
            at = min(max(x, line.places[0]), line.places[-1])
            i = max(k for k, place in enumerate(line.places) if place <= at)
            slope = line.slopes[0] if x < line.places[0] else line.slopes[i + 1]
            assert here.at(x) == line.values[i] + slope * (x - line.places[i])


def test_a_sample_of_the_proof(capfd):
    """Some 3000 sets that break a promise, 300 that keep one; the faults in the C are a matter of `make prove-promise`."""
    assert (
        subprocess.run(
            [sys.executable, PROVE / "promise_check.py", "--bad", "3000", "--good", "300", "--jobs", "1", "--as", "none", "--no-faults"]
        ).returncode
        == 0
    )
    assert promise_check.FAULTS
