# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A late signal in a model file: the states and equations of its delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .entries import table, toml

SHORT = 0.02  # of a sample: shorter delays are no cause, and not written
ONE_POLE = 0.48  # of a delay squared: beyond that the second pole of a filter is 50 times as fast as the first


@dataclass(frozen=True)
class Late:
    """The `expression` of a signal that is late, and the entries that it needs: a parameter, states, equations."""

    expression: str
    parameter: str
    states: tuple[str, ...]
    equations: tuple[str, ...]


def written(expression: str, names: Sequence[str], unit: str, delay: float, roll_off: float = 0.0) -> Late:
    """An expression in `unit`, delayed by `delay` [s]. `roll_off`: second-order attenuation, in units of delay^2 (see `poles`). `names`: of
    the delay, the delayed signal, and its rate times the delay."""
    time, late, rate = names
    stiff, drag, direct, own = poles(roll_off)
    slope = rate if stiff else f"{expression} - {late}"
    equations = [f"{late} = {toml(f'der({late})*{time} = {slope}')}"]
    if stiff:
        equations.append(f"{rate} = {toml(f'der({rate})*{time} = {stiff:.7g}*({expression} - {late}) - {drag:.7g}*{rate}')}")
    states = tuple(f"{state} = {table({'unit': unit})}" for state in ((late, rate) if stiff else (late,)))
    if direct == 1.0:
        seen = f"{expression} - {rate}"
    else:
        seen = f"{late} + {direct:.7g}*({expression} - {late}) - {own:.7g}*{rate}" if direct else late
    return Late(seen, f"{time} = {table({'value': delay, 'unit': 's'})}", states, tuple(equations))


def substeps(delay: float, roll_off: float, step: float) -> int:
    """Substeps per sample of `step` [s] for which the fastest pole of a delay [s] times the substep is at most 1."""
    return int(np.ceil(fastest(roll_off) * step / delay))


def fastest(roll_off: float) -> float:
    """The faster pole of a delay's states, or the one of one, times the delay."""
    stiff, drag, _, _ = poles(roll_off)
    return float(np.max(np.abs(np.roots([1.0, drag, stiff])))) if stiff else 1.0


def poles(roll_off: float) -> tuple[float, float, float, float]:
    """A delay with a roll-off (of its square, see faulty.delayed) in two states, x*late = rate and x*rate = stiff*(u - late) - drag*rate
    with x = s*delay: late + direct*(u - late) - own*rate. Two poles are themselves; one of them alone (all 0: x*late = u - late) if
    the other is far faster. With less roll-off, Pade's fraction of order 2 of exp(-x) (1 + roll_off x^2): 12, 6, 1, 1 without any."""
    if roll_off > ONE_POLE:
        return 0.0, 0.0, 0.0, 0.0
    if roll_off > 1.0 / 6.0:
        stiff = 1.0 / (0.5 - roll_off)
        return stiff, stiff, 0.0, 0.0
    x2, x3, x4 = 1.0 / 2.0 + roll_off, -1.0 / 6.0 - roll_off, 1.0 / 24.0 + roll_off / 2.0
    d1, d2 = np.linalg.solve([[x2, -1.0], [x3, x2]], [-x3, -x4])
    direct = (x2 - d1 + d2) / d2
    return 1.0 / d2, d1 / d2, float(np.round(direct, 12)), 1.0 - d1 + direct * d1
