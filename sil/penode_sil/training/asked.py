# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Whether a recording means what the model file takes it for: signs, units, and channels that are exchanged.

A fit that does not come down to the noise may have been given a road in millimetres, or a sensor that counts the other way. Straight lines
in place of the networks see that at once: with the one change made, they leave far less of the signals. So each likely change is tried on
them, and one that explains the recordings where none did before is asked about."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from . import left, lines
from .data import Record, at_first
from .port import Port
from .problem import Problem

Array = NDArray[np.float64]
OTHERS = {"m": "mm", "m/s": "mm/s", "m/s^2": "g", "rad": "deg", "rad/s": "deg/s"}  # what is mistaken for units of SI


@dataclass(frozen=True, eq=False)
class Change:
    """What may be meant: each record otherwise, asked in words, with its remedy."""

    what: str
    remedy: str
    apply: Callable[[Record], Record]


def question(problem: Problem, ports: Sequence[Port]) -> str:
    """A question about the recordings; empty if no change explains them much better."""
    short = tuple(r.first(lines.rows(problem) // 4) for r in problem.records)
    before, found = _score(problem, ports, short), []
    for change in _changes(problem.model, short):
        score = _score(problem, ports, tuple(change.apply(r) for r in short))
        if np.log2(min(before, 1.0) / score) > 1.0:  # less than half of it is left
            found.append((score, change))
    if not found:
        return ""
    score, change = min(found, key=lambda f: f[0])
    return (
        f"{change.what}? so changed, a linear model leaves {100.0 * score:.2g} % of the recorded signals unexplained, as recorded "
        f"{100.0 * min(before, 1.0):.3g} %; {change.remedy}"
    )


def _score(problem: Problem, ports: Sequence[Port], records: tuple[Record, ...]) -> float:
    """What lines leave of the signals: geometric mean of the residuals over the signals' standard deviations, 1 where they diverge."""
    own = problem.with_(records=records, noise=at_first(problem.model, records, problem.engine.signals))
    try:
        own, point = lines.simple(own, ports)
    except FloatingPointError:
        return 1.0
    found = left.of(own, point)
    return 1.0 if found is None else float(np.exp(np.nanmean(np.log(np.maximum(found.share, 1e-6)))))


def _changes(model: Model, records: Sequence[Record]) -> list[Change]:
    """All that are tried: each channel negated, in its other unit, alone or with all of its kind, and two of a kind exchanged."""
    inputs = [(i.name, i.unit, k) for k, i in enumerate(model.inputs)]
    shown = [(s.name, s.unit, j) for j, s in enumerate((*model.sensors, *model.outputs)) if any(r.good[:, j].any() for r in records)]
    found = []
    for group, where in ((inputs, _INPUT), (shown, _SIGNAL)):
        for name, _, k in group:
            remedy = "reverse its sign in the recording, or where the model file uses it"
            found.append(Change(f"has {name} the wrong sign", remedy, _times(where, (k,), -1.0)))
        for unit, other in OTHERS.items():
            alike, factor = [(name, k) for name, own, k in group if own == unit], _factor(other)
            for some in (*((a,) for a in alike), *([tuple(alike)] if len(alike) > 1 else [])):
                names = " and ".join(name for name, _ in some)
                options = " ".join(f"--channel '{name}={name} [{other}]'" for name, _ in some)
                change = _times(where, tuple(k for _, k in some), factor)
                found.append(Change(f"{'is' if len(some) == 1 else 'are'} {names} in {other}", f"say so: {options}", change))
        for (name, unit, i), (second, unit2, j) in itertools.combinations(group, 2):
            if units.same_dimension(unit, unit2):
                remedy = f"say so: --channel {name}={second} --channel {second}={name}"
                found.append(Change(f"are {name} and {second} exchanged", remedy, _exchanged(where, i, j)))
    return found


def _factor(unit: str) -> float:
    """In SI; g is gravity here, as it is for the recordings."""
    return units.factor("standard_gravity" if unit == "g" else unit)


_INPUT, _SIGNAL = "input", "signal"


def _changed(record: Record, where: str, by: Callable[[Array], Array]) -> Record:
    """A record whose inputs or signals, in the last axis, are changed."""
    if where == _SIGNAL:
        return replace(record, y=by(record.y), good=by(record.good.astype(float)) != 0.0)
    u, between = (np.ascontiguousarray(by(a)) for a in (record.drive.u, record.drive.between))
    return replace(record, drive=replace(record.drive, u=u, between=between))


def _times(where: str, at: tuple[int, ...], factor: float) -> Callable[[Record], Record]:
    def by(values: Array) -> Array:
        found = values.copy()
        found[..., list(at)] *= factor
        return found

    return lambda record: _changed(record, where, by)


def _exchanged(where: str, i: int, j: int) -> Callable[[Record], Record]:
    def by(values: Array) -> Array:
        order = np.arange(values.shape[-1])
        order[[i, j]] = j, i
        return np.asarray(values[..., order])

    return lambda record: _changed(record, where, by)
