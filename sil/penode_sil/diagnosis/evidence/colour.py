# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Noise of sensors that is not white: what whitens the means of samples between updates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, linalg

from ..study.noise import Experiment

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Colour:
    """Innovations less what `taps` [before, n_z] of those before them predict of their noise, which leaves white noise of this `variance`
    [n_z]. The filter is monic, so that log likelihoods with and without it compare (Box and Jenkins, Time Series Analysis, 1976, 7.1)."""

    taps: Array
    variance: Array

    @staticmethod
    def none(noise: Array, update: int) -> Colour:
        """Of white noise with this deviation [n_z] of a sample."""
        return Colour(np.zeros((0, len(noise))), noise**2 / update)

    @staticmethod
    def of(shape: Array, noise: Array, update: int, before: int) -> Colour:
        """Of noise whose spectrum [f, n_z], from 0 Hz to half of the sampling rate, has this `shape`, and at its least the power of white
        noise [n_z]; so many updates `before` one predict it."""
        taps, variance = np.zeros((before, len(noise))), np.zeros(len(noise))
        for j, sigma in enumerate(noise):
            means = _of_means(fft.irfft(sigma**2 * shape[:, j] / np.min(shape[:, j]), 2 * len(shape) - 2), update, before)
            taps[:, j] = linalg.solve_toeplitz(means[:-1], means[1:])
            variance[j] = means[0] - taps[:, j] @ means[1:]
        return Colour(taps, variance)

    def white(self, nu: Array) -> Array:
        """Innovations [..., updates, n_z] of one recording, NaN where nothing was measured, without what is predicted of their noise."""
        if not len(self.taps):
            return nu
        before, found = len(self.taps), np.empty_like(nu)
        rows = np.zeros((*nu.shape[:-2], before + nu.shape[-2]))  # zeros before each run: all sums are as long, and equal runs stay equal
        for j, taps in enumerate(self.taps.T):
            rows[..., before:] = nu[..., j]
            lost = ~np.isfinite(rows)
            np.copyto(rows, 0.0, where=lost)
            white = np.convolve(rows.ravel(), [1.0, *-taps])[: rows.size].reshape(rows.shape)
            np.copyto(white, np.nan, where=lost)
            found[..., j] = white[..., before:]
        return found


def shape(experiments: Sequence[Experiment], levels: Sequence[Array]) -> Array:
    """The mean spectrum [f, n_z] of the noise of sensors over recordings, from 0 Hz to half of the sampling rate, of `levels` [f, n_z] in
    the band of each: above it noise stays as it is at its end."""
    at = experiments[0].frequencies * experiments[0].step
    own = [(e.frequencies[: len(x)] * e.step, x.T) for e, x in zip(experiments, levels, strict=True)]
    mean: Array = np.mean([[np.interp(at, f, column) for column in columns] for f, columns in own], axis=0)
    return mean.T


def is_white(shape: Array) -> bool:
    """Is there as much noise at all frequencies?"""
    return bool(np.allclose(shape, shape[0]))


def _of_means(covariance: Array, update: int, before: int) -> Array:
    """Autocovariances [before + 1] of means of `update` samples, from those of samples [lags], that go round."""
    lags = np.arange(-update + 1, update)
    weights = (update - np.abs(lags)) / update**2
    at = update * np.arange(before + 1)[:, None] + lags
    return np.asarray(covariance[np.abs(at) % len(covariance)] @ weights)
