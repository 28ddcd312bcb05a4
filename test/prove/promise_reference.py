# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
What a network of one input with ReLU activations does, in exact rational arithmetic, and by how much it keeps a promise.

Written apart from the C: layer by layer over all kinks at once, not from kink to kink. `Line` is exact. `Hull` is the margin
that inc/penode/pen_promise.h states, at single places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise, product

import numpy as np

INCREASING, DECREASING, DISSIPATIVE, MAX_SLOPE, MAX_FORCE, ZERO_AT_ZERO = (1 << k for k in range(6))


@dataclass(frozen=True)
class Layer:
    """kind "dense" or "relu": weights [n_out][n_in], bias [n_out]; "centre" or "rescale": one row of weights, p and q."""

    kind: str
    weights: list[list[float]]
    bias: list[float]

    @property
    def n_out(self) -> int:
        return len(self.bias)

    @property
    def n_in(self) -> int:
        return len(self.weights[0])


@dataclass(frozen=True)
class Net:
    """Values are numbers of the C's real type; low and high are those of the trust envelope."""

    layers: list[Layer]
    low: float
    high: float
    clamp: bool
    real: type  # np.float32 or np.float64


@dataclass(frozen=True)
class Promise:
    kind: int
    limit: float = 0.0


class Line:
    """The exact function: places [k], values there, slopes [k + 1] of the pieces before, between and after them."""

    def __init__(self, net: Net):
        places = [Fraction(0)]
        rows = [(Fraction(1), [Fraction(0)], Fraction(1))]  # slope before all places, values, slope behind them
        for layer in net.layers:
            if layer.kind in ("centre", "rescale"):
                pairs = [(Fraction(p), Fraction(q)) for p, q in zip(layer.weights[0], layer.bias, strict=True)]
                if layer.kind == "centre":
                    rows = [(a * q, [(v - p) * q for v in values], b * q) for (a, values, b), (p, q) in zip(rows, pairs, strict=True)]
                else:
                    rows = [(a * p, [v * p + q for v in values], b * p) for (a, values, b), (p, q) in zip(rows, pairs, strict=True)]
                continue
            rows = [_sum(weights, bias, rows, len(places)) for weights, bias in zip(layer.weights, layer.bias, strict=True)]
            if layer.kind == "relu":
                places, rows = _rectified(places, rows)
        ((before, values, behind),) = rows
        ends = (Fraction(net.low), Fraction(net.high)) if net.clamp else ()
        wanted = sorted({Fraction(0), *ends, *places})
        values = _at(wanted, places, before, values, behind)
        if net.clamp:
            inside = [i for i, x in enumerate(wanted) if ends[0] <= x <= ends[1]]
            wanted, values = [wanted[i] for i in inside], [values[i] for i in inside]
            before = behind = Fraction(0)
        self.places, self.values = wanted, values
        between = [(values[i + 1] - values[i]) / (wanted[i + 1] - wanted[i]) for i in range(len(wanted) - 1)]
        self.slopes = [before, *between, behind]

    def keeps(self, promise: Promise) -> bool:
        limit, slopes = Fraction(promise.limit), self.slopes
        match promise.kind:
            case 0x1:
                return min(slopes) >= 0
            case 0x2:
                return max(slopes) <= 0
            case 0x8:
                return max(map(abs, slopes)) <= limit
            case 0x10:
                return slopes[0] == slopes[-1] == 0 and max(map(abs, self.values)) <= limit
        pushed = self.driving()
        return slopes[0] >= 0 and slopes[-1] >= 0 and pushed <= limit

    def driving(self) -> Fraction:
        """The largest force along the motion, the outermost pieces apart; at the place seen at 0, either sign moves."""
        near = min(self.places, key=abs)
        found = abs(self.values[self.places.index(near)])
        for x, v in zip(self.places, self.values, strict=True):
            found = max(found, -v if x > near else v if x < near else abs(v))
        return found


def _sum(weights: Sequence[float], bias: float, rows, n: int):
    used = [(Fraction(w), row) for w, row in zip(weights, rows, strict=True) if w != 0.0]
    b = Fraction(bias)
    return (
        sum((w * row[0] for w, row in used), Fraction(0)),
        [b + sum((w * row[1][i] for w, row in used), Fraction(0)) for i in range(n)],
        sum((w * row[2] for w, row in used), Fraction(0)),
    )


