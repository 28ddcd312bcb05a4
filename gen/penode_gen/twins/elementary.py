# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The functions of penode/pen_elementary.h in NumPy: the same operations in the same order, so the same bits (see kernels.py).

The constants are those of src/pen_trig.c, pen_atan.c, pen_log.c and pen_root.c, which test/accuracy/elementary_coefficients.py
derives.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..sets.packing import RealType

_SINGLE: dict[str, float | list[float]] = {
    "right_angle": [1.5703125, 0.0004837513, 7.5495336e-08, 2.563283e-12, 6.123234e-17],
    "two_by_pi": 0.63661975,
    "half_pi_high": 1.5707964,
    "half_pi_low": -4.371139e-08,
    "quarter_pi_high": 0.7853982,
    "quarter_pi_low": -2.1855694e-08,
    "log_2_high": 0.69314575,
    "log_2_low": 1.4286068e-06,
    "sin": [-0.16666655, 0.008332154, -0.00019514316],
    "cos": [0.041666646, -0.0013887307, 2.4432149e-05],
    "atan": [0.33333316, -0.1999891, 0.14261164, -0.108522594, 0.076592214, -0.03432499],
    "log": [0.66666776, 0.39977577, 0.29870906],
    "root": [1.5561924, -0.73886895, 0.19468726, -0.019050509],
}
_DOUBLE: dict[str, float | list[float]] = {
    "right_angle": [1.5707963267941523, 7.443547480488527e-13, -1.9034889620193266e-25],
    "two_by_pi": 0.6366197723675814,
    "half_pi_high": 1.5707963267948966,
    "half_pi_low": 6.123233995736766e-17,
    "quarter_pi_high": 0.7853981633974483,
    "quarter_pi_low": 3.061616997868383e-17,
    "log_2_high": 0.6931471805598903,
    "log_2_low": 5.497923018708371e-14,
    "sin": [
        -0.1666666666666663,
        0.008333333333321955,
        -0.00019841269829453035,
        2.7557313572349685e-06,
        -2.5050739837089412e-08,
        1.5895757124752342e-10,
    ],
    "cos": [
        0.041666666666666595,
        -0.0013888888888872822,
        2.4801587288700546e-05,
        -2.755731413448845e-07,
        2.0875694603749284e-09,
        -1.135820622186774e-11,
    ],
    "atan": [
        0.3333333333333333,
        -0.1999999999999973,
        0.14285714285680806,
        -0.11111111109019174,
        0.09090909012915448,
        -0.07692305793970378,
        0.06666634781823635,
        -0.05881969991376627,
        0.05259794228830514,
        -0.047400176274711776,
        0.04241784571096471,
        -0.0361810618718513,
        0.026888148678514433,
        -0.014769908557299096,
        0.0042758966669498326,
    ],
    "log": [
        0.6666666666666734,
        0.3999999999941636,
        0.28571428742016036,
        0.22222198610804886,
        0.18183562404338233,
        0.1531409879307027,
        0.147954764673815,
    ],
    "root": [1.5561924392527453, -0.7388689692747334, 0.19468725488171343, -0.019050508312304947],
}


@dataclass(frozen=True)
class _Format:
    """Format of a real type: integer type of its width, bits of the significand after the leading 1, bias, factor for subnormals."""

    word: type[np.unsignedinteger[Any]]
    bits: int
    bias: int
    lift_bits: int
    steps: int  # of Newton for the root


_FORMATS: dict[RealType, _Format] = {np.float32: _Format(np.uint32, 23, 127, 24, 1), np.float64: _Format(np.uint64, 52, 1023, 54, 3)}
_ANGLE_MAX, _NEAR, _FAR = 8192.0, 0.5463, 1.8304


