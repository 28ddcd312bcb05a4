# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Print the reference table of test/unit/test_pen_math.c: exact inputs, values of mpmath (40 digits) to 19 digits.

python test/accuracy/golden.py
"""

import mpmath as mp

mp.mp.dps = 40
POSITIVE = (
    2.0**-40,
    2.0**-12,
    0.03125,
    0.3359375,
    0.34765625,
    0.5,
    0.62109375,
    0.625,
    0.75,
    0.9921875,
    1.0,
    1.2578125,
    1.5,
    2.71875,
    5.0,
    8.8125,
    9.0,
    12.34375,
    16.625,
    17.5,
    25.25,
    50.0,
    86.9375,
)  # each exact in float


def row(value: float) -> str:
    """One line of the table: {x, e^x, tanh, sigmoid, softplus}."""
    x = mp.mpf(value)
    exact = (mp.exp(x), mp.tanh(x), 1 / (1 + mp.exp(-x)), mp.log1p(mp.exp(x)))
    return f"    {{{value!r}, " + ", ".join(mp.nstr(e, 19, min_fixed=0, max_fixed=0) for e in exact) + "},"


if __name__ == "__main__":
    print("\n".join(row(value) for value in (*(-p for p in reversed(POSITIVE)), *POSITIVE)))
