# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How much noise a sensor adds, and of which colour: from a standstill, else from the spectrum above the signal's band.

The signal is kept out four ways. What the inputs and the other sensors explain linearly is subtracted, frequency by
frequency: friction is felt by several sensors, noise by one. Stretches of time with a burst at high frequency (friction
that turns, an impact) do not count, and of the others the median does: noise is always there. Second differences are
taken, so that nothing leaks from strong low frequencies. From the top down, a band is taken for noise only as long as
it continues what lies above it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincinv

Array = NDArray[np.float64]
Spectra = NDArray[np.complex128]  # [stretches of time, bins]
Index = NDArray[np.int64]
Flags = NDArray[np.bool_]
Kept = dict[tuple[object, ...], tuple[Spectra, Index]]  # transforms of channels, see estimate
TOP = 0.8  # of the Nyquist frequency: above it a resampling filter may have been
POLES = np.concatenate((-np.geomspace(0.98, 0.02, 40), [0.0], np.geomspace(0.02, 0.5, 40), 1.0 - np.geomspace(0.49, 0.002, 60)))
WHITE = 40  # the place of 0 in POLES
SPREAD = 2.08  # variance of the median of exponential variables over that of their mean, 1/ln(2)^2
WIDE = 2.0  # bins that the window makes one


@dataclass(frozen=True)
class Noise:
    """n[k] = c[k] + w[k] with c[k] = pole c[k-1] + e[k]; e and w are white, of standard deviation innovation and white.

    `std` is that of n. White noise has the pole 0; `white` is what the quantum explains. `above` [Hz]: the estimate
    rests on the spectrum from there on (0: on a standstill); below, it is this law's continuation. Channel's units.
    """

    std: float
    pole: float
    innovation: float
    white: float
    above: float

    def density(self, frequency: Array, interval: float) -> Array:
        """One-sided power spectral density [unit^2/Hz] at frequencies [Hz] for samples at an interval [s]."""
        shape = _shape(np.array([self.pole]), frequency * interval)[0]
        found: Array = 2.0 * interval * (self.innovation**2 * shape + self.white**2)
        return found


def estimate(
    values: Array,
    usable: Flags,
    interval: float,
    known: list[Array] | None = None,
    rest: Flags | None = None,
    quantum: float = 0.0,
    kept: Kept | None = None,
) -> Noise | None:
    """Noise of samples [n] at a constant interval [s]; None if there are too few for a spectrum, or they hardly change.

    `known`: channels [n, any] whose noise is another's: the inputs; the inputs and the other sensors. `rest` marks the
    samples of a standstill. `kept`, one dictionary for all channels of a recording, saves that each is transformed for every other.
    """
    kept = {} if kept is None else kept
    floor = quantum**2 / 12.0
    if rest is not None:
        spectrum = _spectrum(values, usable & rest, [], 0, kept)
        if spectrum is not None:
            cycles, level, weight, _ = spectrum
            return _fit(cycles, level, weight, interval, floor, 0.0, True)
    spectrum = _spectrum(values, usable, known or [], 2, kept)
    if spectrum is None:
        return None
    cycles, level, weight, unrest = spectrum
    first = int(np.searchsorted(cycles, 0.25 * TOP))
    while first > 0:
        low = min(int(np.searchsorted(cycles, 0.85 * cycles[first])), first - 1)
        law = _fit(cycles[low:], level[low:], weight[low:], interval, floor, 0.0, False)
        off = level[low:] / (law.density(cycles[low:] / interval, interval) / (2.0 * interval)) - 1.0
        part = weight[low:first].sum()
        misfit = np.sum(weight[low:] * off**2) / off.size
        if (
            abs(np.sum(weight[low:first] * off[: first - low])) / part > 0.02 + 3.0 / math.sqrt(part)
            or misfit > 1.2 + 3.0 * math.sqrt(2.0 / off.size)
            or np.sum(weight[low:first] * unrest[low:first]) / part > 1.05 + 3.0 / math.sqrt(part)
        ):
            break
        first = low
    return _fit(cycles[first:], level[first:], weight[first:], interval, floor, float(cycles[first]) / interval, True)


