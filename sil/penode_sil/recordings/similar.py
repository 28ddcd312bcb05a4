# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which columns may be those that a model asks for: by words of their names and by what they measure."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from . import named, unit_text
from .units import UnitError

# words for one quantity; the first letters of a word count as well
KINDS = (
    "a acc accel acceleration beschl beschleunigung",
    "v vel velocity speed rate geschw",
    "f force kraft load",
    "m tau torque moment drehmoment trq",
    "z x y s pos position height displacement disp weg hoehe level travel",
    "phi q angle winkel theta alpha rot",
    "w n omega speed rate drehzahl gyro",
    "road street ground strasse",
    "wheel rad hub unsprung",
    "body chassis aufbau sprung",
    "deflection defl travel federweg susp suspension stroke",
    "t time zeit",
    "p pressure druck",
    "u voltage spannung",
    "i current strom",
)
SAME = [frozenset(kind.split()) for kind in KINDS]


def proposals(
    missing: Mapping[str, str], free: Mapping[str, str | None], names: Mapping[str, str], least: float = 0.4
) -> dict[str, tuple[str, str]]:
    """For names of a model (name -> unit), of columns (key -> unit; key -> name): the column to propose and why, where there is
    one. Each column once; those that measure something else never. A column is proposed by its name if it repeats the share `least`."""
    from scipy.optimize import linear_sum_assignment  # slow to load

    wanted, columns = list(missing), list(free)
    if not wanted or not columns:
        return {}
    fits = np.array([[fit(free[key], missing[name]) for key in columns] for name in wanted])
    like = np.array([[likeness(name, names[key]) for key in columns] for name in wanted])
    score = np.where(fits < 0, -10.0, like + 0.3 * np.maximum(fits, 0))
    found: dict[str, tuple[str, str]] = {}
    for i, j in np.column_stack(linear_sum_assignment(-score)).tolist():
        if fits[i, j] >= 0 and like[i, j] >= least:
            found[wanted[i]] = (columns[j], "by its name")
    used = {column for column, _ in found.values()}
    for i, name in enumerate(wanted):
        left = [key for j, key in enumerate(columns) if fits[i, j] > 0 and key not in used]
        rivals = [other for k, other in enumerate(wanted) if other not in found and left and fits[k, columns.index(left[0])] > 0]
        if name not in found and len(left) == 1 and rivals == [name]:
            found[name] = (left[0], "the only one left with such a unit")
            used.add(left[0])
    return found


def remedy(name: str, unit: str, free: Mapping[str, str | None]) -> str:
    """What to say for a channel that is not found: the option for the most similar of the columns (key -> unit), or for any."""
    likely = proposals({name: unit}, free, {key: key for key in free})
    if name not in likely:
        return f"say {named.option(name, 'COLUMN')} if it is one of these"
    column, _ = likely[name]
    return f"say {named.option(name, column if free[column] is not None else f'{column} [{unit or 1}]')} if it is that"


def fit(given: str | None, asked: str) -> int:
    """1 if a unit measures what is asked for, 0 if there is none, -1 if it measures something else."""
    if given is None or given.strip() in ("", "-", "?"):
        return 0
    try:
        unit_text.scale(given, asked)
    except UnitError as exc:
        return 0 if "may be" in str(exc) else -1
    return 1


def likeness(name: str, column: str) -> float:
    """The share [0, 1] of a name that the words of a column repeat; long words count more."""
    mine, theirs = _words(name), _words(column)
    weights = [min(len(word), 4) for word in mine]
    best = [max((_alike(word, other) for other in theirs), default=0.0) for word in mine]
    repeated = sum(w * b for w, b in zip(weights, best, strict=True)) / max(1, sum(weights))
    return repeated - 0.02 * max(0, len(theirs) - len(mine))


def _words(name: str) -> list[str]:
    plain = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    return re.findall(r"[^\W\d_]+", plain.casefold()) or [plain.casefold()]


def _alike(a: str, b: str) -> float:
    if a == b:
        return 1.0
    if any(a in kind and b in kind for kind in SAME):
        return 0.8
    return 0.6 if a.startswith(b) or b.startswith(a) else 0.0
