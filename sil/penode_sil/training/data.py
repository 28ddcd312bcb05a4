# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings for training, and the level and colour of their residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.signal import lfilter

from penode_gen.model import Model

from ..errors import RecordingError
from ..recordings.measured import Measured
from .drive import Drive, drive
from .settings import SETTINGS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Record:
    """One recording: what drives it, signals y [n, n_z] and which samples are sound, `noise` [n_z] as its own rows show it (NaN:
    unknown)."""

    name: str
    drive: Drive
    y: Array
    good: NDArray[np.bool_]
    noise: Array

    def first(self, samples: int) -> Record:
        """Its beginning."""
        if samples >= len(self.y):
            return self
        d = replace(
            self.drive, u=np.ascontiguousarray(self.drive.u[:samples]), between=np.ascontiguousarray(self.drive.between[: samples - 1])
        )
        return replace(self, drive=d, y=self.y[:samples], good=self.good[:samples])


def record(model: Model, m: Measured, signals: Sequence[str]) -> Record:
    """A recording for a model whose sensors and outputs are `signals`. UserError where its input stands still."""
    n = len(m.time)
    y, good, noise = np.zeros((n, len(signals))), np.zeros((n, len(signals)), dtype=bool), np.full(len(signals), np.nan)
    for j, name in enumerate(signals):
        if name in m.z and name not in signals[:j]:  # an output that is called as a sensor is the same rows
            y[:, j], good[:, j] = m.z[name], m.mask[name]
            y[~np.isfinite(y[:, j]), j] = 0.0
            found = m.quality.channels[name].noise
            noise[j] = found.std if found is not None else np.nan
    held = bool(model.inputs) and all(m.quality.channels[i.name].how == "held" for i in model.inputs)
    if model.inputs and not np.any(np.ptp(m.u, axis=0) > 0.0):
        raise RecordingError(f"{m.title}: no input varies, so it cannot be used for training; record the plant while it is driven")
    return Record(m.title, drive(model, m.u, held), y, good, noise)


@dataclass(frozen=True, eq=False)
class Noise:
    """Noise of each signal: standard deviation `sigma` [n_z] of its innovation, and its colour: e[k] = r[k] - sum of
    colour[i] r[k - 1 - i]. `level` [n_z] is the standard deviation of all of it."""

    sigma: Array
    colour: tuple[Array, ...]
    level: Array

    def white(self, residual: Array, good: NDArray[np.bool_]) -> Array:
        """Residuals [n, n_z] made white, of variance 1; 0 where a sample, or one that it follows from, is not sound."""
        found = np.empty_like(residual)
        for j, c in enumerate(self.colour):
            sound = _sound(good[:, j], len(c))
            found[:, j] = np.where(sound, lfilter(np.concatenate([[1.0], -c]), [1.0], residual[:, j]) / self.sigma[j], 0.0)
        return found

    def weight(self, good: NDArray[np.bool_]) -> Array:
        """1 where a whitened sample counts."""
        return np.stack([_sound(good[:, j], len(c)) for j, c in enumerate(self.colour)], axis=1).astype(float)


def _sound(good: NDArray[np.bool_], order: int) -> NDArray[np.bool_]:
    found = good.copy()
    for i in range(1, order + 1):
        found[i:] &= good[:-i]
        found[:i] = False
    return found


def at_first(model: Model, records: Sequence[Record], signals: Sequence[str]) -> Noise:
    """White noise as the model file states it, else as the recordings' own rows show it, else a hundredth of the signal."""
    stated = {s.name: s.noise for s in (*model.sensors, *model.outputs)}
    sigma = np.ones(len(signals))
    for j, name in enumerate(signals):
        own = [r.noise[j] for r in records if np.isfinite(r.noise[j]) and r.noise[j] > 0.0]
        size = max((float(np.std(r.y[r.good[:, j], j])) for r in records if r.good[:, j].any()), default=1.0)
        sigma[j] = stated[name] if stated[name] > 0.0 else max(float(np.median(own)) if own else 0.0, 1e-2 * size, 1e-12)
    return Noise(sigma, tuple(np.zeros(0) for _ in signals), sigma)


def of_residuals(residuals: Sequence[Array], goods: Sequence[NDArray[np.bool_]], before: Noise, coloured: bool = False) -> Noise:
    """The noise that residuals [n, n_z] of several recordings show; as before for a signal that nobody recorded."""
    sigma, level, colour = before.sigma.copy(), before.level.copy(), list(before.colour)
    for j in range(len(sigma)):
        lags, count = np.zeros(SETTINGS.data_orders + 1), 0
        for r, good in zip(residuals, goods, strict=True):
            x = np.where(good[:, j], r[:, j], 0.0)
            lags += [float(x[i:] @ x[: len(x) - i]) for i in range(SETTINGS.data_orders + 1)]
            count += int(good[:, j].sum())
        if count < 50 or lags[0] <= 0.0:
            continue
        lags /= count
        level[j] = np.sqrt(lags[0])
        best = solve_toeplitz(lags[:-1], lags[1:]) if lags[0] > 0.0 else np.zeros(SETTINGS.data_orders)
        left = lags[0] - float(best @ lags[1:])
        some = coloured and 0.0 < left < SETTINGS.data_explained * lags[0]
        colour[j], sigma[j] = (best, np.sqrt(left)) if some else (np.zeros(0), level[j])
    return Noise(sigma, tuple(colour), level)
