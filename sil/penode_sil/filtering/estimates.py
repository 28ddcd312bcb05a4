# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a filter gives, sample by sample, whatever it ran on."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from penode_gen.algebra.mechanics import state_unit
from penode_gen.errors import ModelError
from penode_gen.flags import FILTER_FLAGS, FLAGS as STEP_FLAGS
from penode_gen.model import Filter, Model

VERDICTS = ("not_offered", "used", "missing", "refused")
FLAGS = {name: 1 << (len(STEP_FLAGS) + at) for at, name in enumerate(FILTER_FLAGS)}  # name -> PEN_EKF_... of pen_ekf.h

Array = NDArray[Any]


@dataclass(frozen=True, eq=False)
class Estimates:
    """
    One row a sample, SI. `values` and `deviations` [n, .] are those of signals(); `innovation`, `variance`, `ratio` and `verdict`
    [n, measurements]; `counts` [measurements, VERDICTS]; `status` [n] as the C returns it.
    """

    values: Array
    deviations: Array
    innovation: Array
    variance: Array
    ratio: Array
    verdict: NDArray[np.uint32]
    status: NDArray[np.uint32]
    counts: NDArray[np.uint32]


def of(model: Model) -> Filter:
    """The filter of a model. Raises ModelError if its file has none."""
    if model.filter is None:
        raise ModelError([f"{model.path}: has no [filter]; add one, as gen/README.md describes it"])
    return model.filter


def signals(model: Model) -> Iterator[tuple[str, str, str]]:
    """Kind (x, u, y, z, p), name and unit of the columns of `values`, in the order of NAME_ekf_estimate_t."""
    yield from (("x", name, state_unit(model, name)) for name in model.states)
    yield from (("u", i.name, i.unit) for i in model.inputs)
    yield from (("y", s.name, s.unit) for s in model.outputs)
    yield from (("z", s.name, s.unit) for s in model.sensors)
    yield from (("p", p.name, model.parameters[p.name].unit) for p in of(model).parameters)


def named(model: Model) -> list[tuple[int, str, str]]:
    """Column, name and unit of the estimates, each quantity once: outputs, sensors, estimated inputs, parameters, other states."""
    own, rank = {i.name for i in of(model).inputs}, "yzupx"
    columns = [(rank.index(kind), at, name, unit) for at, (kind, name, unit) in enumerate(signals(model)) if kind != "u" or name in own]
    found: dict[str, tuple[int, str, str]] = {}
    for _, at, name, unit in sorted(columns):
        found.setdefault(name, (at, name, unit))
    return list(found.values())


def joined(parts: list[Estimates]) -> Estimates:
    """Stretches of one run, one after the other."""
    names = ("values", "deviations", "innovation", "variance", "ratio", "verdict", "status")
    whole = [np.concatenate([getattr(part, name) for part in parts]) for name in names]
    verdict = whole[5]
    counts = np.array([np.bincount(v, minlength=len(VERDICTS)) for v in verdict.T], np.uint32)
    return Estimates(whole[0], whole[1], whole[2], whole[3], whole[4], verdict, whole[6], counts)
