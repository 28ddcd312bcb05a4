# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The Runge-Kutta step of the quarter vehicle in float64, and how far from it rounding in float may lead."""

from __future__ import annotations

import numpy as np
import peers
from numpy.typing import NDArray

U32 = 2.0**-24  # unit roundoff of float


def reference_step(case: peers.Case, x: NDArray, before: NDArray, now: NDArray) -> tuple[NDArray, NDArray]:
    """
    The step in float64 from states x [n][4], and how far a float step may be away, in any order of its operations.

    Running error analysis: a sum of k products is off by at most (k + 1) u of the sum of their magnitudes, u = 2^-24,
    first order; here 4 more, for constants that are rounded and for scaling that is applied apart from the weights.
    What the inputs were off by passes a layer times the magnitudes of its weights (ReLU does not enlarge it). u is
    doubled: for terms of second order, and for a physics expression that is put together in another way.
    """
    u = 2 * U32

    def network(layers: list[peers.Layer], signal: NDArray, off: NDArray) -> tuple[NDArray, NDArray]:
        a, e = signal[:, None], off[:, None]
        for k, (weights, bias) in enumerate(layers):
            w, b = weights.astype(float), bias.astype(float)
            e = e @ np.abs(w).T + (w.shape[1] + 5) * u * (np.abs(a) @ np.abs(w).T + np.abs(b))
            a = a @ w.T + b
            a = a if k == len(layers) - 1 else np.maximum(a, 0)
        return a[:, 0], e[:, 0]

    def rates(at: NDArray, e: NDArray, road: NDArray) -> tuple[NDArray, NDArray]:
        s, v, tyre = at[:, 0] - at[:, 1], at[:, 2] - at[:, 3], at[:, 1] - road
        es, ev = e[:, 0] + e[:, 1] + u * np.abs(s), e[:, 2] + e[:, 3] + u * np.abs(v)
        et = e[:, 1] + 4 * u * (np.abs(at[:, 1]) + np.abs(road))
        (f1, e1), (f2, e2) = network(case.networks["spring"], s, es), network(case.networks["damper"], v, ev)
        force = case.c * s + case.d * v + f1 + f2
        size = np.abs(case.c * s) + np.abs(case.d * v) + np.abs(f1) + np.abs(f2)
        ef = case.c * es + case.d * ev + e1 + e2 + 6 * u * size
        wheel, ew = force - case.c_t * tyre, ef + case.c_t * et + 3 * u * (size + np.abs(case.c_t * tyre))
        rate = np.stack([at[:, 2], at[:, 3], -force / case.m_b, wheel / case.m_w], axis=1)
        off = np.stack([e[:, 2], e[:, 3], ef / case.m_b, ew / case.m_w], axis=1)
        return rate, off + 3 * u * np.abs(rate)

    x, h = x.astype(float), case.h
    before, now = before.astype(float), now.astype(float)
    share = (0.0, 0.5, 0.5, 1.0)
    k, ek, at, e = [], [], x, np.zeros_like(x)
    for stage in range(4):
        rate, off = rates(at, e, before + share[stage] * (now - before))
        k, ek = [*k, rate], [*ek, off]
        if stage < 3:
            step = share[stage + 1] * h
            at, e = x + step * rate, step * off + 3 * u * (np.abs(x) + step * np.abs(rate))
    total, e = (k[0] + 2 * k[1] + 2 * k[2] + k[3]) * h / 6, (ek[0] + 2 * ek[1] + 2 * ek[2] + ek[3]) * h / 6
    size = (np.abs(k[0]) + 2 * np.abs(k[1]) + 2 * np.abs(k[2]) + np.abs(k[3])) * h / 6
    return x + total, e + 6 * u * size + u * np.abs(x + total)


def same_step(case: peers.Case, x: NDArray, u: NDArray) -> float:
    """Largest difference to the reference of each step from the state before, as a share of the rounding bound."""
    expected, allowed = reference_step(case, x[:-1], u[1:-1], u[2:])
    return float(np.max(np.abs(x[1:] - expected) / allowed))