def _bending(cycles: Array, bends: int) -> Array:
    """By how much differences amplify the power at each frequency [cycles per sample]."""
    return (2.0 * np.sin(np.pi * cycles)) ** (2 * bends)


def _frames(values: Array, usable: Flags, bends: int, size: int, kept: Kept) -> tuple[Spectra, Index]:
    """Transforms [stretches, bins] of windowed stretches of differences, of those with usable samples only; starts. Not to be written
    to."""
    key = values.tobytes(), usable.tobytes(), bends, size
    if key not in kept:
        kept[key] = _transformed(values, usable, bends, size, size // 2)
    return kept[key]


def _transformed(values: Array, usable: Flags, bends: int, size: int, hop: int) -> tuple[Spectra, Index]:
    """The same, computed.

    The window's side lobes lie 92 dB below; its power is 1, so that the squares' mean is the variance per bin.
    """
    different = np.diff(values, bends)
    good = np.concatenate(([0], np.cumsum(np.lib.stride_tricks.sliding_window_view(usable, bends + 1).all(axis=1))))
    starts = np.arange(0, different.size - size + 1, hop)
    starts = starts[good[starts + size] - good[starts] == size]
    starts = starts[:: max(starts.size // 2000, 1)]  # of a long recording: the median of 2000 is known within 3 %
    if not starts.size:
        return np.empty((0, size // 2 + 1), dtype=complex), starts
    turn = 2.0 * np.pi * (np.arange(size) + 0.5) / size
    window = 0.35875 - 0.48829 * np.cos(turn) + 0.14128 * np.cos(2.0 * turn) - 0.01168 * np.cos(3.0 * turn)
    stretches = np.lib.stride_tricks.sliding_window_view(different, size)[starts]
    stretches = stretches - stretches.mean(axis=1, keepdims=True)
    return np.fft.rfft(stretches * (window / math.sqrt(np.sum(window**2))), axis=1), starts


def _spectrum(values: Array, usable: Flags, known: list[Array], bends: int, kept: Kept) -> tuple[Array, Array, Array, Array] | None:
    """Frequency [cycles per sample], variance density [unit^2 per half a cycle per sample], weight, unrest; by bands.

    What each of `known` [n, channels] explains linearly is left out; of them counts the one that leaves least. `weight`
    is one over the relative variance of the density, which is a median over quiet stretches of time; `unrest` is the
    mean over all stretches, divided by it. Long stretches see low frequencies and explain more, short ones fit between
    two bursts: the shorter count if they find much less.
    """
    best, least = None, math.inf
    for size in (1024, 512, 256, 128, 64):
        found = _bands(values, usable, known, bends, size, kept)
        if found is not None:
            top = float(np.mean(found[1][found[0] >= 0.25 * TOP]))
            if top < 0.8 * least:
                best, least = found, top
    return best


def _bands(values: Array, usable: Flags, known: list[Array], bends: int, size: int, kept: Kept) -> tuple[Array, Array, Array, Array] | None:
    """The same from stretches of `size` samples; None if there are too few."""
    enough = 24 if size > 64 else 8
    transform, starts = _frames(values, usable, bends, size, kept)
    if starts.size < enough:
        return None
    first = 6 if bends else 4  # the window's main lobe reaches to 4; differences leave a slope beside it
    bins = np.arange(first, int(TOP * size / 2) + 1)
    edges = np.unique(np.round(np.geomspace(first, bins[-1] + 1, 48)).astype(int)) - first
    transform = transform[:, bins]
    level, unrest = np.full(edges.size - 1, np.inf), np.ones(edges.size - 1)
    count = starts.size
    for company in (np.empty((values.size, 0)), *known):
        free = starts.size - company.shape[1]
        if free < 4 * company.shape[1]:
            continue
        rest = transform
        if company.shape[1]:
            drive = np.stack([_frames(u, usable, bends, size, kept)[0][:, bins] for u in company.T], axis=-1)
            rest = transform - _explained(drive, transform)
        power = np.abs(rest) ** 2 / _bending(bins / size, bends) * starts.size / free
        quiet = _quiet(power[:, bins >= 0.25 * TOP * size])
        if np.sum(quiet) < enough:
            continue
        now = _means(np.median(power[quiet], axis=0) / math.log(2.0), edges)  # of exponential variables
        less = now < 0.9 * level  # by more than chance
        level[less] = now[less]
        unrest[less] = (_means(np.mean(power, axis=0), edges) / np.maximum(now, 1e-300))[less]
        count = int(np.sum(quiet)) if less.any() else count
    if not np.all(np.isfinite(level) & (level > 0.0)):
        return None
    return _means(bins / size, edges), level, (1.0 + np.diff(edges)) / WIDE * count / SPREAD, unrest


def _quiet(power: Array) -> Flags:
    """The stretches [stretches, bins] without a burst: not louder than 99 % are where noise is all there is."""
    loud = np.mean(power / np.maximum(np.median(power, axis=0), 1e-300), axis=1)
    freedom = power.shape[1] / WIDE
    quiet: Flags = loud <= np.quantile(loud, 0.1) * gammaincinv(freedom, 0.99) / gammaincinv(freedom, 0.1)
    return quiet


def _means(values: Array, edges: Index) -> Array:
    return np.add.reduceat(values, edges[:-1]) / np.diff(edges)


def _explained(drive: NDArray[np.complex128], transform: Spectra) -> Spectra:
    """The part of transform [stretches, bins] that is linear in drive [stretches, bins, channels], bin by bin."""
    size = np.sqrt(np.mean(np.abs(drive) ** 2, axis=0)) + 1e-300
    drive = (drive / size).transpose(1, 0, 2)  # bins first
    adjoint = drive.conj().transpose(0, 2, 1)
    across = adjoint @ drive + 1e-10 * drive.shape[1] * np.eye(drive.shape[2])
    gain = np.linalg.solve(across, adjoint @ transform.T[:, :, None])
    return (drive @ gain)[:, :, 0].T


def _shape(poles: Array, cycles: Array) -> Array:
    """abs(1 / (1 - pole z^-1))^2 for each pole and each frequency [cycles per sample]."""
    return 1.0 / (1.0 + poles[:, None] ** 2 - 2.0 * poles[:, None] * np.cos(2.0 * np.pi * cycles))


def _fit(cycles: Array, level: Array, weight: Array, interval: float, floor: float, above: float, careful: bool) -> Noise:
    """The law of highest Whittle likelihood with a white part of variance `floor`; white if a pole hardly matters.

    `careful`: of all poles that are as likely, the one that says least about what was not seen.
    """
    shape = _shape(POLES, cycles)
    share = weight / weight.sum()
    floor = min(floor, 0.9 * float(np.min(level)))
    scale = np.sum(share * np.maximum(level - floor, 0.01 * level) / shape, axis=1, keepdims=True)
    for _ in range(12):  # towards the root of the likelihood's derivative
        model = scale * shape + floor
        scale *= np.sum(share * level * shape / model**2, axis=1, keepdims=True) / np.sum(share * shape / model, axis=1, keepdims=True)
    model = scale * shape + floor
    misfit = 2.0 * np.sum(weight * (np.log(model) + level / model), axis=1)  # minus twice the log-likelihood
    best = int(np.argmin(misfit))
    if misfit[WHITE] - misfit[best] < 15.0:  # a chi-square of one degree that white noise exceeds once in 10 000
        best = WHITE
    elif careful:
        alike = np.flatnonzero(misfit < misfit[best] + 4.0)
        best = int(alike[np.argmin(np.abs(POLES[alike]))])
    pole, power = float(POLES[best]), float(scale[best, 0])
    std = math.sqrt(power / (1.0 - pole * pole) + floor)
    return Noise(std, pole, math.sqrt(power), math.sqrt(floor), above)
