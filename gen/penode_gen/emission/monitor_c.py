# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The C of a monitor, NAME_monitor.h and NAME_monitor.c: what the templates see besides the context of the model and its filter."""

from __future__ import annotations

import math
from typing import Any

import sympy as sp

from ..algebra import expressions as ex
from ..algebra.monitored import effects
from ..model import Filter, Model, Monitor
from .c_text import Printer, real
from .filter_c import given_input

FILES = {"filter/monitor.h.j2": "{name}_monitor.h", "filter/monitor.c.j2": "{name}_monitor.c"}


def threshold(model: Model, monitor: Monitor) -> float:
    """Threshold of all tests, for a mean time between false alarms of at least the one in the model file (penode/pen_monitor.h)."""
    return math.log((len(monitor.causes) + 1) * monitor.mean_time / model.sample_time)


def context(model: Model, given: Filter, monitor: Monitor) -> dict[str, Any]:
    """Names, numbers, and the effect of each cause as lines of C."""
    lines, n = _effects(model, given, monitor), len(monitor.causes)
    return {
        "monitor": {
            "causes": monitor.causes,
            "n": n,
            "half_time": real(model.sample_time / 2.0),
            "threshold": real(threshold(model, monitor)),
            "scale": real((1.0 - monitor.spread**-2) / 2.0),
            "offset": real(math.log(monitor.spread)),
            "mean_time": f"{monitor.mean_time:.6g}",
            "spread": f"{monitor.spread:.6g}",
            "lines": lines,
            "uses_x": any("x[" in line for line in lines),
            "uses_u": any("u->" in line for line in lines),
        }
    }


def _effects(model: Model, given: Filter, monitor: Monitor) -> list[str]:
    """Assignments to effect[.], the states of the filter cause by cause, and direct[.], its measurements."""
    wanted: list[tuple[str, sp.Expr]] = []
    n, n_z = len(given.names), len(given.sensors)
    for c, cause in enumerate(monitor.causes):
        rates, sensed = effects(model, cause)
        rates = [*rates, *([sp.Integer(0)] * (n - len(rates)))]
        wanted += [(f"effect[{c * n + i}]", value) for i, value in enumerate(rates)]
        wanted += [(f"direct[{c * n_z + i}]", value) for i, value in enumerate(sensed)]
    known = {name: f"x[{i}]" for i, name in enumerate(model.states)}
    inputs = [i.name for i in model.inputs] + [p.name for p in given.parameters]
    known |= {i: f"({given_input(given, i)['text']})" for i in inputs}
    numbered = (ex.symbol(f"t{i}") for i in range(1, 10000) if f"t{i}" not in known)
    common, reduced = sp.cse([value for _, value in wanted], symbols=numbered, order="canonical")
    text = Printer(lambda s: known.get(s.name, s.name))
    lines = [f"const {'bool' if e.is_Relational else 'pen_real_t'} {t.name} = {text(e)};" for t, e in common]
    return [*lines, *(f"{name} = {text(value)};" for (name, _), value in zip(wanted, reduced, strict=True))]
