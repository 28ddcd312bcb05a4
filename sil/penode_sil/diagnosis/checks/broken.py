# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Sensors that clip or drop out, by their samples and a simulation that confirms it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from ...recordings.measured import Measured
from ..catalogue import others
from ..result import Cause, Value
from ..study.fit import Fit
from ..study.study import Study
from . import dropouts

FEW = 5  # bad samples of a sensor that make a fault of it
FAR = 3, 20.0  # or so many that are as many standard deviations of its noise off
ENDS = 2.0  # samples by which the ends of a hole may be wrong
WILD = 2.0  # standard deviations of the noise that bursts have together: one sample in nine that is far out
STILL = 2e-3  # of the samples: values that a noisy sensor repeats that often are no measurements


def still_broken(
    train: Sequence[Measured], study: Study, fit: Fit, faults: Sequence[Cause], bursts: Sequence[NDArray[np.bool_]]
) -> list[Cause]:
    """Sensors that clip or drop out beside a fit of the recordings; bursts and spikes that it explains do not count. One with a
    rail among the `faults` before has no drop-outs: a cause may clip as well, and then a rail looks like one."""
    kept = [b & wild for b, wild in zip(bursts, still_wild(study, fit, bursts), strict=True)]
    return others.still_at_fault(broken_sensors(study.model, train, study, fit.simulated, kept), faults)


def still_wild(study: Study, fit: Fit, bursts: Sequence[NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
    """Per recording, whether the bursts of each sensor [1, n_z] are as wild beside a fit as they were without."""
    found = []
    for k, b in enumerate(bursts):
        b = b[: len(study.experiments[k].time)]
        sums = [np.sum(np.where(b, (study.experiments[k].y - f.simulated[k]) ** 2, 0.0), axis=0) for f in (fit, study.null)]
        noise_there = np.sum(b, axis=0) * np.mean(study.levels[k], axis=0)
        found.append((sums[0] > np.maximum(0.5 * sums[1], WILD**2 * noise_there))[None, :])
    return found


@dataclass
class _Counts:
    """What all recordings show of a sensor: samples at its rails, `railed` ones at a rail that the signal was not near, lost ones by the
    file's own account (`lost`) and beside the model (`dropped`, `more`), `far` off, in so many `holes` of `total` samples."""

    clipped: int = 0
    railed: int = 0
    lost: float = 0.0
    dropped: int = 0
    more: int = 0
    far: int = 0
    holes: int = 0
    total: int = 0
    proven: bool = False
    quantum: float = 0.0
    rails: dict[str, float] = field(default_factory=dict)


def broken_sensors(
    model: Model, train: Sequence[Measured], study: Study, simulated: Sequence[NDArray[np.float64]], bursts: Sequence[NDArray[np.bool_]]
) -> list[Cause]:
    """Sensors that clip or drop out, by their samples and a simulation that confirms it: it continues where they stop."""
    found = []
    for j, sensor in enumerate(model.sensors):
        c = _Counts()
        for k, m in enumerate(train):
            if sensor.name in m.quality.channels:
                n = len(study.experiments[k].time)
                sigma = float(np.sqrt(np.mean(study.levels[k][:, j])))
                burst = bursts[k][:n, j] if len(bursts) > k else np.zeros(n, bool)
                _count(c, m, sensor.name, simulated[k][:, j], sigma, burst)
        found += _faults(c, sensor.name, units.si(sensor.unit))
    return found


def _count(c: _Counts, m: Measured, name: str, simulated: NDArray[np.float64], sigma: float, burst: NDArray[np.bool_]) -> None:
    """Adds one recording, whose noise has the deviation sigma; `burst` [n]: samples that are far from a simulation [n]."""
    channel, n = m.quality.channels[name], len(burst)
    y = m.z[name][:n]
    c.total += len(m.mask[name])
    c.quantum = max(c.quantum, channel.quantum)
    flagged = (m.shown[name] & ~m.mask[name])[:n]  # what the file itself calls lost is no fault of the sensor
    away = np.abs(y - simulated)
    off = away > 4.0 * sigma
    railing = np.zeros(n, bool)
    for side, end, rail in ((-1.0, "low", channel.low), (1.0, "high", channel.high)):
        if rail is None:
            continue
        at = flagged & (np.abs(y - rail) < 1e-6 * abs(rail))
        railing |= at
        if np.mean(side * (simulated[at] - rail) > -4.0 * sigma) > 0.5:
            c.clipped += int(np.count_nonzero(at))
            c.rails[end] = rail
        else:  # a rail that the signal was not near
            c.railed += int(np.count_nonzero(at))
    bad, wrong = channel.held + channel.spikes, flagged & off & ~railing
    still = channel.held > max(FEW, STILL * n) and channel.quantum < 0.3 * sigma  # noise does not repeat itself
    c.proven |= bad > 0 and bool(still or np.count_nonzero(wrong) > 0.2 * bad)
    c.far += int(np.count_nonzero(wrong & (away > FAR[1] * sigma))) if channel.quantum < 0.3 * sigma else 0
    c.lost += bad * len(m.mask[name]) / channel.rows  # of a file that may be parted, or slower
    c.dropped += int(np.count_nonzero(burst))
    again = dropouts.repeats(y, simulated, m.mask[name][:n], channel.quantum, sigma) & ~burst
    c.more += int(np.count_nonzero(again))
    c.holes += int(np.count_nonzero(np.diff((wrong | burst | again).astype(np.int8), prepend=0) > 0))
    met = np.zeros(n, bool)
    for side, end, rail in ((-1.0, "low", np.min(y)), (1.0, "high", np.max(y))):  # a rail that was met once or twice
        at = burst & (y == rail) & (side * (simulated - rail) > 0.0)
        if np.count_nonzero(at) >= FEW:
            met |= at
            c.rails[end] = float(rail)
    c.clipped += int(np.count_nonzero(met))
    runs = np.cumsum(np.diff(burst.astype(np.int8), prepend=0) > 0)
    went_on = burst & ~off & np.isin(runs, runs[met])  # between two rails
    c.dropped -= int(np.count_nonzero(met | went_on))


def _faults(c: _Counts, sensor: str, unit: str) -> list[Cause]:
    """Clipping, where enough samples are at a rail; drop-outs, where enough are lost."""
    found = []
    dropped = c.dropped + (0 if c.clipped >= FEW else c.railed)
    if c.clipped >= FEW:
        sizes = {"limit": max(map(abs, c.rails.values())), **c.rails}
        sure = {k: 0.002 * abs(x) + 0.5 * c.quantum for k, x in sizes.items()}
        found.append(others.clipped(sensor, {k: Value(x, unit, (x - sure[k], x + sure[k])) for k, x in sizes.items()}))
    dropped += round(c.lost) if c.proven else 0
    if dropped >= FEW or (dropped and c.far >= FAR[0]):
        share, blur = (dropped + c.more) / c.total, ENDS * c.holes / c.total
        size = Value(share, "1", (max(share - blur, 0.0), share + blur))
        found.append(others.holed(sensor, size))
    return found