def _rectified(places, rows):
    roots = set()
    for before, values, behind in rows:
        for i in range(len(places) - 1):
            if values[i] * values[i + 1] < 0:
                roots.add(places[i] + (places[i + 1] - places[i]) * values[i] / (values[i] - values[i + 1]))
        if before and places[0] - values[0] / before < places[0]:
            roots.add(places[0] - values[0] / before)
        if behind and places[-1] - values[-1] / behind > places[-1]:
            roots.add(places[-1] - values[-1] / behind)
    wanted = sorted({*places, *roots})
    found = []
    for before, values, behind in rows:
        values = _at(wanted, places, before, values, behind)
        on_before, on_behind = values[0] - before > 0, values[-1] + behind > 0  # no root lies beyond the outermost places
        on_before, on_behind = (values[0] > 0 or (values[0] == 0 and before < 0)), (values[-1] > 0 or (values[-1] == 0 and behind > 0))
        found.append((before if on_before else Fraction(0), [max(v, Fraction(0)) for v in values], behind if on_behind else Fraction(0)))
    return wanted, found


def _at(wanted, places, before, values, behind):
    """Values of a line at more places."""
    found, i, last = [], 0, len(places) - 1
    for x in wanted:
        while i < last and places[i + 1] <= x:
            i += 1
        if x <= places[0]:
            found.append(values[0] + before * (x - places[0]))
        elif x >= places[last]:
            found.append(values[last] + behind * (x - places[last]))
        elif x == places[i]:
            found.append(values[i])
        else:
            found.append(values[i] + (values[i + 1] - values[i]) * (x - places[i]) / (places[i + 1] - places[i]))
    return found


class Hull:
    """
    At x: value, its margin `error`, the least and the most slope that must keep a promise there, as the header has it.

    C = (inputs + 10) EPS for each layer. A neuron counts as one that may switch if its value is below 6 of its errors, or
    it switches within 8 EPS |x|; up to OPEN of them are put on and off in every combination. `number` is float where that is exact enough
    beside the margins, or Fraction. What is exactly 0 at x has no error; with `around` only if it is so next to x, too.
    """

    OPEN = 4

    def __init__(self, net: Net, x, number: type = Fraction, around: bool = True):
        eps, zero = number(float(np.finfo(net.real).eps)), number(0)
        tiny = number(float(np.finfo(net.real).smallest_subnormal)) * 64  # where results are subnormal, they have no relative error
        near = 8 * eps * abs(number(x)) + 4 * number(float(np.finfo(net.real).tiny))
        h, e, t, r = [number(x)], [zero], [number(1)], [zero]
        states: list[list[bool | None]] = []  # None: may switch
        for layer in net.layers:
            if layer.kind in ("centre", "rescale"):
                c = 12 * eps
                for i, (p, q) in enumerate(zip(map(number, layer.weights[0]), map(number, layer.bias), strict=True)):
                    if layer.kind == "centre":
                        still, size, factor = h[i] == p and e[i] == 0 and not (around and t[i]), abs((h[i] - p) * q), q
                        h[i] = (h[i] - p) * q
                    else:
                        still, size, factor = h[i] == 0 and e[i] == 0 and not (around and t[i]), abs(h[i] * p) + abs(q), p
                        h[i] = h[i] * p + q
                    flat = t[i] == 0 and r[i] == 0
                    e[i] = zero if still else abs(factor) * e[i] + c * size + tiny
                    t[i] *= factor
                    r[i] = zero if flat else abs(factor) * r[i] + c * abs(t[i]) + tiny
                continue
            c = (layer.n_in + 10) * eps
            flat = not any(t) and not any(r)
            still = not any(h) and not any(e) and (flat or not around)
            burden = [ej + c * abs(hj) + tiny for ej, hj in zip(e, h, strict=True)]
            sway = [rj + c * abs(tj) + tiny for rj, tj in zip(r, t, strict=True)]
            W = [[number(w) for w in row] for row in layer.weights]
            b = [number(v) for v in layer.bias]
            y = [bi + sum(w * hj for w, hj in zip(row, h, strict=True)) for bi, row in zip(b, W, strict=True)]
            s = [sum(w * tj for w, tj in zip(row, t, strict=True)) for row in W]
            e = [
                zero if still else c * abs(bi) + sum(abs(w) * g for w, g in zip(row, burden, strict=True)) + tiny
                for bi, row in zip(b, W, strict=True)
            ]
            r = [zero if flat else sum(abs(w) * g for w, g in zip(row, sway, strict=True)) + tiny for row in W]
            h, t = y, s
            if layer.kind == "relu":
                states.append([])
                for i, (v, slope) in enumerate(zip(y, s, strict=True)):
                    open_ = abs(v) <= max(6 * e[i], near * (abs(slope) + r[i])) and (e[i] > 0 or v != 0 or slope != 0 or r[i] != 0)
                    states[-1].append(None if open_ else v > 0)
                    if open_:
                        low, high = min(zero, slope - r[i]), max(zero, slope + r[i])
                        t[i], r[i] = (low + high) / 2, (high - low) / 2
                        h[i] = max(v, zero)
                    elif v <= 0:
                        h[i] = e[i] = t[i] = r[i] = zero
        self.value, self.error, self.least, self.most = h[0], e[0], t[0] - r[0], t[0] + r[0]
        count = sum(state is None for row in states for state in row)
        if 0 < count <= self.OPEN:
            ways = [self._along(net, states, choice, number, eps, tiny) for choice in product((False, True), repeat=count)]
            self.least, self.most = min(t - r for t, r in ways), max(t + r for t, r in ways)

    @staticmethod
    def _along(net: Net, states, choice, number, eps, tiny):
        """Slope and its margin with the neurons that may switch on or off as chosen."""
        chosen, rows, zero = iter(choice), iter(states), number(0)
        t, r = [number(1)], [zero]
        for layer in net.layers:
            if layer.kind in ("centre", "rescale"):
                factors = [number(v) for v in (layer.bias if layer.kind == "centre" else layer.weights[0])]
                r = [
                    zero if ti == 0 and ri == 0 else abs(f) * ri + 12 * eps * abs(ti * f) + tiny
                    for f, ti, ri in zip(factors, t, r, strict=True)
                ]
                t = [f * ti for f, ti in zip(factors, t, strict=True)]
                continue
            flat, c = not any(t) and not any(r), (layer.n_in + 10) * eps
            sway = [rj + c * abs(tj) + tiny for rj, tj in zip(r, t, strict=True)]
            W = [[number(w) for w in row] for row in layer.weights]
            r = [zero if flat else sum(abs(w) * g for w, g in zip(row, sway, strict=True)) + tiny for row in W]
            t = [sum(w * tj for w, tj in zip(row, t, strict=True)) for row in W]
            if layer.kind == "relu":
                on = [next(chosen) if state is None else state for state in next(rows)]
                t, r = [ti if o else zero for ti, o in zip(t, on, strict=True)], [ri if o else zero for ri, o in zip(r, on, strict=True)]
        return t[0], r[0]


