# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Derive the polynomial coefficients of src/pen_math.c and print them as C.

    python test/accuracy/coefficients.py                          prints the constants and the C functions
    python test/accuracy/coefficients.py --check src/pen_math.c   exit code 1 if one of them is not in the file

Each polynomial is the minimax one (Remez exchange) in 60-digit arithmetic, then its coefficients are rounded to the
target type. The leading terms (1, x, x/2 ...) are fixed, so the rounding of the others is multiplied by something
small. The printed error is the relative error of the whole function that remains after this rounding, in units of
half an ulp of 1.
"""

import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import mpmath as mp
import numpy as np

mp.mp.dps = 60
Function = Callable[[mp.mpf], mp.mpf]
LN2 = mp.log(2)
PRECISION = {"float": 24, "double": 53}  # bits of the significand
EXPONENT_BITS = {"float": 8, "double": 11}  # n of e^x = 2^n (1 + p): |n| <= 150, 1075


@dataclass(frozen=True)
class Fit:
    """One polynomial: approximates `target` on [low, high]; error times `weight` is the function's relative error."""

    name: str
    formula: str
    target: Function
    weight: Function
    low: mp.mpf
    high: mp.mpf
    terms: dict[str, int]  # real type -> number of coefficients


def polynomial(coefficients: list[mp.mpf], x: mp.mpf) -> mp.mpf:
    """Value at x, lowest power first."""
    return mp.polyval(coefficients[::-1], x)


def remez(fit: Fit, terms: int) -> list[mp.mpf]:
    """Minimax coefficients, lowest power first; stops when the extremes of the error agree to 1 %."""
    middle, half = (fit.low + fit.high) / 2, (fit.high - fit.low) / 2
    nodes = [middle - half * mp.cos(mp.pi * (2 * i + 1) / (2 * terms + 2)) for i in range(terms + 1)]
    grid = [middle - half * mp.cos(mp.pi * i / (40 * terms)) for i in range(40 * terms + 1)]
    for _ in range(20):
        rows = [[x**k for k in range(terms)] + [(-1) ** i / fit.weight(x)] for i, x in enumerate(nodes)]
        *coefficients, level = mp.lu_solve(mp.matrix(rows), mp.matrix([fit.target(x) for x in nodes]))
        error = [fit.weight(x) * (fit.target(x) - polynomial(coefficients, x)) for x in grid]
        nodes = alternating_extremes(grid, error, terms + 1)
        if max(abs(e) for e in error) < abs(level) * mp.mpf("1.01"):
            return coefficients
    raise ArithmeticError(f"{fit.name}: the exchange did not settle")


def alternating_extremes(grid: list[mp.mpf], error: list[mp.mpf], count: int) -> list[mp.mpf]:
    """The `count` neighbouring extremes of alternating sign, the smaller end ones dropped first."""
    best: list[int] = []
    for i, e in enumerate(error):
        if best and (error[best[-1]] > 0) == (e > 0):
            best[-1] = max(best[-1], i, key=lambda k: abs(error[k]))
        else:
            best.append(i)
    while len(best) > count:
        best.pop(0 if abs(error[best[0]]) < abs(error[best[-1]]) else -1)
    return [grid[i] for i in best]


def expm1_tail(r: mp.mpf) -> mp.mpf:
    """(e^r - 1 - r) / r^2 without cancellation: 1/2 + r/6 + ..."""
    return mp.nsum(lambda k: r**k / mp.factorial(k + 2), [0, 40])


def tanh_tail(z: mp.mpf) -> mp.mpf:
    """(1 - tanh(a)/a) / a^2 at z = a^2; 1/3 at 0."""
    a = mp.sqrt(z)
    return mp.mpf(1) / 3 if z < mp.mpf(10) ** -20 else (1 - mp.tanh(a) / a) / z


def softplus_tail(z: mp.mpf) -> mp.mpf:
    """(softplus(x) - log 2 - x/2) / x^2 at z = x^2; 1/8 at 0."""
    x = mp.sqrt(z)
    return mp.mpf(1) / 8 if z < mp.mpf(10) ** -20 else mp.log(mp.cosh(x / 2)) / z


def log1p_tail(e: mp.mpf) -> mp.mpf:
    """(log(1 + e) - e) / e^2; -1/2 at 0."""
    return mp.mpf(-1) / 2 if e < mp.mpf(10) ** -20 else (mp.log1p(e) - e) / (e * e)