class Elementary:
    """pen_sin, pen_cos, pen_atan, pen_log and pen_sqrt of numbers or arrays, for one real type."""

    def __init__(self, real: RealType):
        self.real = real
        table = _SINGLE if real is np.float32 else _DOUBLE
        self._e: dict[str, Any] = {k: [real(c) for c in v] if isinstance(v, list) else real(v) for k, v in table.items()}
        self._format = _FORMATS[real]

    def _tail(self, name: str, x: Any) -> Any:
        """c0 + x (c1 + x (c2 + ...))"""
        *rest, value = self._e[name]
        for c in rest[::-1]:
            value = c + (x * value)
        return value

    # -- angles ---------------------------------------------------------------------------------------------------

    @staticmethod
    def _difference(a: Any, b: Any) -> tuple[Any, Any]:
        r = a - b
        taken = r - a
        return r, (b + taken) - (a - (r - taken))

    def _rest(self, x: Any, n: Any) -> tuple[Any, Any]:
        part = self._e["right_angle"]
        if self.real is np.float32:
            c, first = self._difference((x - (n * part[0])) - (n * part[1]), n * part[2])
            d, second = self._difference(c, n * part[3])
            less = (first + second) + (n * part[4])
        else:
            d, first = self._difference(x - (n * part[0]), n * part[1])
            less = first + (n * part[2])
        r = d - less
        return r, (r - d) + less

    def _sine(self, x: Any, turn: int) -> Any:
        real = self.real
        zero, half, one = real(0), real(0.5), real(1)
        x = np.asarray(x, real)
        inside = np.abs(x) <= real(_ANGLE_MAX)
        c = np.where(inside, x, zero)
        k = ((np.abs(c) * self._e["two_by_pi"]) + half).astype(np.uint32)
        size = k.astype(real)
        r, less = self._rest(c, np.where(c < zero, zero - size, size))
        z = r * r
        s = r - (less - (r * (z * self._tail("sin", z))))
        h = half * z
        w = one - h
        t = w + (((one - w) - h) + (((z * z) * self._tail("cos", z)) + (r * less)))
        q = (np.where(c < zero, -k.astype(np.int64), k.astype(np.int64)) + turn) & 3
        beyond = np.where(inside, zero, np.finfo(real).max)
        return (np.choose(q, [s, t, -s, -t]) - (zero * (beyond * beyond)))[()]

    def pen_sin(self, x: Any) -> Any:
        return self._sine(x, 0)

    def pen_cos(self, x: Any) -> Any:
        return self._sine(x, 1)

    def pen_atan(self, x: Any) -> Any:
        real = self.real
        zero, one = real(0), real(1)
        x = np.asarray(x, real)
        size, sign = np.abs(x), np.where(x < zero, -one, one)
        range_ = (size > real(_NEAR)).astype(int) + (size > real(_FAR)).astype(int)
        t = np.choose(range_, [x, x - sign, -sign]) / np.choose(range_, [one, size + one, size])
        z = t * t
        bend = zero - (z * self._tail("atan", z))
        low = zero - (sign * np.choose(range_, [zero, self._e["quarter_pi_low"], self._e["half_pi_low"]]))
        high = zero - (sign * np.choose(range_, [zero, self._e["quarter_pi_high"], self._e["half_pi_high"]]))
        return (((t + ((t * bend) - low)) - high) + (zero * x))[()]

    # -- exponents ------------------------------------------------------------------------------------------------

    def _parts(self, x: Any) -> tuple[Any, Any, Any]:
        """pen_parts: exponent, significand, lifted"""
        f, real = self._format, self.real
        lifted = x < np.finfo(real).tiny
        normal = np.asarray(x * np.where(lifted, real(2.0**f.lift_bits), real(1)))
        word = normal.view(f.word) & f.word(2 ** (8 * normal.itemsize - 1) - 1)
        exponent = (word >> f.word(f.bits)).astype(np.int64)
        leading = f.word(1 << f.bits)
        return exponent, (word & (leading - f.word(1))) | leading, lifted

    def pen_log(self, x: Any) -> Any:
        f, real = self._format, self.real
        zero, half, one, two = real(0), real(0.5), real(1), real(2)
        x = np.asarray(x, real)
        exponent, significand, lifted = self._parts(x)
        upper = significand > f.word(int(2.0**0.5 * 2.0**f.bits))
        k = ((exponent.astype(real) - real(f.bias)) - np.where(lifted, real(f.lift_bits), zero)) + np.where(upper, one, zero)
        g = (significand.astype(real) * np.where(upper, real(2.0 ** -(f.bits + 1)), real(2.0**-f.bits))) - one
        s = g / (two + g)
        z = s * s
        h = half * (g * g)
        bend = (s * (h + (z * self._tail("log", z)))) + (k * self._e["log_2_low"])
        value = (k * self._e["log_2_high"]) - ((h - bend) - g)
        share = np.where(x < zero, zero, np.where(x > zero, x, x - one))
        return np.where((x > zero) & (x <= np.finfo(real).max), value, share * real(np.inf))[()]

    def pen_sqrt(self, x: Any) -> Any:
        f, real = self._format, self.real
        zero, half, one, unit = real(0), real(0.5), real(1), real(2.0**-f.bits)
        x = np.asarray(x, real)
        exponent, significand, lifted = self._parts(x)
        even = 1 - (exponent & 1)
        m = significand.astype(real) * np.where(even > 0, unit + unit, unit)
        square = significand << (f.bits + even).astype(f.word)  # modulo the size of the word, as all that follows
        y = self._tail("root", m)
        for _ in range(f.steps):
            y = y * (real(1.5) - (((half * m) * y) * y))
        near = m * y
        s = ((near + ((half * y) * (m - (near * near)))) * real(2.0**f.bits)).astype(f.word)
        rest = (square - (s * s)) + (f.word(4) * s)
        up, down = (rest > f.word(5) * s).astype(f.word), (rest <= f.word(3) * s).astype(f.word)
        root = ((s + up) - down).astype(real) * unit
        power = np.ldexp(one, (exponent + 1) // 2 - (f.bias + 1) // 2).astype(real)
        scale = power * np.where(lifted, real(2.0 ** (-f.lift_bits // 2)), one)
        beyond = np.where(x < zero, np.finfo(real).max, zero)
        other = x - (zero * (beyond * beyond))
        return np.where((x > zero) & (x <= np.finfo(real).max), root * scale, other)[()]
