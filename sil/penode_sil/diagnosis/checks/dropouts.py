# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Samples that one sensor alone shows: short bursts, rows of a repeated value, signals that sink to zero or discharge."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..study.noise import Experiment

Array = NDArray[np.float64]
CHANCE = 1e-3  # that a whole recording has one row of repeated samples as long
EVEN = 1e-4  # of the square of a fall: falls that differ less are of the same share
STEADY = 6  # falls in a row, of eight samples: of noise, fewer than one in a hundred is so even
MAX_SILENT = 0.5  # of the motion: a sensor that shows more of it is no silent one
LAST = 8  # samples: so far the end of a spline is felt


def bursts(experiments: Sequence[Experiment], simulated: Sequence[Array]) -> list[NDArray[np.bool_]]:
    """Samples [n, n_z] of short bursts that one sensor alone shows: against neighbours far beyond its usual roughness."""
    found = []
    for e, z in zip(experiments, simulated, strict=True):
        r = np.where(e.good, e.y - z, 0.0)
        smooth = _bridged(r, e.good)
        rough = np.abs(np.diff(smooth, 2, axis=0, prepend=smooth[:1], append=smooth[-1:]))
        # at least a tenth of the samples of a coarse sensor steps by a quantum
        usual = np.maximum(1.4826 * np.median(rough, axis=0), np.quantile(rough, 0.9, axis=0) / 1.645) + 1e-300
        wild = rough > 14.0 * usual
        wild[: max(20, int(0.1 / e.step))] = wild[-LAST:] = False  # where start states and rates of inputs are not well known
        wide = np.stack([np.convolve(w, np.ones(9), "same") > 0 for w in wild.T], axis=1)
        alone = wide & (np.sum(wide, axis=1, keepdims=True) == 1) if wide.shape[1] > 1 else wide
        few = np.mean(wild & alone, axis=0) < 0.03
        many = np.sum(wild & alone, axis=0) >= np.where(np.max(rough, axis=0) > 30.0 * usual, 2, 5)
        often = np.mean(e.good, axis=0) > 0.5  # a sensor slower than the raster has no neighbours to be far beyond
        found.append(((alone & few & many) | _sunken(e, z, r) | _frozen(e, z, r) | _decayed(e.y)) & often & e.good)
        found[-1][0] |= (rough[0] > 14.0 * usual) & often & e.good[0]  # what begins just then may be in it or not
    return found


def _bridged(r: Array, good: NDArray[np.bool_]) -> Array:
    """Residuals [n, n_z] with straight lines where samples are not good: a hole in them is not rough."""
    out = r.copy()
    rows = np.arange(len(r))
    for j in np.flatnonzero(~good.all(axis=0) & good.any(axis=0)):
        out[:, j] = np.interp(rows, rows[good[:, j]], r[good[:, j], j])
    return out


def _usual(e: Experiment, r: Array) -> Array:
    """How far each sensor usually is from the model. At rest a coarse one shows its model's zero: in motion it is a quarter of a
    quantum off, in the median."""
    quanta = np.array([np.median(gaps) if gaps.size else 0.0 for gaps in (np.diff(np.unique(y)) for y in e.y.T)])
    usual: Array = 1.4826 * np.maximum(np.median(np.abs(r), axis=0), 0.25 * quanta) + 1e-300
    return usual


def _frozen(e: Experiment, z: Array, r: Array) -> NDArray[np.bool_]:
    """Samples that repeat a value while the model moves by more than any coarse sensor would let pass."""
    usual = _usual(e, r)
    found = np.zeros(r.shape, dtype=bool)
    for j in range(r.shape[1]):
        same = np.concatenate([[0], (np.diff(e.y[:, j]) == 0.0).astype(np.int8), [0]])
        edges = np.flatnonzero(np.diff(same))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            if b - a >= 4 and np.ptp(z[a : b + 1, j]) > 6.0 * usual[j] and e.good[a : b + 1, j].any():
                found[a + 1 : b + 1, j] = True
        if np.mean(found[:, j]) > 0.2:  # that is no sensor at all, or slower than the raster
            found[:, j] = False
    return found


