# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Units at the edge: texts like "10 mm" become SI numbers; everything inside is SI. Unit names as in model files."""

from __future__ import annotations

import math

from penode_gen import units as _units
from penode_gen.units import UnitError

__all__ = ["UnitError", "factor", "quantity"]


def factor(unit: str, like: str | None = None) -> float:
    """How many SI units one `unit` is; UnitError if it measures something else than `like`."""
    unit, like = _plain(unit), None if like is None else _plain(like)
    try:
        fits = like is None or _units.same_dimension(unit, like)
    except UnitError as exc:
        raise UnitError(f"{exc}; {exc.instead or 'write it like mm, m/s^2 or N*s/m'}") from exc
    if not fits:
        raise UnitError(f"{'a plain number' if unit == '1' else unit} cannot be turned into {like}; give it in {like}")
    return _units.factor(unit)


def _plain(unit: str) -> str:
    return "1" if unit.strip() in ("", "-") else unit


def quantity(value: object, like: str) -> float:
    """A text with its unit as a finite SI number that measures what `like` does; a plain number only if that is "1"."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        number = float(value) * factor("1", like)
    elif isinstance(value, str):
        try:
            number, unit = _units.quantity(value)
        except UnitError as exc:
            remedy = exc.instead or f'write a number and its unit, like "1 {like}"'
            raise UnitError(f"{exc}; {remedy}") from exc
        factor(unit, like)
    else:
        raise UnitError(f'{value!r} is no quantity; write a number and its unit, like "1 {like}"')
    if not math.isfinite(number):
        raise UnitError(f"{value!r} is not finite; give a finite number")
    return number
