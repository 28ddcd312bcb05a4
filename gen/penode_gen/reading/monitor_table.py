# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The fault monitor of a model file: [monitor]."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .. import model as m
from .filter_table import NUMBER, FilterTables

SPREAD = 1.5  # standard deviations of innovations, as a multiple, that the test for anything else is made for


class MonitorTables(FilterTables):
    """Reads [monitor]."""

    def monitor(self, parameters: Mapping[str, m.Parameter], filtered: bool, sample_time: float) -> m.Monitor | None:
        """The monitor; None if the file has none."""
        if "monitor" not in self.data:
            return None
        head = self.table(("monitor",), {"mean_time": str, "spread": NUMBER, "causes": dict}, self.data["monitor"], ("mean_time",))
        if not filtered:
            self.problem(("monitor",), "the model has no filter whose innovations it could watch", "add [filter], or remove [monitor]")
        time = (
            self.quantity(("monitor", "mean_time"), head["mean_time"], "s") if isinstance(head.get("mean_time"), str) else 2.0 * sample_time
        )
        if not time > sample_time:
            self.problem(("monitor", "mean_time"), "is no more than a sample", "give the mean time between false alarms, such as '20 h'")
            time = 2.0 * sample_time
        spread = self.number(("monitor", "spread"), head.get("spread", SPREAD))
        if not spread > 1.0:
            self.problem(("monitor", "spread"), f"{head.get('spread')} is not above 1", "give a multiple of the innovations' own spread")
        causes = head.get("causes", {})
        for name in causes:
            if next(n for n in causes if n.upper() == name.upper()) != name:
                self.problem(("monitor", "causes", name), "has the C constant of another one", "rename it")
        return m.Monitor(time, spread, tuple(self.cause(name, entry, parameters) for name, entry in causes.items()))

    def cause(self, name: str, given: Any, parameters: Mapping[str, m.Parameter]) -> m.MonitorCause:
        where = ("monitor", "causes", name)
        self.label(where, name)
        if name.lower() == "other":
            self.problem(where, "is the name of the test for anything else", "rename it")
        entry = self.table(where, dict.fromkeys(parameters, NUMBER), given)
        found = {p: self.number((*where, p), change, self.unit((), parameters[p].unit)) for p, change in entry.items()}
        if not any(found.values()):
            self.problem(where, "changes nothing", "name parameters, each with the change that has to be found, signs included")
        return m.MonitorCause(name, found)
