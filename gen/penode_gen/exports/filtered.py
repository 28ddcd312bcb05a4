# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a filter and its monitor show to other tools: the same names in an A2L and an FMU."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..model import Model

OTHER = "other"  # the test for what no named cause is


@dataclass(frozen=True)
class Estimate:
    """
    An estimated quantity: `member` of `part` (x, u, p, y, z) of NAME_ekf_estimate_t, with a standard deviation in `part`_deviation. `unit`
    is that of the model file.
    """

    name: str
    part: str
    member: str
    unit: str
    text: str


def estimates(model: Model) -> list[Estimate]:
    """Each quantity once: outputs, sensors, estimated inputs and parameters, then other states; none without a filter."""
    found: dict[str, Estimate] = {}
    for part, name, unit in _quantities(model):
        found.setdefault(name, Estimate(f"filter.{name}", part, name, unit, f"{name}, estimated"))
    return list(found.values())


def _quantities(model: Model) -> Iterator[tuple[str, str, str]]:
    from ..algebra.mechanics import state_unit  # SymPy is slow to load

    if model.filter is None:
        return
    own = {i.name for i in model.filter.inputs}
    yield from (("y", o.name, o.unit) for o in model.outputs)
    yield from (("z", s.name, s.unit) for s in model.sensors)
    yield from (("u", i.name, i.unit) for i in model.inputs if i.name in own)
    yield from (("p", p.name, model.parameters[p.name].unit) for p in model.filter.parameters)
    yield from (("x", name, state_unit(model, name)) for name in model.states)


def states(model: Model) -> Iterator[tuple[str, str]]:
    """Name and unit of each state of the filter, in their order; none without one."""
    from ..algebra.mechanics import state_unit  # SymPy is slow to load

    units = {p.name: p.unit for p in model.parameters.values()} | {i.name: i.unit for i in model.inputs}
    units |= {name: state_unit(model, name) for name in model.states}
    yield from ((name, units[name]) for name in (model.filter.names if model.filter else ()))


def deviation(name: str) -> str:
    """Of the standard deviation of `filter.NAME`."""
    return name.replace("filter.", "filter.sd.", 1)


def measurements(model: Model) -> list[str]:
    """Sensors that the filter uses, in their order; none without a filter."""
    return [s.name for s in model.filter.sensors] if model.filter else []


def tests(model: Model) -> list[str]:
    """Tests of the monitor, in their order; none without one."""
    return [*(c.name for c in model.monitor.causes), OTHER] if model.monitor else []