def repeats(y: Array, z: Array, good: NDArray[np.bool_], quantum: float, sigma: float) -> NDArray[np.bool_]:
    """Good samples [n] of a sensor that repeat the one before in rows too long for its noise and quantum, while the model z
    moves. Of zeros, which is what lost samples are mostly set to, the first one counts as well."""
    same = np.diff(y) == 0.0
    edges = np.flatnonzero(np.diff(same.astype(np.int8), prepend=0, append=0))
    usual = max(quantum / (2.0 * np.sqrt(np.pi) * sigma), float(np.mean(same & good[1:])))  # chance of the same twice
    found = np.zeros(len(y), dtype=bool)
    for a, b in zip(edges[::2], edges[1::2] + 1, strict=True):
        if len(y) * usual ** (b - a - 1) < CHANCE and np.ptp(z[a:b]) > quantum:
            found[a + (y[a] != 0.0) : b] = True
    return found & good


def _sunken(e: Experiment, z: Array, r: Array) -> NDArray[np.bool_]:
    """Samples of short stretches in which a sensor sinks towards zero while the model goes on."""
    usual = _usual(e, r)
    longest = int(0.5 / e.step)
    found = np.zeros(r.shape, dtype=bool)
    for j in range(r.shape[1]):
        far = np.abs(r[:, j]) > 6.0 * usual[j]
        wide = np.convolve(far, np.ones(9), "same") > 0
        edges = np.flatnonzero(np.diff(np.concatenate([[0], wide.astype(np.int8), [0]])))
        empty = []
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            inside = far[a:b]
            y, model = e.y[a:b, j][inside], z[a:b, j][inside]
            sinks = (np.abs(y) < np.abs(model)) & (y * model > -0.1 * model**2) | (np.abs(y) < 0.05 * np.max(np.abs(model)))
            less = y @ model < MAX_SILENT * (model @ model)  # a model that is a little wrong is followed, though by less
            fades = _discharges(y)  # from where it was, which may be of the other sign
            deep = np.min(np.abs(y)) < 0.25 * np.max(np.abs(model))
            if (
                a > int(0.1 / e.step)
                and b - a < longest
                and (fades or (less and np.mean(sinks) > 0.95))
                and deep
                and np.count_nonzero(inside) > 4
            ):
                found[a:b, j] = True
                empty.append(fades)
        if np.mean(found[:, j]) > (0.06 if np.mean(empty or [False]) > 0.5 else 0.02):  # that often, only what discharges
            found[:, j] = False
    return found


def _discharges(y: Array) -> bool:
    """Does a signal fall by the same share in each sample, as no motion does: what is left of a sensor without supply?"""
    if len(y) < 12 or np.any(y == 0.0):
        return False
    falls = -np.diff(np.log(np.abs(y)))
    usual = float(np.median(falls))
    return usual > 0.0 and float(np.median(np.abs(falls - usual))) < 0.05 * usual


def _decayed(y: Array) -> NDArray[np.bool_]:
    """Samples [n, n_z] that fall to zero by the same share each, to four digits: a digital filter that has lost its input."""
    found = np.zeros(y.shape, dtype=bool)
    change = np.diff(y, axis=0)
    even = np.abs(y[2:] * y[:-2] - y[1:-1] ** 2) < EVEN * change[1:] ** 2
    less = (np.abs(y[1:]) < np.abs(y[:-1])) & (y[1:] * y[:-1] > 0.0)
    falls = even & less[1:] & less[:-1]
    for j in range(y.shape[1]):
        edges = np.flatnonzero(np.diff(falls[:, j].astype(np.int8), prepend=0, append=0))
        for a, b in zip(edges[::2], edges[1::2], strict=True):
            if b - a >= STEADY:
                found[a + 1 : b + 2, j] = True
    return found
