# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""More of `make campaign-train`: a damping beside a network, and promises by exact arithmetic."""

from __future__ import annotations

import argparse
import sys
import tempfile
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import generator
import numpy as np

import penode_gen
from penode_gen import promises
from penode_gen.model import Promises
from penode_gen.networks import Affine, Dense, Network
from penode_gen.untrained import untrained
from penode_sil.measured import load
from penode_sil.training import curve, promised, threads, unfold
from penode_sil.training.settings import SETTINGS
from penode_sil.training.solve import least
from penode_sil.training.story import Options, train

HERE = Path(__file__).parent
GIVEN = (
    Promises(increasing=True, dissipative=0.0, max_slope=4000.0, zero_at_zero=True),
    Promises(decreasing=True, max_slope=2500.0),
    Promises(dissipative=0.5, max_slope=8000.0),
    Promises(increasing=True, dissipative=1.0, zero_at_zero=True),
)


def damping(made: generator.Made, noise: float, folder: Path) -> tuple[float, float, float]:
    """Value and standard deviation of the damping of damping.toml after training, and the least-squares one of the plant's whole force."""
    model = penode_gen.load(HERE / "damping.toml")
    model = replace(model, sensors=tuple(replace(s, noise=s.noise * noise) for s in model.sensors))
    data = load([made.write(folder / "damping.csv")], model)
    with threads.one():
        _, t = train(model, data, [], Options((("m_b", None),)), lambda share, doing: None)
    v = made.speed
    value, sigma, *_ = t.parameters["d"]
    return value, sigma, generator.PLAIN["d"] + float(generator.Truth().force(1, v, v) @ v / (v @ v))


def kept(given: Promises, random: np.random.Generator, layers: list[int]) -> tuple[bool, bool, bool]:
    """A random curve, and what training's limits make of it: does each break a promise, by exact arithmetic on its network's pieces? And does
    training refuse it, as it does where no margin is enough?"""
    network = untrained({"layers": layers}, 1, "net")
    count = unfold.capacity(network)
    knots = np.sort(np.concatenate([random.uniform(-1.0, 1.0, count - 1), [0.0]]))
    zero = int(np.flatnonzero(knots == 0.0)[0])
    values = np.where(knots == 0.0, 0.0, random.normal(0.0, 10.0 ** random.uniform(0.0, 3.0), count))
    wild = curve.Curve(knots, values, zero)
    before = bool(promises.broken(given, unfold.unfold(wild, network, -1.0, 1.0), False))
    for n in range(SETTINGS.story_tries):  # as training does
        limits = promised.bound(given, SETTINGS.promised_first * SETTINGS.story_tighter**n)(wild)
        try:
            found = wild.with_theta(wild.theta + least(np.eye(wild.columns), np.zeros(wild.columns), limits, wild.theta))
        except RuntimeError:
            return before, False, True
        if not promises.broken(given, unfold.unfold(found, network, -1.0, 1.0), False):
            return before, independent(given, unfold.unfold(found, network, -1.0, 1.0)), False
    return before, False, True


def independent(given: Promises, network: Network) -> bool:
    """Is a promise broken? In rational numbers, layer by layer, at each kink of the network in float and beyond: no code of training's."""
    layers = [([[Fraction(float(np.float32(w))) for w in row] for row in layer.weights], [Fraction(float(np.float32(b))) for b in layer.bias]) for layer in network.layers if isinstance(layer, Dense)]
    scale = [Fraction(float(np.float32(layer.factor[0]))) for layer in network.layers if isinstance(layer, Affine)]
    assert len(scale) in (0, 2) and all(layer.shift[0] == 0.0 for layer in network.layers if isinstance(layer, Affine))
    into, out = scale if scale else (Fraction(1), Fraction(1))

    def value(x: Fraction) -> Fraction:
        h = [x * into]
        for n, (weights, bias) in enumerate(layers):
            h = [sum((w * v for w, v in zip(row, h)), b) for row, b in zip(weights, bias)]
            h = h if n == len(layers) - 1 else [max(v, Fraction(0)) for v in h]
        return h[0] * out

    kinks = kinks_of(layers, into)
    places = sorted({kinks[0] - 1, *kinks, kinks[-1] + 1, Fraction(0)})
    values = [value(x) for x in places]
    slopes = [(b - a) / (y - x) for x, y, a, b in zip(places, places[1:], values, values[1:])]
    wrong = given.increasing and min(slopes) < 0 or given.decreasing and max(slopes) > 0
    wrong |= given.max_slope is not None and max(map(abs, slopes)) > Fraction(given.max_slope)
    wrong |= given.zero_at_zero and value(Fraction(0)) != 0
    if given.dissipative is not None:
        wrong |= any((v if x > 0 else -v) < -Fraction(given.dissipative) for x, v in zip(places, values) if x != 0)
        wrong |= min(slopes[0], slopes[-1]) < 0
    return bool(wrong)


def kinks_of(layers: list[tuple[list[list[Fraction]], list[Fraction]]], into: Fraction) -> list[Fraction]:
    """Places at which a unit turns, from the first layer on: a unit of a later layer is straight between those of the layers before."""
    def units(x: Fraction, depth: int) -> list[Fraction]:
        h = [x * into]
        for n, (weights, bias) in enumerate(layers[:depth]):
            h = [sum((w * v for w, v in zip(row, h)), b) for row, b in zip(weights, bias)]
            h = h if n == depth - 1 else [max(v, Fraction(0)) for v in h]
        return h

    found: list[Fraction] = [Fraction(0)]
    for depth in range(1, len(layers)):
        ends = [found[0] - 4, *found, found[-1] + 4]
        more = set(found)
        for a, b in zip(ends, ends[1:]):
            for u, v in zip(units(a, depth), units(b, depth)):
                at = a - u * (b - a) / (v - u) if u != v else a
                beyond = (a == ends[0] and at < a) or (b == ends[-1] and at > b)
                if u != v and (a <= at <= b or beyond):
                    more.add(at)
        found = sorted(more)
    return found


def main() -> None:
    """Rows for the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--curves", type=int, default=10_000)
    parser.add_argument("--page", type=Path, help="append to this page")
    given = parser.parse_args()
    lines = ["", "| beside the table | figure |", "|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        for noise in (1.0, 5.0) if given.seeds else ():
            rows = [damping(generator.make(generator.Truth(), seed, noise), noise, Path(folder)) for seed in range(1, given.seeds + 1)]
            held = sum(abs(v - t) < 2.0 * s for v, s, t in rows)
            lines.append(f"| damping beside a network, x{noise:g}: 2 sigma hold the truth | {held} of {len(rows)}, sigma {np.mean([s for _, s, _ in rows]):.2f} of {rows[0][2]:.0f} N s/m |")
            print(lines[-1], flush=True)
    random = np.random.default_rng(1)
    found = [kept(GIVEN[k % len(GIVEN)], random, [12, 12]) for k in range(given.curves)]
    before, after, refused = (sum(values) for values in zip(*found))
    lines.append(f"| random curves made to keep promises: broken before, after, refused | {before}, {after} and {refused} of {len(found)} |")
    print(lines[-1])
    if given.page:
        given.page.write_text(given.page.read_text(encoding="utf-8") + "\n".join(lines) + "\n", encoding="utf-8")
    sys.exit(after > 0)


if __name__ == "__main__":
    main()
