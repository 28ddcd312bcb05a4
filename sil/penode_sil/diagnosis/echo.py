# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Whether what is left follows the motion of a body late, as the rear axle of a vehicle that pitches does.

It meets the same road some time after the front axle, and moves the body through its inertia in pitch. A mount that yields and a mass on
it, both together, come near to that. But what causes on the list leave is about as much like the motion that is to come as like the one
that was, since they act at once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import fft

from .fit import Fit
from .study import Study, watch

LAGS = 0.05, 1.0  # [s] of a wheelbase at 50 to 2.5 m/s
LOUD = 25.0  # chi2 of three numbers that of 40 lags at two bodies one in 1000 recordings exceeds
CLEAR = 2.5  # times the same of the motion that is to come
APART = 1.6  # times that of the motion at about the same time
LAGGING = {"hidden_resonance", "maxwell_bushing", "tyre_damping"}  # kinds that have a memory and no curve, as pitch has


@dataclass(frozen=True)
class Echo:
    """Reduction of chi2 by forces on a body that are proportional to its deflection, rate and acceleration at another time: `late`,
    `early`, or `soon`, before the first of LAGS."""

    late: float = 0.0
    early: float = 0.0
    soon: float = 0.0

    @property
    def detected(self) -> bool:
        return self.late > max(LOUD, CLEAR * self.early, APART * self.soon)


def echo(study: Study, fit: Fit) -> Echo:
    """The clearest echo of any body in any recording that a fit leaves: late rather than early. Takes about as long as a simulation."""
    found, begin, n_z = [Echo()], 0, len(study.model.sensors)
    for e, metric, paths in zip(study.experiments, study.metrics, watch(study, fit), strict=True):
        n, rows = len(e.time), 2 * e.band * n_z
        left = fit.residual[begin : begin + rows].view(complex)
        begin += rows
        near, far = (min(int(lag / e.step), n // 3) for lag in LAGS)
        for k, place in enumerate(study.places):
            if place.role != "body":
                continue
            s, v = paths[:, n_z + 2 * k], paths[:, n_z + 2 * k + 1]
            forces = fft.rfft([s - s.mean(), v, np.gradient(v, e.step)])[:, : e.band]
            response = study.linear.transfer(e.frequencies)[: e.band, :n_z, study.linear.n_inputs + k]
            white = metric.white(forces[:, :, None] * response).view(complex)
            product = np.einsum("is,js->ij", white.conj(), white).real
            shared = (white.conj() * left).reshape(3, n_z, -1).sum(axis=1)
            shared[:, 0] = 0.0
            along = 0.5 * n * fft.irfft(shared, n, axis=1)  # at all lags
            gain = np.einsum("it,ij,jt->t", along, np.linalg.pinv(product, rcond=1e-10, hermitian=True), along)
            found.append(
                Echo(*(float(np.max(gain[part], initial=0.0)) for part in (slice(near, far), slice(n - far, n - near), slice(near))))
            )
    return max(found, key=lambda x: x.late - x.early)
