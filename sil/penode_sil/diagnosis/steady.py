# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Whether the vehicle is the same all the time.

A stiffness or damping that changes while it drives is a controller or a leak, and on no list but for dampers that fade. A fit of
constants takes the mean of it, and what is left is as slow and as small as noise of a sensor may be. But it knows when the
vehicle moved and how: along that motion few values make much of it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage, special

from .fit import Fit
from .noise import Experiment, Metric
from .score import Seen
from .study import Study, watch
from .tones import swept

Array = NDArray[np.float64]
PIECES = 5  # hats over the time of a recording that a changing coefficient is made of
OCTAVES = 8  # hats over the logarithm of frequency that an error of a measured input is made of
NEAR = 0.5  # [s] over which an input is loud or quiet
LOWEST = 0.3  # [Hz] where they begin
TWIN = 1e-6  # of the largest singular value: less is rounding
OWN = 1e-3  # of its length that a direction must have beside what is free


@dataclass(frozen=True)
class Change:
    """The place whose stiffness or damping seems to change the most: by how much chi2 falls if it may, and -log of the chance that
    noise does that."""

    place: str = ""
    what: str = ""
    gain: float = 0.0
    surprise: float = 0.0


def change(study: Study, fit: Fit, seen: Sequence[Seen]) -> Change:
    """What changes the most beside a fit, whose values are free, as are constant stiffness and damping at all places and start states.

    Its motion is the simulated one: one that is smoothed has the residual in it, and a part of that would be free.
    Recordings under a sine or a sweep do not count: there, time is frequency, and an error that depends on one of them is the
    same as one that depends on the other. Nor do places at a measured input with noise, which their own deflection has.
    """
    n_z = len(study.model.sensors)
    noisy = [i for i in range(len(study.model.inputs)) if any(e.unsure[:, i].any() for e in study.experiments)]
    ends = {study.model.inputs[i].name for i in noisy}
    acting = [k for k, p in enumerate(study.places) if p.elements and not ends & set(p.ends)]
    still = [not swept(e.u, e.step) for e in study.experiments]
    if not acting or not any(still):
        return Change()
    parts = list(zip(study.experiments, study.metrics, seen, watch(study, fit), strict=True))
    sizes = [2 * e.band * n_z for e in study.experiments]
    free = [f for f in fit.free if f.low < f.value < f.high]
    index = {f.target: i for i, f in enumerate(fit.free)}
    own = fit.jacobian[:, [index[f.target] for f in free]], np.diag([f.unit / f.sigma for f in free])

    def columns(of: Callable[[Experiment, Metric, Seen, Array], Array], apart: bool) -> Array:
        """Effects [rows and priors, any] from those in each recording, of one value for all of them or of one for each."""
        found = [of(*p) for p in parts]
        stacked = [np.pad(x, ((sum(sizes[:e]), sum(sizes[e + 1 :])), (0, 0))) for e, x in enumerate(found)]
        rows = np.hstack(stacked) if apart else np.vstack(found)
        return np.pad(rows, ((0, len(free)), (0, 0)))

    constant = [columns(lambda *p, k=k: _forces(*p, k, n_z, 1), False) for k in range(len(study.places))]
    starts = [columns(lambda e, m, s, z: _whitened(e, m, np.moveaxis(s.free, 2, 0)), True)] if seen[0].free is not None else []
    errors = [columns(lambda e, m, s, z, i=i: _errors(study, e, m, i), True) for i in noisy]
    basis = _basis(np.hstack([np.vstack(own), *constant, *starts, *errors]))
    r = np.concatenate([fit.residual, [-f.offset for f in free]])
    r -= basis @ (basis.T @ r)
    found = [Change()]
    for k in acting:
        both = columns(lambda *p, k=k: _forces(*p, k, n_z, PIECES), True).reshape(len(r), len(parts), 2, PIECES)
        for j, what in enumerate(("stiffness", "damping")):
            some = both[:, still, j].reshape(len(r), -1)
            some /= np.linalg.norm(some, axis=0) + 1e-300
            u, values, _ = np.linalg.svd(some - basis @ (basis.T @ some), full_matrices=False)
            u = u[:, values > OWN]
            gain = float(np.sum((u.T @ r) ** 2))
            if u.shape[1]:
                found.append(Change(study.places[k].name, what, gain, surprise(gain, u.shape[1])))
    return max(found, key=lambda c: c.surprise)


def surprise(gain: float, freedom: int) -> float:
    """-log of the chance that chi-square of so many degrees exceeds a gain; infinite where that is no number."""
    with np.errstate(divide="ignore"):
        return -float(np.log(special.chdtrc(freedom, gain)))


def _forces(e: Experiment, m: Metric, seen: Seen, paths: Array, place: int, n_z: int, pieces: int) -> Array:
    """White effects [rows, 2 pieces] of a stiffness, then of a damping, that is there for a while, along simulated sensors and paths."""
    at = np.linspace(0.0, pieces - 1.0, len(e.time))
    hats = np.maximum(1.0 - np.abs(at - np.arange(pieces)[:, None]), 0.0)
    s, v = paths[:, n_z + 2 * place], paths[:, n_z + 2 * place + 1]
    force = np.concatenate([hats * (s - s.mean()), hats * v])
    return _whitened(e, m, seen.answer(fft.rfft(force, axis=1)[:, : e.band], place))


def _errors(study: Study, e: Experiment, m: Metric, i: int) -> Array:
    """White effects [rows, 4 OCTAVES] of an input that is larger or later than measured at some frequencies, while it is loud and while it
    is quiet: noise may make it seem so, and between two bumps it is all there is."""
    f = e.frequencies[: e.band]
    h = study.linear.transfer(e.frequencies)[: e.band, : e.y.shape[1], i]
    at = np.log(np.maximum(f / LOWEST, 1.0)) / np.log(f[-1] / LOWEST) * (OCTAVES - 1.0)
    hats = np.maximum(1.0 - np.abs(at - np.arange(OCTAVES)[:, None]), 0.0)
    near = ndimage.uniform_filter1d(e.rate[:, i] ** 2, max(int(NEAR / e.step), 1))
    loud = near / (near + near.mean() + 1e-300)
    drive = e.drive[:, i] - e.drive[:, i].mean()
    spectra = fft.rfft([loud * drive, (1.0 - loud) * drive])[:, : e.band]
    moved = np.concatenate([hats * x for x in (*spectra, *(1j * spectra))])
    return _whitened(e, m, moved[:, :, None] * h)


def _whitened(e: Experiment, m: Metric, spectra: NDArray[np.complex128]) -> Array:
    """White rows [rows, k] of spectra [k, f, sensors], without the samples that do not count."""
    if not e.good.all():
        whole = np.zeros((len(spectra), len(e.frequencies), spectra.shape[2]), dtype=complex)
        whole[:, : e.band] = spectra
        spectra = m.spectrum(fft.irfft(whole, len(e.time), axis=1) * e.good)
    return m.white(spectra).T


def _basis(columns: Array) -> Array:
    """An orthonormal basis of the span of columns."""
    u, values, _ = np.linalg.svd(columns / (np.linalg.norm(columns, axis=0) + 1e-300), full_matrices=False)
    return u[:, values > TWIN * values[0]]
