# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The motion as it was, whatever is missing from the model.

Unknown forces at all places with elements, with spectra that the data choose (expectation and maximisation), explain what a simulation
leaves; what they do to deflections and rates is known from the linearised plant.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from ..plant.plant import Linear, Place
from .noise import Experiment, Metric

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Path:
    """Deflection and rate [n] of a place in one recording."""

    s: Array
    v: Array


@dataclass(frozen=True, eq=False)
class Seen:
    """One recording after the smoother: the motion of every place, and the forces [n] that explain the residual, at places with
    elements."""

    motions: tuple[Path, ...]
    forces: dict[int, Array]


def size(motions: Sequence[Path]) -> tuple[float, float]:
    """What deflection and rate reach, but for a thousandth of the time."""
    s, v = (max(float(np.quantile(np.abs(x), 0.999)) for x in some) for some in ([m.s for m in motions], [m.v for m in motions]))
    return s, v


def smooth(e: Experiment, m: Metric, levels: Array, linear: Linear, found: Sequence[Place], simulated: Array, paths: Array) -> Seen:
    """Motion and forces as they most likely were, from a simulation: its sensors [n, n_z] and paths [n, 2 places]."""
    n, band = len(e.time), e.band
    n_z, n_u = linear.n_sensors, linear.n_inputs
    acting = [k for k, p in enumerate(found) if p.role != "body"]
    h = linear.transfer(e.frequencies[:band])[:, :, [n_u + k for k in acting] + list(range(n_u))]
    r = m.spectrum(np.where(e.good, e.y - simulated, 0.0)) / np.sqrt(n)
    w = np.einsum("fqz,fz->fq", likely(e, levels, h[:, :n_z], len(acting), r), r) * np.sqrt(n)
    whole = np.zeros((len(e.frequencies), 2 * len(found) + len(acting)), dtype=complex)
    whole[:band] = np.concatenate([np.einsum("fyq,fq->fy", h[:, n_z:], w), w[:, : len(acting)]], axis=1)
    change, forces = np.split(fft.irfft(whole, n, axis=0), [2 * len(found)], axis=1)
    motions = tuple(Path(s, v) for s, v in zip((paths + change).T[::2], (paths + change).T[1::2], strict=True))
    return Seen(motions, dict(zip(acting, forces.T, strict=True)))


def likely(e: Experiment, levels: Array, g: Complex, acting: int, r: Complex) -> Complex:
    """Gain [f, q, n_z] from spectra of a residual to those of the part that reaches the sensors through g [f, n_z, q]: `acting` forces
    first, then errors of the inputs. These are their most likely values; the spectra of the forces are those that spectra r [f, n_z] of
    a residual suggest, smooth over half a hertz."""
    band = len(g)
    weighted = np.conj(np.swapaxes(g, 1, 2)) / levels[:, None, :]
    curvature, slope = weighted @ g, (weighted @ r[:, :, None])[:, :, 0]
    prior = np.empty((band, g.shape[2]))
    prior[:, :acting] = 1.0 / np.median(np.einsum("fqq->fq", curvature).real[:, :acting], axis=0)
    prior[:, acting:] = np.maximum(e.unsure[:band], 1e-15) ** 2
    kernel = np.hanning(2 * max(int(0.5 / e.frequencies[1]), 3) + 1)
    weight = np.convolve(np.ones(band), kernel, "same")
    for again in range(8):
        root = np.sqrt(prior)  # the inverse is that of q x q numbers, of which none is below 1
        inner = np.linalg.inv(np.eye(len(root.T)) + root[:, :, None] * curvature * root[:, None, :])
        if again < 7:
            left = prior * np.einsum("fqq->fq", inner).real
            power = np.abs(root * (inner @ (root * slope)[:, :, None])[:, :, 0]) ** 2 + np.maximum(left, 0.0)
            for q in range(acting):
                prior[:, q] = np.maximum(np.convolve(power[:, q], kernel, "same") / weight, 1e-30)
    gain: Complex = root[:, :, None] * inner * root[:, None, :] @ weighted
    return gain
