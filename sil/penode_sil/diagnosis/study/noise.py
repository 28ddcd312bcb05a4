# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What measurement alone does to a residual, and the metric that follows from it.

At each frequency the residuals of all sensors have the covariance S = S_sensor + |G|^2 S_input: noise of the sensors, and
noise of the measured inputs that went through the linearised plant. The latter is common to all sensors. A residual times
the inverse root of S is white with variance 1, so that its sum of squares is the log likelihood (Whittle), and noise of the
road cannot be mistaken for a delay or a scale of a sensor.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property

import numpy as np
from numpy.lib.stride_tricks import as_strided, sliding_window_view
from numpy.typing import NDArray
from scipy import fft
from scipy.interpolate import CubicSpline

from ...recordings.noise import Noise

Array = NDArray[np.float64]
POLES = (0.0, 0.3, 0.5, 0.7, 0.8, 0.87, 0.92, 0.95, 0.97, 0.985)  # of slow noise, per sample
SHARES = (0.03, 0.06, 0.12, 0.25, 0.5, 0.75, 1.0)  # of it in the room that there is, and by how much finer from the best
FINER = (1.2, 1.1, 1.05, 1.025)
LOUD = 4.0  # times its noise and its mean power from which on an input is there for a while
BINS = 16  # of a spectrum in which coherence is estimated
PARTS = (0.1, 2.0, 6.0, 20.0)  # [Hz] from which to which coherence is added up
TOP = 100.0  # [Hz] what vehicles do above it is not looked at, but for the noise
STOP = 120.0  # [dB] by which thinning damps what it would mirror into the band
TOGETHER = 8  # thinned samples that are made by one matrix product, and signals that are transformed at a time
CHUNK = 32  # of such products at a time: their signals stay in the cache


@dataclass(frozen=True, eq=False)
class Experiment:
    """One recording on the model's raster: inputs u [n, n_u], sensors y [n, n_z] (NaN nowhere), and which samples are good.

    `drive`, `rate` [n, n_u] are the inputs as they most likely were and their rates, `unsure` [f, n_u] the standard
    deviation of their remaining noise (see prepare).
    """

    name: str
    time: Array
    u: Array
    y: Array
    good: NDArray[np.bool_]
    drive: Array
    rate: Array
    unsure: Array
    quiet: Array  # variance per sample that a sensor's own record shows, [f, n_z]; NaN where it shows none
    left: float = 0.0  # [s] for which it goes on after the last sample here
    held: NDArray[np.bool_] | None = None  # inputs [n_u] that move in steps; None: none of them
    lead: float = 0.0  # of a sample, by which a step comes before the sample that shows it

    @property
    def step(self) -> float:
        return float(self.time[1] - self.time[0])

    def stepped(self, parts: Array) -> Array:
        """Samples [n - 1, fine, n_u] of the inputs from one to before the next, to be joined by straight lines; of those that move in
        steps, such that the integral over each interval is that of the step."""
        if self.held is not None:
            own = self.drive[:, self.held]
            parts[:, 1:, self.held] = own[:-1, None]
            parts[:, -1, self.held] += (parts.shape[1] * self.lead - 0.5) * np.diff(own, axis=0)
        return parts

    def driven_at(self, s: Array, v: Array) -> Experiment:
        """The same with deflections and rates [n, places] as further inputs, the first ones."""
        held = None if self.held is None else np.concatenate([np.zeros(s.shape[1], dtype=bool), self.held])
        return replace(self, held=held, drive=np.hstack([s, self.drive]), rate=np.hstack([v, self.rate]))

    @cached_property
    def duty(self) -> Array:
        """Share of the samples that are good [n_z]; 1 for a sensor that has none."""
        share = np.mean(self.good, axis=0)
        return np.where(share > 0.0, share, 1.0)

    @property
    def frequencies(self) -> Array:
        """All frequencies of its spectra [Hz]."""
        return fft.rfftfreq(len(self.time), self.step)

    @property
    def band(self) -> int:
        """How many of them are looked at."""
        return max(int(np.searchsorted(self.frequencies, min(TOP, 0.4 / self.step))), 2)


