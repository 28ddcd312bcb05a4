# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Variables of an FMU whose model has a filter: its measurements as inputs; estimates, standard deviations and tests as outputs."""

from __future__ import annotations

from typing import Any

from ... import units
from ...model import Model
from .. import filtered
from .table import Table


def status(table: Table, model: Model) -> None:
    """Flags of filter and monitor: none without a filter."""
    if model.filter:
        words = "flags of penode/pen_status.h, pen_ekf.h and pen_monitor.h that the filter raised in the last communication step"
        table.add("filter_status", "filter.status", "output", "discrete", words, kind="whole")


def inputs(table: Table, model: Model) -> None:
    """Measurements; a NaN, which they are at first, is a missing one."""
    sensors = {s.name: s for s in model.sensors}
    for name in filtered.measurements(model):
        words = f"{name}, measured at the start of a communication step; NaN: missing"
        unit = units.si(sensors[name].unit)
        table.add("measured", f"measured.{name}", "input", "continuous", words, unit=unit, start=(float("nan"),))


def outputs(table: Table, model: Model) -> None:
    """In the order of fmu_filter.c.j2."""
    found = filtered.estimates(model)
    for e in found:
        table.add("filtered", e.name, "output", "continuous", e.text, unit=units.si(e.unit))
    for e in found:
        words = f"standard deviation of {e.text}"
        table.add("filtered", filtered.deviation(e.name), "output", "continuous", words, unit=units.si(e.unit))
    for name in filtered.measurements(model):
        table.add("filtered", f"filter.ratio.{name}", "output", "discrete", f"test ratio of {name}: 1 on average")
    for name in filtered.tests(model):
        table.add("filtered", f"monitor.{name}", "output", "discrete", f"evidence for {name} in thresholds: raised at 1")
    for name in filtered.tests(model):
        table.add("filtered", f"monitor.raised.{name}", "output", "discrete", f"1: {name} is found")


def context(model: Model) -> dict[str, Any]:
    """What the templates see."""
    return {
        "estimates": filtered.estimates(model),
        "measured": filtered.measurements(model),
        "tests": filtered.tests(model),
        "monitor": model.monitor is not None,
        "filter": model.filter is not None,
        "core": model.stepped,
    }
