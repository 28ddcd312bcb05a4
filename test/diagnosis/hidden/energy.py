# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Sensor noise, and how much of a difference between signals stands out of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

Signals = Mapping[str, np.ndarray]


@dataclass(frozen=True)
class Noise:
    """White noise of which a share of the power is AR(1), then rounding to steps of `quantum`; `level`: RMS before rounding."""

    level: float
    share: float = 0.0
    pole: float = 0.0
    quantum: float = 0.0

    @property
    def rms(self) -> float:
        return float(np.hypot(self.level, self.quantum / np.sqrt(12)))

    def draw(self, rng: np.random.Generator, n: int) -> np.ndarray:
        slow = lfilter([np.sqrt(1 - self.pole**2)], [1, -self.pole], rng.standard_normal(n + 500))[500:]
        return self.level * (np.sqrt(1 - self.share) * rng.standard_normal(n) + np.sqrt(self.share) * slow)

    def rounded(self, x: np.ndarray) -> np.ndarray:
        return np.round(x / self.quantum) * self.quantum if self.quantum else x

    def power(self, cycles: np.ndarray) -> np.ndarray:
        """Variance a frequency bin, at frequencies in cycles a sample; its mean over all bins is the variance."""
        slow = (1 - self.pole**2) / np.abs(1 - self.pole * np.exp(-2j * np.pi * cycles)) ** 2
        return self.level**2 * (1 - self.share + self.share * slow) + self.quantum**2 / 12


def draw_noise(rng: np.random.Generator, level: tuple[float, float], hard: bool) -> Noise:
    """A sensor inside the range of data sheets: white, coloured or coarse; in hard mode always coloured."""
    rms = float(np.exp(rng.uniform(*np.log(level))))
    kind = "coloured" if hard else rng.choice(["white", "coloured", "coarse"], p=[0.5, 0.25, 0.25])
    if kind == "coloured":
        return Noise(rms, rng.uniform(0.3, 0.8), rng.uniform(0.8, 0.97))
    return Noise(rms, quantum=rms * rng.uniform(0.5, 2.5)) if kind == "coarse" else Noise(rms)


def whiten(signals: Signals, noise: Mapping[str, Noise], transfer: Mapping[str, np.ndarray], input_noise: float) -> np.ndarray:
    """Real vector whose squared length is the chi-square of the signals under sensor noise and white noise of the input.

    `transfer`: linear transfer from the input to each signal at the bins of rfft.
    """
    n = len(next(iter(signals.values())))
    bins = np.fft.rfftfreq(n)
    x = np.stack([np.fft.rfft(signals[s]) for s in noise], axis=-1)
    g = np.stack([transfer[s] for s in noise], axis=-1)
    covariance = input_noise**2 * g[:, :, None] * g[:, None, :].conj()
    covariance[:, range(len(noise)), range(len(noise))] += np.stack([w.power(bins) for w in noise.values()], axis=-1)
    white = np.linalg.solve(np.linalg.cholesky(covariance), x[..., None])[..., 0]
    weight = np.where((bins == 0) | (bins == 0.5), 1.0, 2.0) / n
    white = white * np.sqrt(weight)[:, None]
    return np.concatenate([white.real.ravel(), white.imag.ravel()])


def remaining(x: np.ndarray, free: Sequence[np.ndarray], known: Sequence[tuple[np.ndarray, float]]) -> float:
    """Chi-square of x that is left by the best combination of `free` directions, and of `known` ones with a prior RMS each."""
    columns = [*free, *(direction for direction, _ in known)]
    if not columns:
        return float(x @ x)
    a = np.stack(columns, axis=-1)
    prior = np.array([0.0] * len(free) + [1 / rms**2 for _, rms in known])
    scale = 1 / np.sqrt((a * a).sum(axis=0) + prior + 1e-300)
    normal = (a * scale).T @ (a * scale) + np.diag(prior * scale**2)
    projection = (a * scale).T @ x
    return float(max(x @ x - projection @ np.linalg.pinv(normal, rcond=1e-12, hermitian=True) @ projection, 0.0))
