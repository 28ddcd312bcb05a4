# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A score test of many hypotheses at once: what each would change in the innovations, along the motion as it was."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .bench import Bench
from .fit import Fit
from .observer import Filter, Predictor, with_probes
from .prior import precisions, slopes

Array = NDArray[np.float64]
AT_ONCE = 32  # runs that are simulated together
NEARLY = 1e-6  # of the square of a column: what is left of it beside what is free anyway is rounding


@dataclass(frozen=True, eq=False)
class Probe:
    """A bench with a force to be put on each place."""

    bench: Bench
    predictor: Predictor
    by: Filter
    motions: list[Array]  # deflection, rate and force of every place, then forces of drives, per recording [n, .]

    @staticmethod
    def of(bench: Bench) -> Probe:
        wide = with_probes(bench.model, bench.places)
        predictor = Predictor(wide, bench.records, bench.update, bench.set_name, bench.fastest)
        by = bench.fit.by
        none = {e: np.zeros((1, len(r), len(bench.places))) for e, r in enumerate(bench.records)}
        watched = len(wide.sensors) - len(bench.model.sensors)
        seen = predictor.predict(bench.fit.free, np.zeros((1, len(bench.fit.free))), by, none, watched)[1]
        return Probe(bench, predictor, by, [s[0] for s in seen])

    def columns(self, forces: Sequence[tuple[int, Sequence[Array]]], size: float) -> Array:
        """Changes [forces, updates, n_z] of the innovations for a force of 1; each is a place and its series [n] per recording; `size` is
        a small force."""
        bench, free, problem = self.bench, self.bench.fit.free, self.bench.problem()
        found = []
        for first in range(0, len(forces), AT_ONCE):
            some = forces[first : first + AT_ONCE]
            extra, sizes = {}, [size / max(float(np.sqrt(np.mean(np.concatenate(list(f)) ** 2))), 1e-300) for _, f in some]
            for e, record in enumerate(bench.records):
                u = np.zeros((len(some) + 1, len(record), len(bench.places)))
                for k, (place, series) in enumerate(some):
                    u[k + 1, :, place] = sizes[k] * series[e]
                extra[e] = u
            lanes = self.predictor.predict(free, np.zeros((len(some) + 1, len(free))), self.by, extra)[0]
            nu = problem.whole(lanes.nu)
            found.append((nu[1:] - nu[0]) / np.array(sizes)[:, None, None])
        return np.concatenate(found) if found else np.zeros((0, *bench.fit.nu.shape))


@dataclass(frozen=True, eq=False)
class Score:
    """What hypotheses promise: log likelihood that each gains and the sizes it takes, beside all that is free anyway."""

    gain: float
    sizes: Array


@dataclass(frozen=True, eq=False)
class Beside:
    """What a fit leaves, `rest` [rows], beside all that is free anyway, with the orthonormal columns `q` of that."""

    fit: Fit
    q: Array
    rest: Array

    @staticmethod
    def of(fit: Fit) -> Beside:
        white, weights = 1.0 / np.sqrt(fit.variance), precisions(fit.free)
        own = np.vstack([(fit.slopes * white[None, :, None])[fit.used], np.diag(weights)])
        rest = np.concatenate([(fit.nu * white)[fit.used], slopes(fit.free) / np.maximum(weights, 1e-300)])
        size = np.maximum(np.linalg.norm(own, axis=0), 1e-300)
        q = np.linalg.qr(own / size)[0] if own.shape[1] else np.zeros((len(own), 0))
        return Beside(fit, q, rest - q @ (q.T @ rest))

    def columns(self, change: Array) -> tuple[Array, Array]:
        """A change [updates, n_z, sizes] as columns [rows, sizes], and what is left of them beside what is free."""
        white = 1.0 / np.sqrt(self.fit.variance)
        columns = np.vstack([(change * white[None, :, None])[self.fit.used], np.zeros((len(self.fit.free), change.shape[2]))])
        columns[~np.isfinite(columns)] = 0.0
        return columns, columns - self.q @ (self.q.T @ columns)

    def gain(self, left: float) -> float:
        """Log likelihood gained where so much is left of the sum of squares, with the level of the innovations profiled out."""
        return 0.5 * int(np.sum(self.fit.used)) * float(np.log(float(self.rest @ self.rest) / max(left, 1e-300)))


def scores(fit: Fit, hypotheses: Sequence[Array]) -> list[Score]:
    """Scores of hypotheses [updates, n_z, sizes] each, linearised about a fit (Rao 1948)."""
    beside, found = Beside.of(fit), []
    for h in hypotheses:
        whole, columns = beside.columns(h)
        before = np.sum(whole**2, axis=0)
        if np.any(np.sum(columns**2, axis=0) < NEARLY * before) or not before.all():
            found.append(Score(0.0, np.zeros(h.shape[2])))
            continue
        theta = np.asarray(np.linalg.lstsq(columns, -beside.rest, rcond=1e-9)[0], float)
        found.append(Score(beside.gain(float(np.sum((beside.rest + columns @ theta) ** 2))), theta))
    return found


def as_they_are(fit: Fit, changes: Sequence[Array]) -> list[Score]:
    """Scores of changes [updates, n_z] each, of size 1."""
    beside = Beside.of(fit)
    left = [float(np.sum((beside.rest + beside.columns(c[:, :, None])[1][:, 0]) ** 2)) for c in changes]
    return [Score(beside.gain(x), np.ones(1)) for x in left]
