# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
What the Behavioral Model of an eFMU is made of: inputs, sets in force and reference outputs, sample by sample.

The reference is the model in float64 (penode_gen.numeric) with its own method; it shares no arithmetic with the C or the Algorithm Code.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...model import Model
from ...sets import layout, packing
from ...twins.numeric import Numeric
from ..interface import ExportError
from ..ssp.ssp import schedule
from .code import METHODS
from .variables import Variable

Array = NDArray[np.float64]
_LASTS, _AFTER = 2.0, 0.5  # [s] a scenario, and how long it goes on after a recalibration
_SHARE = 0.08  # of half an input's range, at 1 Hz; 0.01 SI units where none is declared
_MOST = 4_000_000  # numbers of parameters in a table


@dataclass(frozen=True)
class Scenario:
    """`u` [n, inputs], `y` [n, outputs]; `tuned`: the arrays that change, with their values before and from sample `at` on."""

    name: str
    description: str
    u: Array
    y: Array
    tuned: list[tuple[Variable, Array, Array]]
    at: int = 0

    def table(self, model: Model) -> str:
        """The CSV: time, inputs, outputs, and a column for each tuned element."""
        signals = [*(i.name for i in model.inputs), *(o.name for o in model.outputs)]
        rows = [",".join([time_column(signals), *signals, *(c for v, _, _ in self.tuned for c in columns(v))])]
        tails = [
            "".join(f",{x!r}" for values in chosen for x in np.ravel(values).tolist())
            for chosen in zip(*((a, b) for _, a, b in self.tuned), strict=True)
        ] or ["", ""]
        for k, numbers in enumerate(np.concatenate([self.u, self.y], axis=1).tolist()):
            rows.append(f"{k * model.sample_time:.9g}{''.join(f',{x!r}' for x in numbers)}{tails[k >= self.at]}")
        return "\n".join(rows) + "\n"

    def tolerance(self, precision: str) -> list[float]:
        """
        Of each output [n_y]: four times sqrt(n) roundings of its largest value.

        A rounding at each of n samples, in either direction, adds up to some sqrt(n) of them.
        """
        unit = 2.0**-24 if precision == "32-bit" else 2.0**-53
        return [max(4 * float(np.abs(column).max()) * len(self.y) ** 0.5 * unit, 1e-30) for column in self.y.T]


def time_column(signals: Iterable[str]) -> str:
    """Name of the column of the time, beside `signals`; no name of a model file ends in _."""
    return "time_" if "time" in signals else "time"


def columns(variable: Variable) -> list[str]:
    """Names of the columns of an array, row by row."""
    return [variable.label + "".join(f"[{i + 1}]" for i in index) for index in np.ndindex(variable.shape)]


def scenarios(model: Model, variables: list[Variable], asked: str | None) -> list[Scenario]:
    """
    A sweep of the inputs, and the same with a recalibration, which the sweep ends before. Raises ExportError.

    `asked`: as `2:altered_friction`, "none", or None: at 2 s to the second set, unless there is none or the table would be too large.
    """
    exchange = _exchange(model, asked)
    changes = _changes(model, variables, exchange[1]) if exchange else []
    length, rows = sum(v.count for v, _, _ in changes), _rows(model, exchange[0] + _AFTER if exchange else _LASTS)
    if rows * length > _MOST:
        if asked:
            raise ExportError(
                f"--recalibration: a table of {rows} samples with {length} numbers each is too large; choose an earlier time, or none"
            )
        exchange, rows = None, _rows(model, _LASTS)
    t = np.arange(rows, dtype=np.float64) * model.sample_time
    u = np.array([_sweep(i.minimum, i.maximum, 1.0 + 0.1 * k, t) for k, i in enumerate(model.inputs)]).reshape(len(model.inputs), rows).T
    at = round(exchange[0] / model.sample_time) if exchange else rows
    y = _reference(model, u, ["default", exchange[1] if exchange else "default"], at)
    found = [Scenario("sweep", "inputs from 1 Hz on, rising; set default", u[:at], y[:at], [])]
    if exchange:
        words = f"the same; recalibration at {exchange[0]:g} s to the set {exchange[1]}, in force at that sample; states stay"
        found.append(Scenario("recalibration", words, u, y, changes, at))
    return found


