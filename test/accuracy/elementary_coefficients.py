# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Derive the constants of pen_sin, pen_cos, pen_atan, pen_log and pen_sqrt and print them as C.

    python test/accuracy/elementary_coefficients.py                    prints the constants and the C functions
    python test/accuracy/elementary_coefficients.py --check src/*.c    exit code 1 if one of them is in none of the files

The polynomials are found as in coefficients.py.
"""

import sys
from pathlib import Path

import mpmath as mp
from coefficients import LN2, PRECISION, Fit, c_function, literal, rounded, spaced, two_parts

LIMIT = 8192  # rad; what pen_elementary.h states for sin and cos
LIMIT_BITS = 13  # of n, the number of right angles in it: 5215
# |r| reaches pi/4 plus what the rounding of x * 2/pi + 1/2 adds: in float three roundings of 2^-12 in n at most.
QUARTER = mp.pi / 4 + 3 * mp.mpf(2) ** -12 * mp.pi / 2
NEAR = mp.mpf("0.5463")  # tan(1/2): from there on the angle is above 1/2, so that an ulp of it is twice as large
SINE = mp.mpf(10) ** -12  # below, the series' first terms are more exact than 60 digits of a difference
LOG_RATIO = ((mp.sqrt(2) - 1) / (mp.sqrt(2) + 1)) ** 2 * (1 + mp.mpf(2) ** -20)


def sin_tail(z: mp.mpf) -> mp.mpf:
    """(sin(r)/r - 1) / z at z = r^2; -1/6 at 0."""
    r = mp.sqrt(z)
    return mp.mpf(-1) / 6 + z / 120 if z < SINE else (mp.sin(r) / r - 1) / z


def cos_tail(z: mp.mpf) -> mp.mpf:
    """(cos(r) - 1 + z/2) / z^2 at z = r^2; 1/24 at 0."""
    return mp.mpf(1) / 24 - z / 720 if z < SINE else (mp.cos(mp.sqrt(z)) - 1 + z / 2) / (z * z)


def atan_tail(z: mp.mpf) -> mp.mpf:
    """(1 - atan(t)/t) / z at z = t^2; 1/3 at 0."""
    t = mp.sqrt(z)
    return mp.mpf(1) / 3 - z / 5 if z < SINE else (1 - mp.atan(t) / t) / z


def log_tail(z: mp.mpf) -> mp.mpf:
    """(log((1 + s)/(1 - s))/s - 2) / z at z = s^2; 2/3 at 0."""
    s = mp.sqrt(z)
    return mp.mpf(2) / 3 + 2 * z / 5 if z < SINE else (mp.log((1 + s) / (1 - s)) / s - 2) / z


def per_root(z: mp.mpf, function) -> mp.mpf:
    """sqrt(z) / function(sqrt(z)); 1 at 0."""
    return mp.mpf(1) if z < SINE else mp.sqrt(z) / function(mp.sqrt(z))


FITS = (
    Fit(
        "sin",
        "sin(r) = r + r z P(z), z = r^2",
        sin_tail,
        lambda z: z * per_root(z, mp.sin),
        mp.mpf(0),
        QUARTER**2,
        {"float": 3, "double": 6},
    ),
    Fit(
        "cos",
        "cos(r) = 1 - z/2 + z^2 P(z), z = r^2",
        cos_tail,
        lambda z: z * z / mp.cos(mp.sqrt(z)),
        mp.mpf(0),
        QUARTER**2,
        {"float": 3, "double": 6},
    ),
    Fit(
        "atan",
        "atan(t) = t - t z P(z), z = t^2",
        atan_tail,
        lambda z: z * per_root(z, mp.atan),
        mp.mpf(0),
        NEAR**2,
        {"float": 6, "double": 15},
    ),
    Fit(
        "log",
        "log((1 + s)/(1 - s)) = 2 s + s z P(z), z = s^2",
        log_tail,
        lambda z: z * per_root(z, lambda s: mp.log((1 + s) / (1 - s))),
        mp.mpf(0),
        LOG_RATIO,
        {"float": 3, "double": 7},
    ),
    Fit("root", "1/sqrt(m) = P(m)", lambda m: 1 / mp.sqrt(m), mp.sqrt, mp.mpf(1), mp.mpf(4), {"float": 4, "double": 4}),
)


def right_angle(real: str) -> list[float]:
    """pi/2 as a sum: n times each part is exact, but for the last."""
    rest, found = mp.pi / 2, []
    for _ in range({"float": 4, "double": 2}[real]):
        part = two_parts(rest, PRECISION[real] - LIMIT_BITS, real)[0]
        found.append(part)
        rest -= part
    return [*found, rounded(rest, real)]


def constants(real: str) -> list[str]:
    """The C constants of the reductions, one line each."""
    values = {f"RIGHT_ANGLE_{i}": part for i, part in enumerate(right_angle(real), 1)}
    values["TWO_BY_PI"] = rounded(2 / mp.pi, real)
    for name, angle in (("HALF_PI", mp.pi / 2), ("QUARTER_PI", mp.pi / 4)):
        high = rounded(angle, real)
        values |= {f"{name}_HIGH": high, f"{name}_LOW": rounded(angle - high, real)}
    high, low = two_parts(LN2, PRECISION[real] - {"float": 8, "double": 11}[real], real)
    values |= {"LOG_2_HIGH": high, "LOG_2_LOW": low}
    return [f"#define {name} {literal(value, real)}" for name, value in values.items()]


def main() -> int:
    """Print the C text, or the part of it that the files after --check lack."""
    parts = [part for real in PRECISION for part in (*constants(real), *(c_function(fit, real) for fit in FITS))]
    if sys.argv[1:2] != ["--check"]:
        print("\n".join(parts))
        return 0
    source = spaced("".join(Path(name).read_text() for name in sys.argv[2:]))
    missing = [part for part in parts if spaced(part) not in source]
    print(f"{len(parts) - len(missing)} of {len(parts)} constants and polynomials are the derived ones")
    print("\n".join(missing), end="")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
