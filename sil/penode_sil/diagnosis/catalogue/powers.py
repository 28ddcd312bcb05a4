# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Curves that are a power of the deflection or the rate, of any exponent."""

from .form import Part

NOTE = "as a power"


def odd(of: str, reach: tuple[float, str], exponent: float, sign: int = 0) -> Part:
    """force*x*|x|^(exponent - 1), with x the deflection or rate `of` over its `reach`, and its unit. Rounded below a thousandth of that: a
    logarithm has no value at 0. A fit takes exponents beyond 1 by a third of what they start from, to three times that. `sign`: of the
    force; 0 for either."""
    text, shapes = f"force*{of}/reach*exp(beyond*log(({of}/reach)^2 + 1e-6)/2)", {"beyond": (exponent - 1.0, "1"), "reach": reach}
    return Part(text, ("force", "N"), shapes, sign, fixed=("reach",), span=3.0)
