# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The kernels of the runtime a second time, in NumPy: the same operations in the same order, so the same bits.

They give the known answers of the self-tests (selftest.py), which therefore do not come from a run of the C. Arrays stand for
what C passes by pointer: a slice from the first value on, written in place. Every method has the name of its C function.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..sets.packing import RealType, dense_rows
from .elementary import Elementary

Array = NDArray[Any]
Real = Any  # np.float32 or np.float64


def _table(text: str) -> list[float]:
    return [float.fromhex(word) if "x" in word else float(word) for word in text.split()]


# Constants of src/pen_math.c: bias, e^x range, sigmoid's low, tanh's high, then polynomials.
_SINGLE: dict[str, float | list[float]] = {
    "bias": 149.0,
    "log2_e": 1.442695,
    "ln2": 0.6931472,
    "ln2_high": 0.69314575,
    "ln2_low": 1.4286068e-06,
    "exp_low": -104.0,
    "exp_high": 89.0,
    "sigmoid_low": -20.0,
    "tanh_high": 20.0,
    "expm1": _table("0.49999994 0.16666521 0.04166839 0.0083687175 0.001381455"),
    "tanh": _table("0.3333328 -0.13331443 0.053739727 -0.020639114 0.0057050097"),
    "softplus": _table("0.12499999 -0.0052082767 0.00034697095 -2.5853244e-05 1.6702256e-06"),
    "log1p": _table("-0.4999999 0.3333276 -0.24986029 0.19836731 -0.1561845 0.10384731 -0.039698943"),
}
_DOUBLE: dict[str, float | list[float]] = {
    "bias": 1074.0,
    "log2_e": 1.4426950408889634,
    "ln2": 0.6931471805599453,
    "ln2_high": 0.6931471805598903,
    "ln2_low": 5.497923018708371e-14,
    "exp_low": -746.0,
    "exp_high": 710.5,
    "sigmoid_low": -40.0,
    "tanh_high": 40.0,
    "expm1": _table("""0.5 0.16666666666666682 0.041666666666666095 0.008333333333317032 0.0013888888889114991
        0.00019841269896386885 2.480158692750757e-05 2.755723485954443e-06 2.7557581282573863e-07 2.5112037509909843e-08
        2.082676814174302e-09"""),
    "tanh": _table("""0.33333333333332854 -0.13333333333262098 0.05396825393127061 -0.02186948757614324 0.008863221003104155
        -0.0035919891767519415 0.0014549588900635909 -0.0005863165733756665 0.00022856426912142304 -7.714442580121259e-05
        1.6072596278844078e-05"""),
    "softplus": _table("""0.125 -0.005208333333333238 0.0003472222222203724 -2.635168648995422e-05 2.135692137405735e-06
        -1.803226186049191e-07 1.5659553771485343e-08 -1.3869811515592502e-09 1.2353516280036983e-10 -1.0357182777278308e-11
        6.109447901174064e-13"""),
    "log1p": _table("""-0.5 0.3333333333333272 -0.24999999999931094 0.1999999999604232 -0.16666666530519922 0.14285711212839042
        -0.12499951829330479 0.11110566663353447 -0.0999545190600923 0.0906237989589187 -0.08197734535786168 0.07202223010857473
        -0.057967567559433025 0.038633535507900364 -0.01814256789569002 0.004333531766514295"""),
}


_BITS = {np.float32: (32, 5), np.float64: (64, 8)}  # sigmoid's scale exponent, and bits of an exponent that _low has


