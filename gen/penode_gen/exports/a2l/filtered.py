# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Measurements of a filter and its monitor, where a program has variables of their types (NAME_ekf.h, NAME_monitor.h)."""

from __future__ import annotations

from ...model import Model
from .. import filtered
from .entries import Measurements

_VERDICTS = ("not_offered", "used", "missing", "refused")  # PEN_EKF_NOT_OFFERED ... of penode/pen_ekf.h


def add(measured: Measurements, model: Model) -> None:
    """States, predictions, tests and counters of the first variable that is a filter of the model, and of the first that is its monitor."""
    for variable in measured.program.names(f"{model.name}_ekf_t")[:1] if model.filter else []:
        add_filter(measured, model, variable)
    for variable in measured.program.names(f"{model.name}_monitor_t")[:1] if model.monitor else []:
        add_monitor(measured, model, variable)


def add_filter(measured: Measurements, model: Model, variable: str) -> None:
    """Of a variable of the type NAME_ekf_t. Raises KeyError if the program has it not."""
    for n, (name, unit) in enumerate(filtered.states(model)):
        measured.add("filter", f"filter.state.{name}", f"{variable}.x[0][{n}]", unit, f"{name}, state of the filter")
    for o in model.outputs:
        measured.add("filter", f"filter.predicted.{o.name}", f"{variable}.y.{o.name}", o.unit, f"{o.name} before the measurements")
    for s in model.sensors:
        name = f"filter.predicted.{s.name}"
        measured.add("filter", name, f"{variable}.seen.{s.name}", s.unit, f"{s.name} before the measurements")
    for n, name in enumerate(filtered.measurements(model)):
        measured.add("filter", f"filter.ratio.{name}", f"{variable}.test[0][{n}].ratio", text=f"test ratio of {name}: 1 on average")
        for k, verdict in enumerate(_VERDICTS):
            text = f"how often {name} was {verdict.replace('_', ' ')} since the start"
            measured.add("filter", f"filter.count.{name}.{verdict}", f"{variable}.count[{n * len(_VERDICTS) + k}]", text=text)
    for counter, text in (("held", "did not advance"), ("limited", "were projected onto limits"), ("nonfinite", "would be NaN or Inf")):
        measured.add("filter", f"filter.count.{counter}", f"{variable}.head.{counter}", text=f"steps that {text} since the start")


def add_monitor(measured: Measurements, model: Model, variable: str) -> None:
    """Of a variable of the type NAME_monitor_t. Raises KeyError if the program has it not."""
    from ...emission.monitor_c import threshold  # SymPy is slow to load

    assert model.monitor
    most = threshold(model, model.monitor)
    for n, name in enumerate(filtered.tests(model)):
        at = f"{variable}.test[{n}]"
        measured.add("monitor", f"monitor.{name}", f"{at}.sum", text=f"evidence for {name}: raised at {most:.6g}", low=0.0)
        measured.add("monitor", f"monitor.raised.{name}", f"{at}.raised", text=f"1: {name} is found", low=0.0, high=1.0)
        measured.add("monitor", f"monitor.count.{name}", f"{at}.count", text=f"how often {name} was found since the start")
