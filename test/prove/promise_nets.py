# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Random networks that make it hard to tell whether they keep a promise, and limits close to what they just keep."""

from __future__ import annotations

import itertools
from fractions import Fraction

import numpy as np
from promise_reference import DISSIPATIVE, INCREASING, MAX_FORCE, MAX_SLOPE, ZERO_AT_ZERO, Layer, Line, Net, Promise

DECREASING = 0x2


def _plain(draw: np.random.Generator, sizes: list[int]) -> list[tuple[np.ndarray, np.ndarray]]:
    layers = []
    for m, n in itertools.pairwise(sizes):
        spread = 10.0 ** draw.uniform(-1.5, 0.5, (n, 1))
        layers.append((draw.standard_normal((n, m)) * spread, draw.standard_normal(n) * draw.choice([0.0, 0.1, 1.0])))
    return layers


def _through(layers: list[tuple[np.ndarray, np.ndarray]]) -> list[tuple[np.ndarray, np.ndarray]]:
    """With two more neurons a layer that pass x and -x on: the last two columns of the last layer then tilt the line."""
    found = []
    for i, (w, b) in enumerate(layers):
        rows, columns = w.shape
        if i == 0:
            w, b = np.vstack([w, [[1.0]], [[-1.0]]]), np.append(b, [0.0, 0.0])
        elif i < len(layers) - 1:
            wider = np.zeros((rows + 2, columns + 2))
            wider[:rows, :columns], wider[rows, columns], wider[rows + 1, columns + 1] = w, 1.0, 1.0
            w, b = wider, np.append(b, [0.0, 0.0])
        else:
            w = np.hstack([w, np.zeros((rows, 2))])
        found.append((w, b))
    return found


def _net(draw: np.random.Generator, layers, scaled: bool, real: type, clamp: bool, low: float, high: float) -> Net:
    def numbers(values):
        return np.asarray(values).astype(real).astype(float).tolist()

    chain = [Layer("centre", [numbers(draw.standard_normal(1))], numbers(draw.uniform(0.1, 3.0, 1)))] if scaled else []
    chain += [Layer("relu" if i < len(layers) - 1 else "dense", numbers(w), numbers(b)) for i, (w, b) in enumerate(layers)]
    chain += [Layer("rescale", [numbers(draw.uniform(0.1, 1e3, 1))], numbers(draw.standard_normal(1)))] if scaled else []
    return Net(chain, *numbers(sorted([low, high])), clamp, real)


def _off_at_zero(draw: np.random.Generator, layers: list[tuple[np.ndarray, np.ndarray]], eps: float) -> None:
    """Make neurons switch on away from 0 only, in place."""
    w, b = layers[0]
    b[:] = -np.abs(w[:, 0]) * draw.choice([0.0, 0.01, 1.0], len(b)) * draw.uniform(0.5, 1.0, len(b))
    side = np.sign(w[:, 0]) if len(layers) == 2 else np.ones(len(b))
    layers[1] = (np.abs(layers[1][0]) * side, -np.abs(layers[1][1]) * (len(layers) > 2))
    layers[-1][1][:] = draw.choice([0.0, 0.0, eps * eps, -eps])
    if draw.random() < 0.3:  # or all but
        layers[-1][0][0, -1] *= -draw.choice([1e-3, 1.0])


def _crowded(draw: np.random.Generator, eps: float) -> list[tuple[np.ndarray, np.ndarray]]:
    """Kinks next to each other, up and down against a slope."""
    n, steep = draw.integers(5, 9), 10.0 ** draw.uniform(-1.0, 2.0)
    at = 1.0 + eps * np.cumsum(draw.integers(0, 5, n)) * draw.choice([1.0, 4.0, 1e3])
    up = steep * (-1.0) ** np.arange(n) * (1.0 + 1e-3 * draw.random(n))
    back = 0.3 * steep * draw.choice([-1.0, 1.0])
    return [(np.append(np.ones(n), [1.0, -1.0])[:, None], np.append(-at, [0.0, 0.0])), (np.append(up, [back, -back])[None, :], np.zeros(1))]