def prepare(
    name: str,
    time: Array,
    u: Array,
    y: Array,
    good: NDArray[np.bool_],
    noise: Array,
    laws: Sequence[Noise | None],
    slow: Sequence[float] = (),
    held: Array | None = None,
) -> Experiment:
    """An experiment from raw signals, the noise of the inputs [n_u], and what is known of that of the sensors; `slow` are the intervals
    [s] of those whose samples are farther apart than these, `held` [n_u] those of inputs that keep their value in between, or 0.

    Where the noise exceeds the input's own spectrum, the measured input is damped to what is likely (Wiener), and the rest
    is unsure; but a bump, or where a sweep is at a time, is kept. The number of samples becomes one that Fourier transforms like.
    """
    n, last = fft.prev_fast_len(len(time), real=True), float(time[-1])
    time, u, y, good = time[:n], u[:n], y[:n], good[:n]
    step = float(time[1] - time[0])
    f = fft.rfftfreq(2 * n, step)
    line = np.linspace(0.0, 1.0, n)[:, None]
    trend = u[:1] + line * (u[-1:] - u[:1])
    rest = u - trend
    spectra = fft.rfft(np.concatenate([rest, -rest[::-1]]), axis=0)  # turned round: no jump at the ends
    unsure = np.zeros((n // 2 + 1, u.shape[1]))
    held = np.zeros(u.shape[1]) if held is None else held
    for k, sigma in enumerate(noise):
        if held[k] > 0.0:  # its steps are there; noise of a sample stays until the next
            unsure[:, k] = sigma * np.sqrt(held[k] / step) * np.abs(np.sinc(fft.rfftfreq(n, step) * held[k]))
        elif sigma > 0.0:
            power = _smoothed(np.abs(spectra[:, k]) ** 2 / (2 * n), f[1])
            floor = float(np.median(power[int(0.6 * len(f)) : int(0.95 * len(f))]))  # there is no road left
            sigma = min(1.25 * sigma, np.sqrt(floor))
            share = np.maximum(1.0 - sigma**2 / np.maximum(power, 1e-300), 0.02)
            spectra[:, k] *= share
            taken = rest[:, k] - fft.irfft(spectra[:, k], 2 * n)[:n]
            blows, further = _blows(taken, sigma, f, share, power, step)
            trend[:, k] += blows
            share = share + further
            unsure[:, k] = sigma * np.sqrt(share)[: 2 * len(unsure) : 2][: len(unsure)]
    whole = fft.irfft(spectra, 2 * n, axis=0)[:n] + trend
    rate = CubicSpline(time, whole)(time, 1) if u.shape[1] else whole
    f = fft.rfftfreq(n, step)
    quiet = np.full((len(f), len(laws)), np.nan)
    for j, law in enumerate(laws):
        own = slow[j] if slow and slow[j] > 1.001 * step else step  # a law is of the samples at their own interval
        if law is not None:
            quiet[:, j] = law.density(f, own) / (2.0 * own)
    return Experiment(name, time, u, y, good, whole, rate, unsure, quiet, last - float(time[-1]), held > 0.0 if held.any() else None)


def _blows(taken: Array, sigma: float, f: Array, share: Array, power: Array, step: float) -> tuple[Array, Array]:
    """Bursts of signal, as at a bump, in that part of an input which the Wiener damping has `taken` [n] as noise; and the share of the
    signal at frequencies f that they are, in the mean over time, in addition to the `share` that the damping left of its `power`.

    Windows of a quarter of a second that overlap by half and add up to 1. The part that was taken has no slow motion, which would leak
    through such short windows.
    """
    half = max(round(0.125 / step), 2)
    window = np.sin(np.pi * (np.arange(2 * half) + 0.5) / (2 * half))
    long = np.pad(taken, (2 * half, 2 * half + -len(taken) % half))
    spectra = fft.rfft(sliding_window_view(long, 2 * half)[::half] * window, axis=1)
    at = fft.rfftfreq(2 * half, step)
    left, lost = np.interp(at, f, share), np.maximum(1.0 - np.interp(at, f, share), 0.1)
    own = np.array([_smoothed(p, at[1]) for p in np.abs(spectra) ** 2 / half]) / lost**2
    likely = np.where(own > LOUD * np.maximum(np.interp(at, f, power), sigma**2), 1.0 - sigma**2 / np.maximum(own, 1e-300), 0.0)
    more = np.maximum(likely - left, 0.0)
    whole = np.zeros(len(long))
    for k, part in enumerate(fft.irfft(more / lost * spectra, 2 * half, axis=1) * window):
        whole[k * half : (k + 2) * half] += part
    return whole[2 * half : 2 * half + len(taken)], np.interp(f, at, more.mean(axis=0))


def _smoothed(power: Array, bin: float) -> Array:
    """A spectrum over bands of 1 Hz, at high frequencies over a sixth of the frequency to either side."""
    n = len(power)
    half = np.maximum(int(0.5 / bin), np.arange(n) // 6) + 1
    low, high = np.maximum(np.arange(n) - half, 0), np.minimum(np.arange(n) + half + 1, n)
    total = np.concatenate([[0.0], np.cumsum(power)])
    means: Array = (total[high] - total[low]) / (high - low)
    return means


@dataclass(frozen=True, eq=False)
class Metric:
    """`root` [f, sensors, sensors] turns spectra of residuals white."""

    n: int
    root: NDArray[np.complex128]

    def spectrum(self, r: Array) -> NDArray[np.complex128]:
        """Spectra [..., f, sensors] of signals [..., n, sensors] in the band."""
        rows = np.ascontiguousarray(np.moveaxis(r, -1, -2))
        return np.moveaxis(fft.rfft(rows, axis=-1)[..., : len(self.root)], -1, -2)

    def white(self, spectra: NDArray[np.complex128], out: Array | None = None) -> Array:
        """Real numbers [..., rows] of unit variance if spectra [..., f, sensors] are those of noise."""
        shape = *spectra.shape[:-2], *spectra.shape[:-3:-1]  # [..., sensors, f]
        w = np.empty(shape, dtype=complex) if out is None else out.view(self.root.dtype).reshape(shape, copy=False)
        for i, row in enumerate(self.triangle):
            np.multiply(row[i], spectra[..., i], out=w[..., i, :])
            for j in range(i):
                if row[j].any():  # inputs without noise have nothing in common
                    w[..., i, :] += row[j] * spectra[..., j]
        return w.reshape(*w.shape[:-2], -1).view(w.real.dtype)

    @cached_property
    def triangle(self) -> NDArray[np.complex128]:
        """The root as it lies closely in memory, [sensors, sensors, f]; of the mean, which has no imaginary part, half the power."""
        found = np.moveaxis(self.root, 0, -1).copy()
        found[..., 0] /= np.sqrt(2.0)
        return found

    def __call__(self, r: Array) -> Array:
        return self.white(self.spectrum(r))

    @property
    def power(self) -> Array:
        """Variance of noise in each spectrum [f, sensors]."""
        power: Array = np.sum(np.abs(np.linalg.inv(self.root)) ** 2, axis=-1)
        return power

    @property
    def volume(self) -> float:
        """What belongs to chi2 for a log likelihood where metrics differ: 2 log det S summed over the band."""
        return -4.0 * float(np.sum(np.log(np.abs(np.diagonal(self.root, axis1=1, axis2=2)))))


@dataclass(frozen=True, eq=False)
class Thinning:
    """Spectra in a narrow band of signals that go round in a circle of n samples: from one in `every` samples of what a low-pass leaves
    of them. `taps` turn the samples around TOGETHER of those into them, `gain` [f] is what the low-pass leaves of the band."""

    n: int
    every: int
    taps: Array
    gain: Array

    def __call__(self, signals: Array, good: NDArray[np.bool_] | None) -> NDArray[np.complex128]:
        """Spectra [sensors, runs, f] of signals [n, sensors, runs] where they are good [n, sensors]; None: everywhere."""
        signals = np.ascontiguousarray(signals)
        step, width = TOGETHER * self.every, self.taps.shape[1]
        before = (width - step + self.every) // 2
        columns, products = signals.shape[1] * signals.shape[2], -(-self.n // step)
        thin = np.empty((CHUNK, TOGETHER, columns))
        rows = np.empty((columns, self.n // self.every))
        for k in range(0, products, CHUNK):
            some = thin[: products - k]
            first = k * step - before
            last = first + (len(some) - 1) * step + width
            at = slice(first, last) if first >= 0 and last <= self.n else np.arange(first, last) % self.n
            part = signals[at] if good is None else signals[at] * good[at, :, None]
            if self.every > 1:
                stride = part.strides[0]
                windows = as_strided(part, (len(some), width, columns), (step * stride, stride, part.itemsize))
                part = np.matmul(self.taps, windows, out=some)
            here = rows[:, k * TOGETHER : (k + CHUNK) * TOGETHER]
            here[:] = part.reshape(-1, columns)[: here.shape[1]].T
        spectra = np.empty((columns, len(self.gain)), dtype=complex)
        for k in range(0, columns, TOGETHER):
            few = slice(k, k + TOGETHER)
            np.divide(fft.rfft(rows[few], axis=1)[:, : len(self.gain)], self.gain, out=spectra[few])
        return spectra.reshape(*signals.shape[1:], -1)

    def rates(self, signals: Array, spectra: NDArray[np.complex128], step: float) -> NDArray[np.complex128]:
        """Spectra [sensors, f] of the rates (central differences, at the ends to one side) of signals [n, sensors] that have `spectra`."""
        turn = 2.0 * np.pi / self.n * np.arange(len(self.gain))
        first, second, before, last = signals[0], signals[1], signals[-2], signals[-1]
        ends = (0.5 * (second + last) - first)[:, None] + (last - 0.5 * (first + before))[:, None] * np.exp(1j * turn)
        rates: NDArray[np.complex128] = (1j * np.sin(turn) * spectra + ends) / step
        return rates


@cache
def thinning(n: int, band: int) -> Thinning:
    """The thinning of n samples to `band` frequencies, by a low-pass with Kaiser's window."""
    every = max(q for q in range(1, max(int(0.3 * n / band), 1) + 1) if n % q == 0)
    half = int(np.ceil((STOP - 7.95) / (28.72 * (1.0 / every - 2.0 * band / n)))) if every > 1 else 0
    k = np.arange(-half, half + 1)
    tap = np.sinc(k / every) / every * np.kaiser(2 * half + 1, 0.1102 * (STOP - 8.7))
    taps = np.stack([np.pad(tap, (j * every, (TOGETHER - 1 - j) * every)) for j in range(TOGETHER)])
    gain = np.cos(2.0 * np.pi / n * np.outer(np.arange(band), k)) @ tap / every
    return Thinning(n, every, taps, gain)


def sensor_levels(e: Experiment, residual: Array, declared: Array, through: NDArray[np.complex128], robust: bool = True) -> Array:
    """Noise variance per sample of each sensor over all frequencies of the band [f, sensors].

    What a sensor's record shows by itself, above the band of the signals, is continued below; a slow part is added as the
    residual shows it, up to what the sensor's declared noise leaves room for. Bands with much more than that do not count:
    there something is wrong, which is not noise; nor, if `robust`, does what is there in less than half of the time.
    """
    n, band, f = len(e.time), e.band, e.frequencies
    if robust:
        size = n // 5  # nine stretches, each half over the next
        window = np.hanning(size)[:, None]
        stretches = [fft.rfft(residual[k * size // 2 : k * size // 2 + size] * window, axis=0) for k in range(9)]
        middle = np.median(np.abs(stretches) ** 2, axis=0) / (size * 0.375 * 0.7456)  # the median of nine exponentials
        power = np.stack([np.interp(f, fft.rfftfreq(size, e.step), column) for column in middle.T], axis=1)
    else:
        power = np.abs(fft.rfft(residual, axis=0)) ** 2 / n
    high = slice(band, max(int(0.9 * len(f)), band + 1))
    wide = max(int(1.0 / f[1]), 2)  # bins of a band of 1 Hz
    edges = np.arange(1, band, wide)
    shapes, means = _slow(n, band, wide)
    found = np.empty((band, residual.shape[1]))
    for j, sigma in enumerate(declared):
        duty = float(e.duty[j])  # of white noise so much power is left where the other samples are 0, of a slow signal the square
        power[:, j] /= duty  # the level stays that of a sample: then chi2 counts each good one once
        road = np.sum(np.abs(through[:, j, :] * e.unsure) ** 2, axis=1) * duty
        base = e.quiet[:, j]
        if not np.all(np.isfinite(base)):
            raw = float(np.mean(power[high, j]))
            base = np.full(len(f), max(raw - float(np.median(road[high])), 0.05 * raw, 1e-300))
        base = base * max(1.0, (0.75 * sigma) ** 2 / float(np.mean(base)))  # a sensor is hardly better than its data sheet
        bins = np.diff(np.append(edges, band))
        p, b, r = (np.add.reduceat(x[:band], edges) / bins for x in (power[:, j], base, road))
        whole = float(np.mean(base))
        room = max((1.25 * sigma) ** 2 if sigma > 0.0 else 4.0 * whole, 1.1 * whole) - whole
        k, share = _slow_part(p, b + r, room, means, bins, robust)
        found[:, j] = base[:band] + share * room * shapes[k]
    return found


def _slow_part(power: Array, known: Array, room: float, means: Array, bins: Array, robust: bool) -> tuple[int, float]:
    """The pole of the slow noise of spectra `means` [POLES, bands], and its share of the room for it, that make a power [bands] likeliest
    beside what is `known` of it."""

    def loss(k: int, share: float) -> float:
        s = known + share * room * means[k]
        return float(np.sum(bins * (np.log(s) + (np.minimum(power / s, 12.0) if robust else power / s))))

    best = loss(0, 0.0), 0, 0.0
    for k in range(len(POLES)):
        for share in SHARES:
            if (new := loss(k, share)) < best[0] - 2.0:
                best = new, k, share
    for finer in FINER if best[2] else ():
        best = min(best, *((loss(best[1], x), best[1], x) for x in (best[2] / finer, min(best[2] * finer, 1.0))))
    return best[1:]


@cache
def _slow(n: int, band: int, wide: int) -> tuple[Array, Array]:
    """Spectra [POLES, f] of slow noise of unit variance in the band, and their means over `wide` bins."""
    turn = np.exp(-2j * np.pi / n * np.arange(band))
    shapes = np.array([(1.0 - pole**2) / np.abs(1.0 - pole * turn) ** 2 for pole in POLES])
    edges = np.arange(1, band, wide)
    return shapes, np.add.reduceat(shapes, edges, axis=1) / np.diff(np.append(edges, band))


def metric(e: Experiment, levels: Array, through: Array | NDArray[np.complex128]) -> Metric:
    """The metric of a recording: levels [f, sensors] and the transfer [f, sensors, inputs] of the inputs' noise."""
    g = through[: e.band] * e.unsure[: e.band, None, :] * np.sqrt(e.duty)[None, :, None]
    s = g @ np.conj(np.swapaxes(g, 1, 2)) + levels[:, :, None] * np.eye(levels.shape[1])
    root = np.linalg.inv(np.linalg.cholesky(s)) * np.sqrt(2.0 / len(e.time))
    return Metric(len(e.time), root)


UNSEEN = 1.5  # times the noise: an error that no coloured noise of sensors explains
ALIKE = 7.0  # standard deviations by which sensors may share a residual that is only noise


def correlation(experiments: Sequence[Experiment], metrics: Sequence[Metric], simulated: Sequence[Array]) -> float:
    """How much the residuals of different sensors are alike, in standard deviations of that of independent noise, in that
    part of the spectrum where they are most alike.

    Noise of sensors has nothing in common (what the inputs' noise has, the metrics take out), so coherence between two of
    them is the mark of something that moves the plant. Over B bins, -2 (B - 1) log(1 - coherence) is chi-square of 2.
    """
    found, freedom = np.zeros(len(PARTS)), np.zeros(len(PARTS))
    for e, m, z in zip(experiments, metrics, simulated, strict=True):
        r = m.spectrum(np.where(e.good, e.y - z, 0.0))
        w = np.einsum("fij,fj->fi", m.root, r)
        edges = [max(int(f / e.frequencies[1]), 1) for f in (*PARTS, TOP)]
        for part, (low, high) in enumerate(itertools.pairwise(edges)):
            for band in np.array_split(w[low:high], max((high - low) // BINS, 1)):
                if len(band) < 4:
                    continue
                s = band.T @ band.conj()
                power = np.real(np.diag(s))
                for i in range(len(s)):
                    for j in range(i):
                        coherence = float(np.abs(s[i, j]) ** 2 / max(power[i] * power[j], 1e-300))
                        found[part] -= 2.0 * (len(band) - 1) * np.log1p(-min(coherence, 1.0 - 1e-12))
                        freedom[part] += 2.0
    return float(np.max((found - freedom) / np.sqrt(2.0 * np.maximum(freedom, 1.0))))