def _rows(model: Model, lasts: float) -> int:
    return round(lasts / model.sample_time) + 1


def _exchange(model: Model, asked: str | None) -> tuple[float, str] | None:
    if asked == "none" or (asked is None and len(model.sets) < 2):
        return None
    try:
        found = schedule(
            model, asked if asked is not None else f"{round(_LASTS / model.sample_time) * model.sample_time:.9g}:{list(model.sets)[1]}"
        )
    except ExportError as error:
        raise ExportError(*(p.replace("--schedule", "--recalibration") for p in error.problems)) from error
    if len(found) != 1:
        raise ExportError(f"--recalibration: '{asked}' is not one exchange; write a time in seconds, a colon and a set, or none")
    if found[0]["time"] < model.sample_time / 2:
        raise ExportError(f"--recalibration: '{asked}' is at the start, before any sample; choose a later time")
    return found[0]["time"], found[0]["set"]


def _changes(model: Model, variables: list[Variable], name: str) -> list[tuple[Variable, Array, Array]]:
    before, after = (packing.set_values(model, n, np.float64) for n in ("default", name))
    found: list[tuple[Variable, Array, Array]] = []
    for v in variables:
        if v.element is None:
            continue
        a, b = (layout.gather(v.element, values).reshape(v.shape) for values in (before, after))
        found += [] if np.array_equal(a, b) else [(v, a, b)]
    return found


def _sweep(minimum: float | None, maximum: float | None, pace: float, t: Array) -> Array:
    """1 Hz on, faster by 0.25 Hz a second, with falling amplitude; numbers that float holds exactly."""
    size = 0.01 if minimum is None or maximum is None else _SHARE * (maximum - minimum) / 2
    centre = max(min(0.0, np.inf if maximum is None else maximum - size), -np.inf if minimum is None else minimum + size)
    return np.asarray((centre + size * np.sin(2 * np.pi * pace * (t + 0.125 * t**2)) / (1 + 0.25 * t)).astype(np.float32), float)


def _reference(model: Model, u: Array, names: list[str], at: int) -> Array:
    """Outputs [n, n_y] with the first set before sample `at`, then the other."""
    numerics = [Numeric(model, names[0])] * 2 if names[0] == names[1] else [Numeric(model, n) for n in names]
    x, y, before = np.array(model.start, float), [], u[0] if len(u) else np.zeros(0)
    for k, now in enumerate(u):
        numeric = numerics[k >= at]
        rate = (now - before) / model.sample_time
        x = _step(model, numeric, x, before, now, rate) if k and model.states else x
        y.append(numeric.outputs(x, now, rate))
        before = now
    with np.errstate(invalid="ignore"):
        if not np.isfinite(y).all():
            raise ExportError(
                f"{model.path.name}: the reference of the Behavioral Model is not finite; check the model with penode simulate"
            )
    return np.array(y)


def _step(model: Model, numeric: Numeric, x: Array, before: Array, now: Array, rate: Array) -> Array:
    nodes, weights, divisor = METHODS[model.method]
    h, linear = model.sample_time / model.substeps, model.interpolation == "linear"
    for i in range(model.substeps):
        k, total = np.zeros_like(x), np.zeros_like(x)
        for node, weight in zip(nodes, weights, strict=True):
            share = (i + node) / model.substeps if linear else 0.0
            k = numeric.rates(x + h * node * k, before + share * (now - before), rate if linear else 0.0 * rate)
            total = total + weight * k
        x = x + h / divisor * total
    return x
