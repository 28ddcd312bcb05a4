# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A late signal in a model file: the states and equations of its delay."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .entries import table, toml

SHORT = 0.05  # of a sample: shorter delays are no cause, and not written: inputs between rows are not known that well
STIFF, DRAG = 12, 6  # of its states


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
        f"{rate} = {toml(f'der({rate})*{time} = {STIFF}*({expression} - {late}) - {DRAG}*{rate}')}",
    )
    states = tuple(f"{state} = {table({'unit': unit})}" for state in (late, rate))
    return Late(f"{expression} - {rate}", f"{time} = {table({'value': delay, 'unit': 's'})}", states, equations)


def substeps(delay: float, step: float) -> int:
    """Substeps per sample of `step` [s] for which the poles of a delay [s] times the substep are at most 1."""
    return int(np.ceil(np.sqrt(STIFF) * step / delay))
