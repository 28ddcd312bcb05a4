# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`make campaign-promises`: do trained and random networks keep what the model file promises of them? By exact arithmetic.

Random curves are brought within the limits that training puts on them; trained curves are what training made of a second of a plant whose
forces break the promises. Both are written down as networks, whose numbers in float are taken as rational ones: their pieces are found
layer by layer, and each piece and each kink is judged without rounding. The judge shares no code with what trains or certifies. It must
also find faults that are put into the limits.
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import generator
import kept as parts
import numpy as np

import penode_gen
from penode_gen.model import Model, Promises
from penode_gen.networks import Affine, Dense, Network
from penode_gen.reading.untrained import untrained
from penode_gen.sets import promises
from penode_sil.errors import UserError
from penode_sil.recordings.measured import load
from penode_sil.training import curve, curves, data, judge, promised, story, threads, unfold
from penode_sil.training.engine import Engine
from penode_sil.training.problem import Problem
from penode_sil.training.settings import SETTINGS
from penode_sil.training.solve import Limits, least

HERE = Path(__file__).parent
Bound = Callable[[Promises, float, float], Callable[[curve.Curve], Limits]]
GIVEN = (
    Promises(increasing=True, dissipative=0.0, max_slope=4000.0, zero_at_zero=True),
    Promises(decreasing=True, max_slope=2500.0),
    Promises(dissipative=0.5, max_slope=8000.0),
    Promises(increasing=True, dissipative=1.0, zero_at_zero=True),
)
PLANTS = (generator.Truth(), generator.STOPS, generator.Truth(spring_by=(-500.0, 0.05, 0.0, 0.0), damper_by=(90.0, 20.0, 0.05, -40.0)))
CHUNK, FEW = 200, 25  # random curves, and trainings, of a part
WINDOW = 500  # samples of a recording that a curve is trained on


# -- the judge


@dataclass(frozen=True)
class Exact:
    """A network of one input in whole numbers, all over 2^shift: of each layer the weights that are not 0 with their columns, and biases;
    scalings at the ends are layers of one weight. `relu`: of which layers."""

    layers: tuple[tuple[tuple[tuple[tuple[int, int], ...], ...], tuple[int, ...]], ...]
    relu: tuple[bool, ...]
    shift: int

    def units(self, x: Fraction, depth: int) -> tuple[list[int], int]:
        """What goes into the units of the `depth`-th layer, from 1: numerators, and the denominator of all."""
        h, over = [x.numerator], x.denominator
        for n, (rows, bias) in enumerate(self.layers[:depth]):
            h = [max(v, 0) for v in h] if n and self.relu[n - 1] else h
            h = [sum((w * h[j] for j, w in row), b * over) for row, b in zip(rows, bias, strict=True)]
            over <<= self.shift
        return h, over

    def value(self, x: Fraction) -> Fraction:
        """Value of the network."""
        (found,), over = self.units(x, len(self.layers))
        return Fraction(found, over)


def exact(network: Network) -> Exact:
    """The numbers that the controller has: those of float."""
    layers, relu = [], []
    for layer in network.layers:
        if isinstance(layer, Affine):
            assert layer.shift[0] == 0.0
            weights, bias = np.float32(layer.factor).reshape(1, 1), np.zeros(1, np.float32)
        else:
            weights, bias = np.float32(layer.weights), np.float32(layer.bias)
        relu.append(isinstance(layer, Dense) and layer.activation == "relu")
        layers.append(([[(j, Fraction(float(w))) for j, w in enumerate(row) if w] for row in weights], [Fraction(float(b)) for b in bias]))
    over = max(v.denominator for rows, bias in layers for v in (*bias, *(w for row in rows for _, w in row)))  # a power of two: so are all
    whole = [
        (tuple(tuple((j, int(w * over)) for j, w in row) for row in rows), tuple(int(b * over) for b in bias)) for rows, bias in layers
    ]
    return Exact(tuple(whole), tuple(relu), over.bit_length() - 1)


def kinks_of(net: Exact) -> list[Fraction]:
    """Places at which a unit turns, from the first layer on: a unit of a later layer is straight between those of the layers before."""
    found: list[Fraction] = [Fraction(0)]
    for depth in (n + 1 for n, turns in enumerate(net.relu) if turns):
        ends = [found[0] - 4, *found, found[-1] + 4]
        values = [net.units(x, depth) for x in ends]
        more = set(found)
        for (a, b), ((left, under), (right, over)) in zip(itertools.pairwise(ends), itertools.pairwise(values), strict=True):
            for u, v in zip(left, right, strict=True):
                u, v = u * over, v * under  # over the same denominator
                if u == v or ((u > 0) == (v > 0) and u and v and a != ends[0] and b != ends[-1]):
                    continue
                at = a - (b - a) * Fraction(u, v - u)
                if a <= at <= b or (a == ends[0] and at < a) or (b == ends[-1] and at > b):
                    more.add(at)
        found = sorted(more)
    return found


