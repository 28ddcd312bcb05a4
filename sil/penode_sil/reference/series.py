# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Signals as Chebyshev series over short segments: what compiled code can evaluate whatever a signal is made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct

from ..signals import Signal
from .accuracy import RTOL

Array = NDArray[np.float64]
TERMS = 16  # of a series, twice the samples a segment at most, and halvings of one: a kink that is no knot leaves 1e-5 of it in doubt
CLOSE = RTOL  # of the largest value: what the last terms of a series may be


@dataclass(frozen=True, eq=False)
class Series:
    """`value` and `slope` [segments, signals, TERMS] over segments between `bounds` [segments + 1] s; segments first[i] to
    first[i + 1] are those of piece i."""

    bounds: Array
    first: NDArray[np.uintp]
    value: Array
    slope: Array


def fitted(signals: Sequence[Signal], edges: Array, sample_time: float) -> Series:
    """Signals that are smooth between `edges` [s], as series over segments of at most half as many samples as terms."""
    counts = np.maximum(np.ceil(2.0 * np.diff(edges) / (TERMS * sample_time)), 1.0).astype(int)
    bounds = np.concatenate(
        [*(np.linspace(a, b, n, endpoint=False) for a, b, n in zip(edges, edges[1:], counts, strict=False)), edges[-1:]]
    )
    value, slope = _terms(signals, bounds)
    for _ in range(TERMS):
        far = np.flatnonzero(~_close(value, slope))
        if not far.size:
            break
        middle = 0.5 * (bounds[far] + bounds[far + 1])
        halves = np.stack([bounds[far], middle, middle, bounds[far + 1]], axis=1).reshape(-1, 2)
        finer = _terms(signals, halves)
        value, slope = (
            np.insert(np.delete(old, far, 0), np.repeat(far - np.arange(far.size), 2), new, 0)
            for old, new in zip((value, slope), finer, strict=True)
        )
        bounds = np.insert(bounds, far + 1, middle)
    return Series(bounds, np.searchsorted(bounds, edges).astype(np.uintp), value, slope)


def _terms(signals: Sequence[Signal], bounds: Array) -> tuple[Array, Array]:
    """Coefficients of values and slopes [segments, signals, TERMS] over segments between `bounds` [segments + 1], or [segments, 2]."""
    ends = np.stack([bounds[:-1], bounds[1:]], axis=1) if bounds.ndim == 1 else bounds
    nodes = np.cos(np.pi * (np.arange(TERMS) + 0.5) / TERMS)  # inside of the segment: what happens at its ends is no matter
    t = ends.mean(axis=1, keepdims=True) + 0.5 * np.diff(ends, axis=1) * nodes
    both = []
    for what in ("value", "slope"):
        rows = [getattr(signal, what)(t.ravel()).reshape(t.shape) for signal in signals]
        found = dct(np.stack(rows, axis=1), axis=-1) / TERMS if rows else np.zeros((len(t), 0, TERMS))
        found[..., 0] *= 0.5
        both.append(found)
    return both[0], both[1]


def _close(*both: Array) -> NDArray[np.bool_]:
    """For each segment: have the last terms of all series vanished?"""
    good = np.ones(len(both[0]), dtype=bool)
    for terms in both:
        scale = np.abs(terms).max(axis=(0, 2), initial=0.0)
        tail = np.abs(terms[..., -2:]).max(axis=-1, initial=0.0)
        good &= (tail <= CLOSE * scale).all(axis=-1)
    return good
