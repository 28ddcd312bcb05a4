# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the innovations of a filter say of its noises: likelihood, mean test ratio with its band, correlation of neighbours."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from penode_gen.flags import FLAGS as STEP_FLAGS
from penode_gen.model import Filter

from .estimates import FLAGS, VERDICTS, Estimates

Array = NDArray[Any]
HOLDING = FLAGS["nonfinite"] | sum(
    1 << STEP_FLAGS.index(name) for name in ("input_nonfinite", "state_nonfinite", "step_nonfinite", "singular", "held", "badarg")
)  # PEN_EKF_HOLDING: the tests are those of an earlier sample


@dataclass(frozen=True)
class OfSensor:
    """Figures of one sensor: `mean_ratio` has an expectation of 1, and is within `band` with 95 % if the noises are right; `lag_1` is the
    correlation of neighbouring innovations over their standard deviations, 0 if they are right. None without measurements."""

    used: int
    refused: int
    mean_ratio: float | None
    band: tuple[float, float] | None
    lag_1: float | None


@dataclass(frozen=True)
class Consistency:
    """Natural logarithm of the likelihood of `measurements` innovations, and each sensor; `all` is all sensors together."""

    log_likelihood: float
    measurements: int
    all: OfSensor
    sensors: dict[str, OfSensor]

    def as_json(self) -> dict[str, Any]:
        return asdict(self)


def tested(found: Estimates) -> NDArray[np.bool_]:
    """Measurements that were used or refused, in samples that advanced [n, measurements]."""
    judged: NDArray[np.bool_] = np.isin(found.verdict, [VERDICTS.index("used"), VERDICTS.index("refused")])
    advanced: NDArray[np.bool_] = found.status & HOLDING == 0
    both: NDArray[np.bool_] = judged & advanced[:, None]
    return both


def log_likelihood(given: Filter, runs: Iterable[Estimates]) -> tuple[float, int]:
    """Log-likelihood of the innovations, and their number. A refused one counts as if it were at its gate."""
    gates = np.array([np.inf if s.gate is None else s.gate**2 for s in given.sensors])
    total, count = 0.0, 0
    for found in runs:
        counts = tested(found)
        terms = np.log(2.0 * np.pi * found.variance[counts]) + np.minimum(found.ratio, gates)[counts]
        total, count = total - 0.5 * float(terms.sum()), count + int(counts.sum())
    return total, count


def consistency(given: Filter, runs: Sequence[Estimates]) -> Consistency:
    """Consistency of one filter over recordings."""
    total, count = log_likelihood(given, runs)
    every = list(range(len(given.sensors)))
    sensors = {s.name: _of(runs, [k]) for k, s in enumerate(given.sensors)}
    return Consistency(total, count, _of(runs, every), sensors)


def _of(runs: Sequence[Estimates], columns: list[int]) -> OfSensor:
    ratios, products, squares, refused = [np.zeros(0)], 0.0, 0.0, 0
    for found in runs:
        used = tested(found) & (found.verdict == VERDICTS.index("used"))
        refused += int((tested(found) & ~used)[:, columns].sum())
        ratios.append(found.ratio[:, columns][used[:, columns]])
        unit = np.where(used, found.innovation / np.sqrt(np.where(found.variance > 0.0, found.variance, 1.0)), 0.0)[:, columns]
        both = (used[1:] & used[:-1])[:, columns]
        products += float(np.sum(unit[1:] * unit[:-1] * both))
        squares += float(np.sum(0.5 * (unit[1:] ** 2 + unit[:-1] ** 2) * both))
    values = np.concatenate(ratios)
    if not values.size:
        return OfSensor(0, refused, None, None, None)
    low, high = (float(chi2.ppf(share, values.size)) / values.size for share in (0.025, 0.975))
    return OfSensor(int(values.size), refused, float(values.mean()), (low, high), products / squares if squares > 0.0 else None)