def breaks(given: Promises, network: Network) -> bool:
    """Is a promise broken, by the exact slope of a piece, beyond the outermost kinks too, or the exact value at a kink?"""
    net = exact(network)
    kinks = kinks_of(net)
    places = [kinks[0] - 1, *kinks, kinks[-1] + 1]
    values = [net.value(x) for x in places]
    slopes = [(b - a) / (y - x) for (x, y), (a, b) in zip(itertools.pairwise(places), itertools.pairwise(values), strict=True)]
    wrong = (given.increasing and min(slopes) < 0) or (given.decreasing and max(slopes) > 0)
    wrong |= given.max_slope is not None and max(map(abs, slopes)) > Fraction(given.max_slope)
    wrong |= given.zero_at_zero and net.value(Fraction(0)) != 0
    if given.dissipative is not None:
        wrong |= any((v if x > 0 else -v) < -Fraction(given.dissipative) for x, v in zip(places, values, strict=True) if x != 0)
        wrong |= min(slopes[0], slopes[-1]) < 0
    return bool(wrong)


# -- random curves


def kept(given: Promises, random: np.random.Generator, layers: list[int], bound: Bound = promised.bound) -> tuple[bool, bool, bool]:
    """A random curve, and what training's limits make of it: does each break a promise? And does training refuse it, as it does where no
    margin is enough?"""
    network = untrained({"layers": layers}, 1, "net")
    count = unfold.capacity(network)
    others = random.uniform(-1.0, 1.0, count - 1)
    others[0] *= -1.0 if len(set(np.sign(others))) == 1 else 1.0  # 0 lies within the range, as in training
    knots = np.sort(np.append(others, 0.0))
    zero = int(np.flatnonzero(knots == 0.0)[0])
    values = np.where(knots == 0.0, 0.0, random.normal(0.0, 10.0 ** random.uniform(0.0, 3.0), count))
    wild = curve.Curve(knots, values, zero)
    before = breaks(given, unfold.unfold(wild, network, -1.0, 1.0))
    for n in range(SETTINGS.story_tries):  # as training does
        limits = bound(given, SETTINGS.promised_first * SETTINGS.story_tighter**n, 0.0)(wild)
        try:
            found = wild.with_theta(wild.theta + least(np.eye(wild.columns), np.zeros(wild.columns), limits, wild.theta))
        except RuntimeError:
            return before, False, True
        made = unfold.unfold(found, network, -1.0, 1.0)
        if bound is not promised.bound or not promises.broken(given, made, False):
            return before, breaks(given, made), False
    return before, False, True


# -- trained curves


def trained(count: int, seed: int, folder: Path, promising: bool = True) -> Iterator[tuple[Promises, Network | None]]:
    """Networks of `count` trainings, two each, and what is promised of them; None for one that is refused. Without `promising`, trained
    freely."""
    model = penode_gen.load(HERE / "quarter.toml")
    shapes = {n: untrained({"layers": [10, 10]}, 1, n) for n in model.networks}
    model = replace(model, sets={"default": replace(model.sets["default"], networks=shapes)})
    engine = Engine(model, [p.name for p in model.parameters.values() if p.tolerance > 0.0])
    ports = story.ports_of(model, engine)
    records = [
        data.record(model, load([generator.make(t, 1, seconds=6.0).write(folder / f"{k}.csv")], model)[0], engine.signals)
        for k, t in enumerate(PLANTS)
    ]
    random = np.random.default_rng(seed)
    for _ in range(count):
        given = {p.name: GIVEN[random.integers(len(GIVEN))] for p in ports}
        own = replace(model, networks={n: replace(p, promises=given[n] if promising else Promises()) for n, p in model.networks.items()})
        found = _train(own, engine, ports, _window(records[random.integers(len(records))], random))
        yield from ((given[p.name], n) for p, n in zip(ports, found, strict=True))


def _window(record: data.Record, random: np.random.Generator) -> data.Record:
    """A part of a recording."""
    a = int(random.integers(0, len(record.y) - WINDOW))
    d = replace(
        record.drive,
        u=np.ascontiguousarray(record.drive.u[a : a + WINDOW]),
        between=np.ascontiguousarray(record.drive.between[a : a + WINDOW - 1]),
    )
    return replace(record, drive=d, y=record.y[a : a + WINDOW], good=record.good[a : a + WINDOW])