class Margins:
    """Does a network keep promises by more than the margin? Looked at on all kinks, in the middle between, and outside."""

    FORCE = 16  # errors

    def __init__(self, net: Net, line: Line, number: type):
        places, clamp = line.places, net.clamp
        self.start = min(places, key=abs)
        self.error = Hull(net, self.start, number, around=False).error
        middle = [(a + b) / 2 for a, b in pairwise(places)]
        size = abs(places[0]) + abs(places[-1]) + 1
        self.outer = () if clamp else (Hull(net, places[0] - size, number), Hull(net, places[-1] + size, number))
        smallest = float(np.finfo(net.real).tiny) / float(np.finfo(net.real).eps)
        self.seen = sorted([(x, Hull(net, x, number)) for x in {*places, *middle}], key=lambda pair: pair[0])

        # a slope next to the subnormal numbers is known to their spacing only, which counts along the whole line
        self.normal = all(
            h.least == h.most == 0 or max(abs(h.least), abs(h.most)) > smallest for h in [hull for _, hull in self.seen] + list(self.outer)
        )

    def keeps(self, promise: Promise) -> bool:
        limit = promise.limit
        hulls = [hull for _, hull in self.seen] + list(self.outer)
        if promise.kind in (DISSIPATIVE, MAX_FORCE) and not self.normal:
            return False
        match promise.kind:
            case 0x1:
                return all(h.least >= 0 for h in hulls)
            case 0x2:
                return all(h.most <= 0 for h in hulls)
            case 0x8:
                return all(max(abs(h.least), abs(h.most)) <= limit for h in hulls)
            case 0x10:
                return all(abs(h.value) + self.FORCE * h.error <= limit for h in hulls) and all(h.least == h.most == 0 for h in self.outer)
        if any(h.least < 0 for h in self.outer):
            return False
        for way in (1, -1):
            rising = True
            for x, h in self.seen[::way]:
                if way * (x - self.start) < 0:
                    continue
                if x == self.start and abs(h.value) + self.FORCE * self.error > limit:
                    return False
                rising = rising and h.least >= 0
                if not rising and way * h.value - self.FORCE * h.error < -limit:
                    return False
        return True


def zero_bits(net: Net) -> bool:
    """Is what the layers give at 0, in the real type and in the order of the C, zero?"""
    real = net.real
    x = real(0.0)
    if net.clamp:
        x = min(max(x, real(net.low)), real(net.high))
    h = [x]
    for layer in net.layers:
        if layer.kind == "centre":
            h = [(v - real(p)) * real(q) for v, p, q in zip(h, layer.weights[0], layer.bias, strict=True)]
        elif layer.kind == "rescale":
            h = [v * real(p) + real(q) for v, p, q in zip(h, layer.weights[0], layer.bias, strict=True)]
        else:
            y = []
            for weights, bias in zip(layer.weights, layer.bias, strict=True):
                total = real(bias)
                for w, v in zip(weights, h, strict=True):
                    total = total + real(w) * v
                y.append(max(total, real(0.0)) if layer.kind == "relu" else total)
            h = y
    return bool(h[0] == 0.0)
