# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""src/pen_fold.c a second time, in NumPy: the same walk in the same order, so the same pieces to the bit."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..networks import Affine, Network
from .kernels import Array, Kernels, Real


@dataclass
class Piece:
    """pen_piece_t; `outside`: it carries PEN_OUTSIDE."""

    start: Real
    offset: Real
    slope: Real
    outside: bool


@dataclass
class _View:
    value: Real
    slope: Real
    ahead: Real
    neuron: int | None


class Walk:
    """pen_fold(): the pieces of one network, whose values begin with its trust envelope."""

    def __init__(self, kernels: Kernels, network: Network, p: Array, clamp: bool):
        self.k, self.network, self.p, self.clamp = kernels, network, p, clamp
        self.neurons = sum(la.n_out for la in network.layers if not isinstance(la, Affine) and la.activation == "relu")
        self.active = np.zeros(self.neurons, bool)
        self.looks = 0

    def pieces(self, capacity: int) -> list[Piece] | None:
        """All of `capacity`; None if there are more."""
        low, high = self.p[0], self.p[1]
        centre = (self.k.half * low) + (self.k.half * high)
        self.looks = capacity + self.neurons + 4
        down = self._go(-self.k.one, low, low, centre, capacity - 1)
        up = self._go(self.k.one, high, self._above(high), centre, capacity - len(down)) if down else []
        if not up:
            return None
        found = [*reversed(down), *up]
        found += [found[-1]] * (capacity - len(found))
        found[0] = replace(found[0], start=centre)
        return found

    def _above(self, x: Real) -> Real:
        """The smallest number above a finite x."""
        real, limits = self.k.real, np.finfo(self.k.real)
        size = abs(x) * limits.eps
        near, far = x + (real(0.375) * size), x + (real(0.75) * size)
        tiny = x + (limits.smallest_normal * limits.eps)
        return near if near > x else far if far > x else tiny

    def _go(self, way: Real, edge: Real, beyond_edge: Real, centre: Real, room: int) -> list[Piece]:
        """The pieces one way from the centre, nearest first; none if they are more than `room` or take too many looks."""
        largest = np.finfo(self.k.real).max
        x = start = centre
        outside, begin = False, True
        done: list[Piece] = []
        while len(done) < room and self.looks > 0:
            view = self._look(x, way, begin)
            ahead = x + (way * view.ahead)
            kink = view.neuron if abs(ahead) < largest else None
            beyond = kink is not None and (way * (edge - ahead)) > 0
            flat = self.clamp and outside
            slope = self.k.zero if flat else view.slope
            piece = Piece(start, view.value - (slope * (x - centre)), slope, outside)
            begin = False
            self.looks -= 1
            if not outside and not beyond and abs(edge) < largest:
                moved, outside, start, x = True, True, beyond_edge, edge
            elif kink is not None and not flat:
                moved = bool((way * (ahead - x)) > 0)
                self.active[kink] = not self.active[kink]
                start, x = (ahead if moved else start), ahead
            else:
                return [*done, piece]
            if moved:
                done.append(replace(piece, start=start) if way < 0 else piece)
        return []

    def _look(self, x: Real, way: Real, begin: bool) -> _View:
        k, p, first = self.k, self.p[2:], 0
        view = _View(k.zero, k.zero, k.zero, None)
        h, t = np.array([x], k.real), np.array([k.one], k.real)
        for layer in self.network.layers:
            n = layer.n_out
            if isinstance(layer, Affine):
                centre = layer.form == "centre"
                (k.pen_centre if centre else k.pen_rescale)(n, p, h, h)
                (k.pen_centre_tangent if centre else k.pen_rescale_tangent)(n, p, t)
                p = p[2 * n :]
                continue
            y, s = np.empty(n, k.real), np.empty(n, k.real)
            k.pen_dense_dual(n, layer.n_in, p, h, t, y, s)
            p = p[n * (layer.n_in + 1) :]
            if layer.activation == "relu":
                self._follow(first, n, way, y, s, begin, view)
                first += n
            h, t = y, s
        view.value, view.slope = h[0], t[0]
        return view

    def _follow(self, first: int, n: int, way: Real, y: Array, s: Array, begin: bool, view: _View) -> None:
        """Apply the pattern to a layer's values y and derivatives s, and see which of its neurons switches next."""
        on = self.active[first : first + n]
        if begin:
            on[:] = y > 0
        change = way * s
        for i in np.flatnonzero(np.where(on, change < 0, change > 0)):
            distance = -(y[i] / change[i])
            ahead = distance if distance > 0 else self.k.zero
            if view.neuron is None or ahead < view.ahead:
                view.ahead, view.neuron = ahead, first + int(i)
        y[~on] = 0
        s[~on] = 0


def find(pieces: list[Piece], x: Real) -> Piece:
    """pen_fold_find()"""
    at, n = 0, len(pieces)
    while n > 3:
        middle = at + n // 2
        at = at if x < pieces[middle].start else middle
        n //= 2
    upper = at + 1 if x < pieces[at + n - 1].start else at + n - 1
    return pieces[at] if x < pieces[at + 1].start else pieces[upper]


def value(pieces: list[Piece], at: Piece, x: Real) -> Real:
    """pen_fold_value()"""
    return at.offset + (at.slope * (x - pieces[0].start))
