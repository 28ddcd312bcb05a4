# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Functions of expressions that SymPy would rewrite as complex numbers or powers: kept whole, real, with their derivatives."""

from __future__ import annotations

from typing import Any

import sympy as sp


class Root(sp.Function):
    """Square root of a number that is not negative."""

    nargs = 1
    is_extended_real = True
    is_extended_nonnegative = True

    @classmethod
    def eval(cls, x: sp.Expr) -> sp.Expr | None:
        if x.is_Number:
            if x < 0:
                raise ValueError(f"square root of {float(x):g}")
            return sp.sqrt(x)
        return None

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return 1 / (2 * self)

    def _eval_evalf(self, prec: int) -> sp.Expr:
        return sp.sqrt(self.args[0])._eval_evalf(prec)


class Logarithm(sp.Function):
    """Natural logarithm of a number above zero."""

    nargs = 1
    is_extended_real = True

    @classmethod
    def eval(cls, x: sp.Expr) -> sp.Expr | None:
        if x.is_Number:
            if x <= 0:
                raise ValueError(f"logarithm of {float(x):g}")
            return sp.log(x)
        return None

    def fdiff(self, argindex: int = 1) -> sp.Expr:
        return 1 / self.args[0]

    def _eval_evalf(self, prec: int) -> sp.Expr:
        return sp.log(self.args[0])._eval_evalf(prec)


FUNCTIONS = {"sin": sp.sin, "cos": sp.cos, "atan": sp.atan, "sqrt": Root, "log": Logarithm}
CALLS = {function: f"pen_{name}" for name, function in FUNCTIONS.items()}  # in C, by penode/pen_elementary.h


def used(causal: Any) -> bool:
    """Does a model as straight-line code (causalise.Causal) call any of them?"""
    parts = [*causal.rates, *causal.outputs, *causal.sensors]
    for step in causal.steps:
        parts += step.parts
    return any(part.has(*CALLS) for part in parts)