class Kernels(Elementary):
    """pen_math, pen_elementary, pen_net and pen_solve for one real type."""

    def __init__(self, real: RealType):
        super().__init__(real)
        table = _SINGLE if real is np.float32 else _DOUBLE
        self._c: dict[str, Any] = {k: [real(c) for c in v] if isinstance(v, list) else real(v) for k, v in table.items()}
        bias = int(self._c["bias"])
        scale_bits, self._low_bits = _BITS[real]
        self._scale = real(2.0**-scale_bits)
        self._sigmoid_bias = real(bias - scale_bits)
        spread = 2**self._low_bits
        self._high = np.array([2.0 ** (spread * i - bias) for i in range(9)], dtype=real)
        self._low = np.array([2.0**i for i in range(spread)], dtype=real)
        self.zero, self.half, self.one, self.two = real(0), real(0.5), real(1), real(2)

    # -- elementary functions, of numbers or arrays ---------------------------------------------------------------

    @staticmethod
    def _polynomial(coefficients: list[Real], x: Any) -> Any:
        """c0 + x (c1 + x (c2 + ...))"""
        value = coefficients[-1]
        for c in coefficients[-2::-1]:
            value = c + (x * value)
        return value

    def _power(self, x: Any, low: Real, high: Real, bias: Real) -> tuple[Any, Any, Any]:
        c = np.where(x < low, low, x)
        c = np.where(c > high, high, c)
        shifted = (c * self._c["log2_e"]) + (bias + self.half)
        k = np.where(shifted > self.zero, shifted, self.zero).astype(np.uint32)
        n = k.astype(self.real) - bias
        r = (c - (n * self._c["ln2_high"])) - (n * self._c["ln2_low"])
        p = r + ((r * r) * self._polynomial(self._c["expm1"], r))
        return p, self._low[k & (2**self._low_bits - 1)], self._high[k >> self._low_bits]

    def pen_exp(self, x: Any) -> Any:
        p, low, high = self._power(x, self._c["exp_low"], self._c["exp_high"], self._c["bias"])
        return ((self.one + p) * low) * high

    def pen_sigmoid(self, x: Any) -> Any:
        p, low, high = self._power(-x, self._c["sigmoid_low"], -self._c["exp_low"], self._sigmoid_bias)
        scale = low * high
        total = scale + self._scale
        lost = self._scale - (total - scale)
        return self._scale / (total + ((scale * p) + lost))

    def pen_tanh(self, x: Any) -> Any:
        size, z = np.abs(x), x * x
        inner = x + (x * (self.zero - (z * self._polynomial(self._c["tanh"], z))))
        p, low, high = self._power(size + size, self.zero, self._c["tanh_high"], self._c["bias"])
        scale = low * high
        outer = self.one - (self.two / ((self.one + scale) + (scale * p)))
        return np.where(size < self.real(0.625), inner, np.where(x > self.zero, outer, -outer))[()]

    def pen_softplus(self, x: Any) -> Any:
        size, z = np.abs(x), x * x
        inner = self._c["ln2"] + ((self.half * x) + (z * self._polynomial(self._c["softplus"], z)))
        p, low, high = self._power(-size, self._c["exp_low"], self.zero, self._c["bias"])
        e = ((self.one + p) * low) * high
        ramp = np.where(x > self.zero, x, self.zero)
        outer = ramp + (e + ((e * e) * self._polynomial(self._c["log1p"], e)))
        return np.where(size < self.one, inner, outer)[()]

    def pen_port_abs(self, x: Any) -> Any:
        return np.abs(x)

    def pen_where(self, condition: Any, yes: Any, no: Any) -> Any:
        return yes if condition else no

    def pen_max(self, a: Real, b: Real) -> Real:
        return (a if a > b else b) + (self.zero * (a + b))

    def pen_min(self, a: Real, b: Real) -> Real:
        return (a if a < b else b) + (self.zero * (a + b))

    def pen_sign(self, x: Real) -> Real:
        above = self.one if x > self.zero else self.zero
        below = self.one if x < self.zero else self.zero
        return (above - below) + (self.zero * x)

    def pen_heaviside(self, x: Real) -> Real:
        return (self.one if x > self.zero else self.zero) + (self.zero * x)

    # -- dense layers ---------------------------------------------------------------------------------------------

    def pen_rectified(self, x: Any) -> Any:
        return self.half * (x + np.abs(x))

    @staticmethod
    def _sums(first: Array | Real, products: Array) -> Any:
        """Row by row first + products[0] + products[1] + ..., in that order."""
        products[0] = first + products[0]
        return np.add.accumulate(products, axis=0)[-1]

    def _blocks(self, n_out: int, n_in: int, w: Array) -> list[tuple[int, int, Array]]:
        """(first row, rows, [n_in + 1, rows]: biases, then columns) of each block of a layer"""
        return [(r, n, w[r * (n_in + 1) : (r + n) * (n_in + 1)].reshape(n_in + 1, n)) for r, n in dense_rows(n_out)]

    def pen_dense(self, n_out: int, n_in: int, w: Array, x: Array, y: Array) -> None:
        for row, n, block in self._blocks(n_out, n_in, w):
            y[row : row + n] = self._sums(block[0], block[1:] * x[:n_in, None])

    def pen_dense_relu(self, n_out: int, n_in: int, w: Array, x: Array, y: Array) -> None:
        on = self.pen_rectified(x[:n_in])[:, None]
        for row, n, block in self._blocks(n_out, n_in, w):
            y[row : row + n] = self._sums(block[0], block[1:] * on) if n > 1 else self.pen_dense1_relu(n_in, block[:, 0], x)

    def pen_dense1(self, n_in: int, w: Array, x: Array) -> Real:
        return self._sums(w[0], w[1 : n_in + 1] * x[:n_in])

    def pen_dense1_relu(self, n_in: int, w: Array, x: Array) -> Real:
        twice = x[:n_in] + np.abs(x[:n_in])
        return self.half * self._sums(w[0] + w[0], w[1 : n_in + 1] * twice)

    def pen_dense_tangent(self, n_out: int, n_in: int, w: Array, t: Array, y: Array) -> None:
        for row, n, block in self._blocks(n_out, n_in, w):
            products = block[1:] * t[:n_in, None]
            y[row : row + n] = self._sums(np.zeros(n, self.real), products) if n > 1 else np.add.accumulate(products, axis=0)[-1]

    def pen_dense_dual(self, n_out: int, n_in: int, w: Array, x: Array, t: Array, y: Array, s: Array) -> None:
        wide = n_out - n_out % 16
        self.pen_dense(n_out, n_in, w, x, y)
        for row, n, block in self._blocks(wide, n_in, w):
            s[row : row + n] = np.add.accumulate(block[1:] * t[:n_in, None], axis=0)[-1]
        if n_out > wide:
            self.pen_dense_tangent(n_out - wide, n_in, w[wide * (n_in + 1) :], t, s[wide:])

    def pen_net16(self, hidden: int, w: Array, x: Real) -> Real:
        h = w[:16] + (w[16:32] * x)
        for layer in range(hidden):
            self.pen_dense_relu(16, 16, w[32 + 272 * layer :], h, h)
        return self.pen_dense1_relu(16, w[32 + 272 * hidden :], h)

    def pen_net16_slope(self, hidden: int, w: Array, x: Real, slope: Array) -> Real:
        r, d = w[:16] + (w[16:32] * x), w[16:32]
        for layer in range(hidden):
            block = w[32 + 272 * layer : 304 + 272 * layer].reshape(17, 16)
            t = np.where(r > self.zero, d, self.zero)
            r = self._sums(block[0], block[1:] * self.pen_rectified(r)[:, None])
            d = np.add.accumulate(block[1:] * t[:, None], axis=0)[-1]
        last = w[32 + 272 * hidden :]
        slope[0] = self._sums(self.zero, last[1:17] * np.where(r > self.zero, d, self.zero))
        return self.pen_dense1_relu(16, last, r)

    # -- activations, their slopes, element-wise layers -----------------------------------------------------------

    def pen_act_relu(self, n: int, h: Array) -> None:
        h[:n] = self.pen_rectified(h[:n])

    def pen_act_tanh(self, n: int, h: Array) -> None:
        h[:n] = self.pen_tanh(h[:n]) + (self.zero * h[:n])

    def pen_act_sigmoid(self, n: int, h: Array) -> None:
        h[:n] = self.pen_sigmoid(h[:n]) + (self.zero * h[:n])

    def pen_act_softplus(self, n: int, h: Array) -> None:
        h[:n] = self.pen_softplus(h[:n]) + (self.zero * h[:n])

    def pen_act_step(self, n: int, h: Array) -> None:
        h[:n] = np.where(h[:n] < self.zero, self.zero, self.one) + (self.zero * h[:n])

    def pen_slope_relu(self, n: int, h: Array, t: Array) -> None:
        t[:n] = np.where(h[:n] > self.zero, t[:n], self.zero)

    def pen_slope_tanh(self, n: int, h: Array, t: Array) -> None:
        t[:n] *= self.one - (h[:n] * h[:n])

    def pen_slope_sigmoid(self, n: int, h: Array, t: Array) -> None:
        t[:n] *= h[:n] * (self.one - h[:n])

    def pen_slope_softplus(self, n: int, h: Array, t: Array) -> None:
        t[:n] *= self.one - self.pen_exp(-h[:n])

    def pen_slope_step(self, n: int, h: Array, t: Array) -> None:
        t[:n] = self.zero * h[:n]

    def pen_centre(self, n: int, p: Array, x: Array, y: Array) -> None:
        y[:n] = (x[:n] - p[:n]) * p[n : 2 * n]

    def pen_rescale(self, n: int, p: Array, x: Array, y: Array) -> None:
        y[:n] = (x[:n] * p[:n]) + p[n : 2 * n]

    def pen_centre_tangent(self, n: int, p: Array, t: Array) -> None:
        t[:n] *= p[n : 2 * n]

    def pen_rescale_tangent(self, n: int, p: Array, t: Array) -> None:
        t[:n] *= p[:n]

    # -- trust envelope -------------------------------------------------------------------------------------------

    def pen_clamp(self, n: int, limits: Array, x: Array, y: Array) -> None:
        low, high = limits[:n], limits[n : 2 * n]
        raised = np.where(x[:n] < low, low, x[:n])
        y[:n] = np.where(raised > high, high, raised)

    def _margin(self, n: int, limits: Array, width: Real, x: Array, i: int) -> Real:
        span = width * (limits[n + i] - limits[i])
        below, above = x[i] - limits[i], limits[n + i] - x[i]
        return self.one + ((below if below < above else above) / span)

    def pen_fade(self, n: int, limits: Array, width: Real, x: Array) -> Real:
        trust = self.one
        for i in range(n):
            here = self._margin(n, limits, width, x, i)
            trust = (here if here < trust else trust) + (self.zero * here)
        return self.zero if trust < self.zero else trust

    def pen_clamp_slope(self, n: int, limits: Array, x: Array, i: int) -> Real:
        return self.one if limits[i] <= x[i] <= limits[n + i] else self.zero

    def pen_fade_slope(self, n: int, limits: Array, width: Real, x: Array, i: int) -> Real:
        trust = self.pen_fade(n, limits, width, x)
        steepness = self.one / (width * (limits[n + i] - limits[i]))
        fading = (steepness if x[i] < limits[i] else -steepness) if self.zero < trust < self.one else self.zero
        return self.zero if self._margin(n, limits, width, x, i) > trust else fading

    # -- linear systems -------------------------------------------------------------------------------------------

    def pen_solve2(self, a: Array, b: Array) -> bool:
        """False if singular."""
        first = 1 if abs(a[2]) > abs(a[0]) else 0
        second = 1 - first
        p, q = a[2 * first : 2 * first + 2], a[2 * second : 2 * second + 2]
        inverse = self.one / p[0]
        factor = q[0] * inverse
        pivot = q[1] - (factor * p[1])
        x1 = (b[second] - (factor * b[first])) * (self.one / pivot)
        x0 = (b[first] - (p[1] * x1)) * inverse
        b[0], b[1] = x0, x1
        return bool(np.isfinite([p[0], pivot, x1, x0]).all())

    def pen_solve(self, n: int, a: Array, b: Array) -> bool:
        """False if singular."""
        m, inverse, pivots = a.reshape(n, n), np.zeros(n, self.real), np.zeros(n, self.real)
        for k in range(n):
            row = k
            for i in range(k + 1, n):  # a NaN is passed over unless it is in row k
                row = i if abs(m[i, k]) > abs(m[row, k]) else row
            m[[k, row], k:] = m[[row, k], k:]
            b[[k, row]] = b[[row, k]]
            inverse[k], pivots[k] = self.one / m[k, k], m[k, k]
            factor = m[k + 1 :, k] * inverse[k]
            m[k + 1 :, k + 1 :] -= factor[:, None] * m[k, k + 1 :]
            b[k + 1 : n] -= factor * b[k]
        for k in range(n - 1, -1, -1):
            total = b[k]
            for j in range(k + 1, n):
                total = total - m[k, j] * b[j]
            b[k] = total * inverse[k]
        return bool(np.isfinite(pivots).all() and np.isfinite(b[:n]).all())