FITS = (
    # |r| reaches log(2)/2 plus what the rounding of x * log2(e) + bias adds: 2^-15 (float: 277 leaves 15 bits to it).
    Fit(
        "expm1",
        "e^r = 1 + r + r^2 P(r)",
        expm1_tail,
        lambda r: r * r / mp.exp(r),
        -LN2 / 2 - mp.mpf(2) ** -15,
        LN2 / 2 + mp.mpf(2) ** -15,
        {"float": 5, "double": 11},
    ),
    Fit(
        "tanh",
        "tanh(x) = x - x z P(z), z = x^2",
        tanh_tail,
        lambda z: z if z == 0 else z * mp.sqrt(z) / mp.tanh(mp.sqrt(z)),
        mp.mpf(0),
        mp.mpf("0.625") ** 2,
        {"float": 5, "double": 11},
    ),
    Fit(
        "softplus",
        "softplus(x) = log(2) + x/2 + z P(z), z = x^2",
        softplus_tail,
        lambda z: z / mp.log1p(mp.exp(-mp.sqrt(z))),  # of the smaller value, at -x
        mp.mpf(0),
        mp.mpf(1),
        {"float": 5, "double": 11},
    ),
    Fit(
        "log1p",
        "log(1 + e) = e + e^2 P(e)",
        log1p_tail,
        lambda e: e if e == 0 else e * e / mp.log1p(e),
        mp.mpf(0),
        mp.exp(-1),
        {"float": 7, "double": 16},
    ),
)


def rounded(value: mp.mpf, real: str) -> float:
    """The nearest number of the type."""
    return float(np.float32(float(value))) if real == "float" else float(value)


def literal(value: float, real: str) -> str:
    """Shortest C literal that reads back as the same number."""
    return f"{np.float32(value)!s}F" if real == "float" else repr(value)


def two_parts(value: mp.mpf, bits: int, real: str) -> tuple[float, float]:
    """value = high + low; high has at most `bits` significant bits, so that high * n is exact for small whole n."""
    scale = mp.mpf(2) ** (bits - 1 - int(mp.floor(mp.log(value, 2))))
    high = mp.nint(value * scale) / scale
    return float(high), rounded(value - high, real)


def horner(coefficients: list[float], real: str, variable: str) -> str:
    """C expression of the polynomial, wrapped at 140 columns."""
    first, *middle, last = [literal(c, real) for c in coefficients]
    close = ")" * (2 * len(middle) + 1)
    parts = [f"{first} + ", *[f"({variable} * ({c} + " for c in middle], f"({variable} * {last}{close}"]
    lines = [""]
    for part in parts:
        if len(lines[-1]) + len(part) > 129:
            lines.append("")
        lines[-1] += part
    return ("\n" + " " * 11).join(line.rstrip() for line in lines)


def c_function(fit: Fit, real: str) -> str:
    """The C function of one polynomial, with its error in a comment."""
    coefficients = [rounded(c, real) for c in remez(fit, fit.terms[real])]
    grid = [fit.low + (fit.high - fit.low) * i / 1000 for i in range(1001)]
    exact = [mp.mpf(c) for c in coefficients]
    worst = max(abs(fit.weight(x) * (fit.target(x) - polynomial(exact, x))) for x in grid) * 2 ** PRECISION[real]
    variable = fit.formula[fit.formula.index("P(") + 2]
    return (
        f"/* {fit.formula}; relative error {mp.nstr(worst, 2)} * 2^-{PRECISION[real]} */\n"
        f"static pen_real_t {fit.name}_tail(pen_real_t {variable})\n"
        f"{{\n    return {horner(coefficients, real, variable)};\n}}\n"
    )


def constants(real: str) -> list[str]:
    """The C constants of the range reduction, one line each."""
    high, low = two_parts(LN2, PRECISION[real] - EXPONENT_BITS[real], real)
    values = {"LOG2_E": rounded(1 / LN2, real), "LN2": rounded(LN2, real), "LN2_HIGH": high, "LN2_LOW": low}
    return [f"#define {name} {literal(value, real)}" for name, value in values.items()]


def spaced(text: str) -> str:
    """The text with one space where there are several, or a line ends: a formatter may align constants."""
    return " ".join(text.split())


def main() -> int:
    """Print the C text, or say which part of it the file named after --check lacks."""
    parts = [part for real in PRECISION for part in (*constants(real), *(c_function(fit, real) for fit in FITS))]
    if sys.argv[1:2] != ["--check"]:
        print("\n".join(parts))
        return 0
    source = spaced(Path(sys.argv[2]).read_text())
    missing = [part for part in parts if spaced(part) not in source]
    print(f"{sys.argv[2]}: {len(parts) - len(missing)} of {len(parts)} constants and polynomials are the derived ones")
    print("\n".join(missing), end="")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