def _train(model: Model, engine: Engine, ports: list, record: data.Record) -> list[Network | None]:
    """What training makes of a recording, up to the networks."""
    templates = [model.sets["default"].networks[p.name] for p in ports]
    problem = Problem(engine, (record,), data.at_first(model, (record,), engine.signals), np.ones(len(ports)), held=frozenset(engine.free))
    bounds = [promised.bound(model.networks[p.name].promises, size=1.0) for p in ports]
    try:
        problem, fit = curves.train(problem, ports, bounds, lambda share, doing: None)
        networks, _ = story.written(model, problem, fit, ports, templates, judge.visited(ports, curves.seen_by(problem, fit.point)))
    except (UserError, FloatingPointError):
        return [None] * len(ports)
    return list(networks)


# -- faults


def faulty(name: str) -> Bound:
    """Limits with a fault that a program may have."""

    def bound(given: Promises, margin: float, size: float) -> Callable[[curve.Curve], Limits]:
        right = promised.bound(given, margin, size)

        def limits(of: curve.Curve) -> Limits:
            found = right(of)
            if name == "outermost pieces are free":
                pieces = np.abs(found.rows[:, [0, -1]]).sum(axis=1) == 0.0
                return Limits(found.rows[pieces], found.least[pieces])
            if name == "a knot is forgotten":
                others = found.rows[:, found.rows.shape[1] // 4] == 0.0
                return Limits(found.rows[others], found.least[others])
            if name == "the other direction":
                return Limits(-found.rows, found.least)
            size = np.maximum(np.abs(found.least), np.max(np.abs(found.rows)) if given.dissipative is None else 1.0)
            return Limits(found.rows, found.least - 1e-4 * size)  # "limits are 0.01 % too wide"

        return limits

    return bound


FAULTS = ("outermost pieces are free", "a knot is forgotten", "the other direction", "limits are 0.01 % too wide")


def seen(name: str, count: int) -> int:
    """Number of random curves of which the judge finds that they break a promise, where the limits have a fault."""
    random = np.random.default_rng(2)
    return sum(kept(GIVEN[k % len(GIVEN)], random, [8, 8], faulty(name))[1] for k in range(count))


# -- the page


def random_curves(seed: int, count: int) -> list[int]:
    """Counts of random curves: broken before training's limits, after them, refused."""
    random = np.random.default_rng([1, seed])
    return [sum(values) for values in zip(*(kept(GIVEN[k % len(GIVEN)], random, [8, 8]) for k in range(count)), strict=True)]


def trained_curves(seed: int, count: int, folder: Path, promising: bool = True) -> list[int]:
    """Counts over trainings of two networks each: networks that are broken, and that are refused."""
    with threads.one():
        pairs = list(trained(count, seed, folder, promising))
    return [sum(breaks(g, n) for g, n in pairs if n is not None), sum(n is None for _, n in pairs)]


def rows(given: argparse.Namespace) -> Iterator[tuple[str, str, bool]]:
    """Rows of the page, and whether each is as it must be."""
    done = given.out.with_suffix(".jsonl")
    some = [parts.kept(done, ["random", k], lambda k=k: random_curves(k, CHUNK)) for k in range(given.curves // CHUNK)]
    before, after, refused = (sum(values) for values in zip(*some, strict=True))
    yield (
        "random curves, broken before and after training's limits, refused",
        f"{before}, {after} and {refused} of {len(some) * CHUNK}",
        after == 0,
    )
    with tempfile.TemporaryDirectory() as folder:
        pairs = [
            parts.kept(done, ["trained", k], lambda k=k: trained_curves(k, FEW, Path(folder))) for k in range(given.trained // (2 * FEW))
        ]
        wild = parts.kept(done, ["free"], lambda: trained_curves(0, FEW, Path(folder), promising=False))
    wrong, none = (sum(values) for values in zip(*pairs, strict=True))
    every = 2 * FEW * len(pairs)
    yield "trained curves, broken, refused", f"{wrong} and {none} of {every}", wrong == 0 and none < every // 2
    yield "the same trained freely, broken", f"{wild[0]} of {2 * FEW - wild[1]}", wild[0] > 0
    for name in FAULTS:
        number = parts.kept(done, ["fault", name], lambda name=name: seen(name, 40))
        yield f"fault in the limits: {name}", f"found in {number} of 40 curves", number > 0


def main() -> None:
    """Rows for the page; exit code 1 where one is not as it must be."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--curves", type=int, default=10_000)
    parser.add_argument("--trained", type=int, default=1_000)
    parser.add_argument("--out", type=Path, default=Path("build/campaign-train/promises.json"))
    given = parser.parse_args()
    found = []
    for row in rows(given):
        print(*row, flush=True)
        found.append(row)
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps(found), encoding="utf-8")
    sys.exit(not all(good for *_, good in found))


if __name__ == "__main__":
    main()
