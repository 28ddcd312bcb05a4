# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a monitor gives, sample by sample, and the compiled one: NAME_monitor.h in the shared library of its model."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from penode_gen.flags import FILTER_FLAGS, FLAGS as STEP_FLAGS, MONITOR_FLAGS
from penode_gen.model import Model

from ..output import Column
from . import estimates
from .compiled import Compiled, CompiledFilter
from .estimates import Estimates

Array = NDArray[Any]
OTHER = "other"  # the test for what no named cause is
FLAGS = {name: 1 << (len(STEP_FLAGS) + len(FILTER_FLAGS) + at) for at, name in enumerate(MONITOR_FLAGS)}  # PEN_MONITOR_... of pen_monitor.h


@dataclass(frozen=True, eq=False)
class Watched:
    """One row a sample: sums of the tests in thresholds [n, tests], and whether each is raised."""

    sums: Array
    raised: NDArray[np.bool_]


def names(model: Model) -> list[str]:
    """Names of the tests, in their order; of a model without a monitor none."""
    return [*(c.name for c in model.monitor.causes), OTHER] if model.monitor else []


class CompiledMonitor(CompiledFilter):
    """A filter with its monitor, from their start: run() steps both, and the status it gives is that of both."""

    def __init__(self, owner: Compiled, set_name: str):
        super().__init__(owner, set_name)
        size, self.tests = list((ctypes.c_uint32 * 2).in_dll(owner.library, "sil_monitor_sizes"))
        self._monitor = np.zeros(size // 8 + 1)
        self._function(f"{self.owner.model.name}_monitor_init")(ctypes.c_void_p(self._monitor.ctypes.data))
        self._sums, self._raised = np.zeros((0, self.tests), owner.dtype), np.zeros((0, self.tests), np.uint32)

    def run(self, u: ArrayLike, z: ArrayLike, mask: ArrayLike | None = None, **options: Any) -> tuple[Estimates, Array, Array]:
        """As that of the filter."""
        n = np.size(z) // self.owner.n_z
        self._sums, self._raised = np.zeros((n, self.tests), self.owner.dtype), np.zeros((n, self.tests), np.uint32)
        return super().run(u, z, mask, **options)

    def _steps(self, begin: int, n: int, at: list[int | None]) -> None:
        own = (self._monitor, self._sums[begin:], self._raised[begin:])
        places = map(ctypes.c_void_p, (*at, *(part.ctypes.data for part in own)))
        self.owner.library.sil_monitor_run(self.address, ctypes.c_uint32(n), *places)

    def watched(self) -> Watched:
        """What the monitor found in the last run()."""
        return Watched(self._sums, self._raised != 0)


def run(
    model: Model, set_name: str, u: Any, z: Any, mask: Any, exchanges: dict[int, str], progress: Callable[[int], None]
) -> tuple[Estimates, Watched]:
    """A whole run; `exchanges`: the sample from which on another set is in force."""
    own, parts = CompiledMonitor(Compiled(model), set_name), []
    for begin, end in itertools.pairwise([0, *sorted(exchanges), len(z)]):
        if begin in exchanges:
            own.select(exchanges[begin])
        part = slice(begin, end)
        parts.append((own.run(u[part], z[part], None if mask is None else mask[part])[0], own.watched()))
        progress(end)
    return estimates.joined([e for e, _ in parts]), joined([w for _, w in parts])


def joined(parts: list[Watched]) -> Watched:
    """Stretches of one run, one after the other."""
    return Watched(np.concatenate([p.sums for p in parts]), np.concatenate([p.raised for p in parts]))


def columns(model: Model, found: Watched | None) -> list[Column]:
    """Sums in thresholds and flags, to stand behind the estimates; none without a monitor."""
    table: list[Column] = []
    if found is None:
        return table
    for name, total, up in zip(names(model), found.sums.T, found.raised.T, strict=True):
        table += [Column(f"monitor.{name}", "1", total.astype(float)), Column(f"monitor.{name}.raised", "1", up.astype(np.uint32), "%d")]
    return table


def summary(model: Model, found: Watched | None, times: Array) -> dict[str, Any]:
    """For each test: when it was raised first [s], how often, and its highest sum in thresholds; nothing without a monitor."""
    entry: dict[str, Any] = {}
    if found is None:
        return entry
    for name, total, up in zip(names(model), found.sums.T, found.raised.T, strict=True):
        rises = np.flatnonzero(np.diff(up.astype(int), prepend=0) > 0)
        first = float(times[rises[0]]) if rises.size else None
        entry[name] = {"raised": int(rises.size), "first": first, "highest": float(total.max(initial=0.0))}
    return {"monitor": entry}


def sentences(entry: dict[str, Any]) -> list[str]:
    """A summary in lines."""
    lines = []
    for name, test in entry.get("monitor", {}).items():
        often = "once" if test["raised"] == 1 else f"{test['raised']} times"
        found = "not raised" if test["first"] is None else f"raised first at {test['first']:.6g} s, {often}"
        lines.append(f"  monitor {name}: {found}; highest sum {test['highest']:.3g} of the threshold")
    return lines
