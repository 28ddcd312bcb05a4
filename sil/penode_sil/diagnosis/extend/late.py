# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A late signal in a model file: the states and equations of its delay, or of its lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .entries import table, toml

SHORT = 0.05  # of a sample: shorter delays are no cause, and not written: inputs between rows are not known that well


@dataclass(frozen=True)
class Late:
    """The `expression` of a signal that is late, and the entries that it needs: a parameter, states, equations."""

    expression: str
    parameter: str
    states: tuple[str, ...]
    equations: tuple[str, ...]


def written(expression: str, names: Sequence[str], unit: str, delay: float) -> Late:
    """An expression in `unit`, delayed by `delay` [s]: Pade's fraction of order 2, u - rate with x*late = rate and x*rate = 12*(u - late)
    - 6*rate, where x is s*delay. `names`: of the delay, the delayed signal, and its rate times the delay."""
    time, late, rate = names
    equations = (
        f"{late} = {toml(f'der({late})*{time} = {rate}')}",
        f"{rate} = {toml(f'der({rate})*{time} = 12*({expression} - {late}) - 6*{rate}')}",
    )
    states = tuple(f"{state} = {table({'unit': unit})}" for state in (late, rate))
    return Late(f"{expression} - {rate}", f"{time} = {table({'value': delay, 'unit': 's'})}", states, equations)


def lagging(expression: str, names: Sequence[str], unit: str, lag: float) -> Late:
    """An expression in `unit` behind a first-order lag [s]. `names`: of the lag, and the lagging signal."""
    time, late = names
    equation = f"{late} = {toml(f'der({late})*{time} = {expression} - {late}')}"
    return Late(late, f"{time} = {table({'value': lag, 'unit': 's'})}", (f"{late} = {table({'unit': unit})}",), (equation,))


def substeps(delay: float, step: float) -> int:
    """Substeps per sample of `step` [s] for which the poles of a delay [s], or of a lag, times the substep are at most 1."""
    return int(np.ceil(np.sqrt(12.0) * step / delay))


HOW = {"late": (("delay", "late", "late_rate"), written), "lag": (("delay", "late"), lagging)}  # of a form: stems of names, and the writer
