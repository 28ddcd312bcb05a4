# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""
The monitor of a model file in float64, apart from its C: what a cause does is what it does to a model whose parameters are changed, by
central differences; derivatives of the step are differences, too, and the filter's gains come from dense matrices.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.errors import ModelError
from penode_gen.model import Model, MonitorCause

from . import estimates
from .estimates import VERDICTS, Estimates
from .exact import Array, Exact, derivatives
from .watched import FLAGS, Watched, joined

SHARE = np.cbrt(np.finfo(float).eps)  # of a change: what the differences are taken over


def _changed(model: Model, cause: MonitorCause, share: float) -> Model:
    """The model with a share of the change."""
    parameters = dict(model.parameters)
    for name, change in cause.changes.items():
        parameters[name] = replace(parameters[name], value=parameters[name].value + share * change)
    return replace(model, parameters=parameters)


class Monitor(Exact):
    """The filter with its monitor; run() of the filter steps it, watched() takes what it found since."""

    def __init__(self, model: Model, set_name: str = "default"):
        super().__init__(model, set_name)
        if model.monitor is None:
            raise ModelError([f"{model.path}: has no [monitor]; add one, as gen/README.md describes it"])
        self.monitor = model.monitor
        self.select(set_name)
        causes = len(self.monitor.causes)
        self.s, self.sums, self.raised = np.zeros((causes, self.n)), np.zeros(causes + 1), np.zeros(causes + 1, bool)
        self.threshold = math.log((causes + 1) * self.monitor.mean_time / model.sample_time)
        self.effect = np.zeros_like(self.s)  # of the causes on the rates, in the last sample
        self.rows_found: list[tuple[Array, NDArray[np.bool_]]] = []

    def select(self, set_name: str) -> None:
        super().select(set_name)
        pairs = ([_changed(self.model, c, share) for share in (SHARE, -SHARE)] for c in getattr(self.model.monitor, "causes", ()))
        self.changed = [[penode_gen.numeric(own, set_name) for own in pair] for pair in pairs]

    def _difference(self, cause: int, function: Callable[[], Array]) -> Array:
        """What the whole change of a cause does to what a function gives."""
        kept, found = self.numeric, []
        for changed in self.changed[cause]:
            self.numeric = changed
            found.append(function())
        self.numeric = kept
        difference: Array = (found[0] - found[1]) / (2.0 * SHARE)
        return difference

    def predict(self, u: Array) -> None:
        before, at, half = self.before, self.x.copy(), self.model.sample_time / 2.0
        super().predict(u)
        was, self.effect = self.effect, np.zeros_like(self.s)
        for c in range(len(self.s)):
            self.effect[c, : self.n_x] = self._difference(c, lambda: self._rates(u))
        if before is not None:
            phi = derivatives(lambda x: self._moved(before, u, x), at, self.start)
            self.s = (self.s + half * was) @ phi.T + half * self.effect

    def _rates(self, u: Array) -> Array:
        """Rates of the model, at the state before the measurements of a sample."""
        driven = self.drive(u, self.x)
        return np.asarray(self.at_values(self.x[self.first :]).rates(self.x[: self.n_x], driven, np.zeros_like(driven)), float)

    def _moved(self, before: Array, u: Array, x: Array) -> Array:
        """State of the filter after one sample."""
        later = self.decay * x[self.n_x :]
        return np.concatenate([self.step(x, before, np.concatenate([x[: self.n_x], later]), u), later])

    def correct(self, u: Array, z: Array, mask: int) -> tuple[Array, list[int]]:
        at, p, n_y = self.x.copy(), self.p.copy(), len(self.model.outputs)
        tests, verdicts = super().correct(u, z, mask)
        slopes = derivatives(lambda x: self.look(u, x), at, self.start)[n_y:]
        direct = [self._difference(c, lambda: self.look(u, at))[n_y:] for c in range(len(self.s))]
        scores = np.zeros(len(self.sums))
        for i, row in enumerate(self.rows):
            if verdicts[i] != VERDICTS.index("used"):
                continue
            own, variance = slopes[row], float(tests[1, i])
            gain = p @ own / variance
            p = p - np.outer(gain, own @ p)
            for c, s in enumerate(self.s):
                mean = float(direct[c][row] + own @ s)
                scores[c] += mean * (tests[0, i] - mean / 2.0) / variance
                s -= gain * mean
            spread = self.monitor.spread
            scores[-1] += (1.0 - spread**-2) / 2.0 * tests[2, i] - math.log(spread)
        self.sums = np.clip(self.sums + scores, 0.0, self.threshold)
        self.raised = (self.sums >= self.threshold) | (self.raised & (self.sums > 0.0))
        self.rows_found.append((self.sums / self.threshold, self.raised.copy()))
        return tests, verdicts

    def watched(self) -> Watched:
        """What was found since the last call."""
        sums, raised = (np.array([row[part] for row in self.rows_found]) for part in (0, 1))
        self.rows_found = []
        return Watched(sums, raised)


def run(
    model: Model, set_name: str, u: Any, z: Any, mask: Any, exchanges: dict[int, str], progress: Callable[[int], None]
) -> tuple[Estimates, Watched]:
    """A whole run; `exchanges`: the sample from which on another set is in force. The status is that of filter and monitor."""
    own, parts, watched = Monitor(model, set_name), [], []
    for begin, end in itertools.pairwise([0, *sorted(exchanges), len(z)]):
        if begin in exchanges:
            own.select(exchanges[begin])
        part = slice(begin, end)
        parts.append(own.run(u[part], z[part], None if mask is None else mask[part]))
        watched.append(own.watched())
        progress(end)
    found, raised = estimates.joined(parts), joined(watched)
    flags = FLAGS["cause"] * raised.raised[:, :-1].any(axis=1) | FLAGS["other"] * raised.raised[:, -1]
    return replace(found, status=(found.status | flags).astype(np.uint32)), raised