def net(draw: np.random.Generator) -> Net:
    """One network of a kind that is drawn as well."""
    real = np.float32 if draw.random() < 0.7 else np.float64
    eps = float(np.finfo(real).eps)
    clamp = bool(draw.random() < 0.5)
    low, high = np.sort(draw.uniform(-3.0, 3.0, 2)) if draw.random() < 0.7 else (-draw.uniform(0.1, 3.0), draw.uniform(0.1, 3.0))
    sizes = [1, *draw.integers(1, 6, draw.integers(1, 3)), 1]
    layers = _plain(draw, sizes)
    kind, scaled = draw.integers(0, 12), False
    if kind == 1:  # scaled input and output
        scaled = True
    elif kind == 2:  # kinks a few numbers apart, large slopes that cancel; a whole bundle of them sometimes
        w, b = layers[0][0], layers[0][1]
        out = layers[1][0]
        for i in range(1, len(b)):
            w[i], b[i] = w[0], b[0] + b[0] * eps * draw.integers(-40, 41) * 10.0 ** draw.integers(0, 3)
            out[:, i] = -out[:, 0] * (1.0 + 1e-3 * draw.standard_normal())
    elif kind == 3:  # kinks on the edges of the envelope, as well as a number allows
        w, b = layers[0]
        for i in range(len(b)):
            b[i] = -w[i, 0] * (low if i % 2 else high)
    elif kind in (4, 5):  # tilted until the least slope is next to 0, on either side
        layers = _through(layers)
        trial = Line(_net(draw, layers, False, real, clamp, low, high))
        lift = -float(min(trial.slopes if not clamp else trial.slopes[1:-1])) * (
            1.0 + draw.choice([0.0, eps, 100.0 * eps, 1e-3, 1.0]) * draw.choice([-1.0, 1.0])
        )
        layers[-1][0][0, -2:] = lift, -lift
    elif kind == 6:  # dead neurons, twins
        for w, b in layers[:-1]:
            w[0], b[0] = 0.0, draw.choice([0.0, -1.0, 1.0])
            w[-1], b[-1] = w[len(b) // 2], b[len(b) // 2]
    elif kind == 7:  # off at 0: dissipative without a band, or next to it
        _off_at_zero(draw, layers, eps)
    elif kind == 8:  # rises everywhere, or all but
        layers = [(np.abs(w), b) for w, b in layers]
        if draw.random() < 0.5:
            w = layers[-1][0]
            w[0, draw.integers(w.shape[1])] *= -draw.choice([eps, 1e-5, 1.0])
    elif kind == 9:  # flat outside: a layer that is off there
        layers = _plain(draw, [1, sizes[1], draw.integers(1, 5), 1])
        layers[1] = (-np.abs(layers[1][0]) - 0.1, np.abs(layers[1][1]) + 0.1)
        layers[0] = (np.vstack([layers[0][0], [[0.5], [-0.5]]]), np.append(layers[0][1], [0.0, 0.0]))
        layers[1] = (np.hstack([layers[1][0], np.full((len(layers[1][1]), 2), -1.0)]), layers[1][1])
    elif kind == 10:  # far from 1: subnormal results, and values next to what overflows
        power = draw.integers(-60, 40)
        layers = [(w * 2.0**power, b * 2.0**power) for w, b in layers]
    elif kind == 11:  # more kinks next to each other than patterns are gone through
        layers = _crowded(draw, eps)
    return _net(draw, layers, scaled, real, clamp, low, high)


def promises(draw: np.random.Generator, made: Net, line: Line) -> list[Promise]:
    """Some promises that the network keeps or breaks, often by a hair."""

    def about(exact: Fraction) -> float:
        by = draw.choice([0.0, 0.5, 8.0, 1e2, 1e4]) * np.finfo(made.real).eps if draw.random() < 0.7 else draw.choice([0.01, 0.5])
        with np.errstate(over="ignore"):
            limit = float(made.real(float(exact) * (1.0 + by * draw.choice([-1.0, 1.0]))))
        return limit if np.isfinite(limit) else 1.0

    found = [Promise(kind) for kind in (INCREASING, DECREASING) if draw.random() < 0.5 or min(line.slopes) >= 0]
    found += [Promise(MAX_SLOPE, about(max(map(abs, line.slopes)))), Promise(MAX_SLOPE, about(max(map(abs, line.slopes))))]
    if line.slopes[0] == line.slopes[-1] == 0 or draw.random() < 0.1:
        found += [Promise(MAX_FORCE, about(max(map(abs, line.values)))), Promise(MAX_FORCE, about(max(map(abs, line.values))))]
    if (line.slopes[0] >= 0 and line.slopes[-1] >= 0) or draw.random() < 0.1:
        found += [Promise(DISSIPATIVE), Promise(DISSIPATIVE, about(line.driving()))]
    return found + [Promise(ZERO_AT_ZERO)] * (draw.random() < 0.2)
