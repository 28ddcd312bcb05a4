# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Largest error of the double build of pen_math on a dense sample, against mpmath (60 digits).

    gcc -std=c99 -O2 -ffp-contract=off -DPEN_REAL_DOUBLE -Iinc -Iport/gnu -shared -fPIC src/pen_math.c -o LIBRARY.so
    python test/accuracy/double_error.py LIBRARY.so [POINTS]

Error as in pen_math_accuracy.c: |result - exact| over the distance of neighbouring doubles at the exact value.
Points: half of them evenly over the range where a function is neither 0 nor saturated, half by magnitude from 2^-60 up.
Exit code 1 above 2 ulp.
"""

import ctypes
import sys
from collections.abc import Callable
from dataclasses import dataclass

import mpmath as mp
import numpy as np

mp.mp.dps = 60
BOUND = 2.0  # ulp, what pen_math.h promises


@dataclass(frozen=True)
class Subject:
    """A function and where it is worth looking at."""

    name: str
    exact: Callable[[mp.mpf], mp.mpf]
    low: float
    high: float


SUBJECTS = (
    Subject("pen_exp", mp.exp, -745.0, 709.7),
    Subject("pen_tanh", mp.tanh, -20.0, 20.0),
    Subject("pen_sigmoid", lambda x: 1 / (1 + mp.exp(-x)), -745.0, 40.0),
    Subject("pen_softplus", lambda x: mp.log1p(mp.exp(x)), -745.0, 40.0),
)


def ulps(result: float, exact: mp.mpf) -> float:
    """Error in units of the last place of the exact value."""
    exponent = max(int(mp.frexp(exact)[1]), -1021)
    return float(abs(mp.mpf(result) - exact) * mp.mpf(2) ** (53 - exponent))


def sample(subject: Subject, points: int) -> np.ndarray:
    """Inputs, shape (points,); the same in every run."""
    random = np.random.default_rng(1)
    even = random.uniform(subject.low, subject.high, points // 4)
    bend = random.uniform(-2.0, 2.0, points // 4)
    size = np.exp2(random.uniform(-60.0, np.log2(-subject.low), points // 2))
    signed = size * random.choice([-1.0, 1.0], size.shape)
    return np.concatenate([even, bend, signed[signed < subject.high]])


def main() -> int:
    """Measure all functions; 0 if each keeps the bound."""
    if len(sys.argv) < 2:
        print("usage: double_error.py LIBRARY [POINTS]", file=sys.stderr)
        return 2
    library = ctypes.CDLL(sys.argv[1])
    points = int(sys.argv[2]) if len(sys.argv) > 2 else 100_000
    failed = False
    for subject in SUBJECTS:
        function = getattr(library, subject.name)
        function.restype, function.argtypes = ctypes.c_double, [ctypes.c_double]
        inputs = sample(subject, points)
        errors = [ulps(function(x), subject.exact(mp.mpf(x))) for x in inputs.tolist()]
        worst = int(np.argmax(errors))
        failed |= errors[worst] > BOUND
        where = float(inputs[worst])
        print(f"{subject.name:13} double: max error {errors[worst]:.4f} ulp at {where!r} ({len(inputs)} points)")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
