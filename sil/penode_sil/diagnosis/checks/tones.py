# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Tones in a residual that its inputs do not have: their source is a machine, not noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import maximum_filter1d

from penode_gen.model import Model

from ..study.noise import TOP, Experiment, Metric

Array = NDArray[np.float64]
HALF = 8  # bins to either side that say how loud it is around a tone
DETECTED = 12.0  # [nat] of surprise from which on a tone is one
LEVELS = np.repeat([2.0, 4.0, 8.0], 2)[:, None]  # of tones, in the noise's power in a bin
STAYS = np.tile([0.99, 0.5], 3)[:, None]  # chance that half a second later it is in the same bin
MAX_SURPRISE = 3.0  # [nat] that one second says: a blow is not a tone
ORDERS = 8  # of a sweep that are not looked at
TAIL = 10.0  # how fast what a bin has of its neighbours' median falls off in noise: as (1 + x / TAIL)^-TAIL, at the most


@dataclass(frozen=True)
class Tone:
    """The clearest tone in any residual: the surprise [nat] that it is noise, about where it is [Hz], and its sensor."""

    surprise: float = 0.0  # and 0 if it is more likely
    frequency: float = 0.0
    sensor: int = 0

    @property
    def detected(self) -> bool:
        return self.surprise > DETECTED


def tone(experiments: Sequence[Experiment], metrics: Sequence[Metric], simulated: Sequence[Array]) -> Tone:
    """The clearest tone that residuals have and inputs have not: noise that makes one comes from a machine.

    Each sensor is looked at by itself, and all together where the expected noise, turned white, is independent in each.
    Under a sine an error of a model or a quantum is a tone as well; under one whose frequency changes, only the multiples of
    it do not count. A resonance narrower than some 2 Hz that neither the expected noise nor the model's motion has is taken for
    a tone: it is not noise, but need not come from a machine. Recordings of less than 120 Hz or 3 s have too few bins or seconds.
    """
    found = [Tone()]
    for e, m, z in zip(experiments, metrics, simulated, strict=True):
        size = round(1.0 / e.step)  # samples of a second
        top = int(0.4 * size)
        sine = swept(e.u, e.step)
        if top < 6 * HALF or len(e.time) < 3 * size or (sine and not _moves(e.u, e.step)):
            continue
        left = np.where(e.good, e.y - z, 0.0)
        power = _seconds(left, e.step)[:, : top + HALF]
        hertz = np.arange(top + HALF) / (size * e.step)
        usual = m.power  # a resonance that the road's noise shakes is not a tone
        power /= np.stack([np.interp(hertz, e.frequencies[: len(usual)], x) for x in usual.T], axis=-1)
        moving = np.mean(_pureness(_seconds(z, e.step)[:, : top + HALF]), axis=0)  # nor is one that the model has as well
        moving = np.maximum(maximum_filter1d(moving, 3, axis=0), 1.0)
        swings = _multiples(e.u, e.step, top) if sine else np.zeros((len(power), top - HALF), bool)
        pure = np.where(swings[..., None], np.nan, _pureness(power) / moving)
        for j in range(pure.shape[2]):
            surprise, k = _followed(np.exp(_says(pure[..., j])))
            found.append(Tone(surprise, float(hertz[k + HALF]), j))
        low = min(int(e.frequencies[len(usual) - 1]), top) - HALF  # bins of those that have any white residual
        if pure.shape[2] > 1 and low > 0:
            power = _seconds(_whitened(e, m, left), e.step)[:, : low + 2 * HALF]
            pure = np.where(swings[:, :low, None], np.nan, _pureness(power)[:, :low] / moving[:low].max(axis=1, keepdims=True))
            says = np.stack([_says(x) for x in np.moveaxis(pure, -1, 0)])  # [sensors, seconds, models, bins]
            hears = 0.25 * (1.0 + np.exp(says[:, :, ::2]).sum(axis=2))  # a sensor a tone of any level, or of none
            surprise, k = _followed(np.prod(hears, axis=0)[:, None])
            found.append(Tone(surprise, float(hertz[k + HALF]), int(np.argmax(np.sum(np.log(hears[:, :, k]), axis=1)))))
    return max(found, key=lambda t: t.surprise)


def note(model: Model, tone: Tone) -> str:
    """A note on a tone."""
    return f"{model.sensors[tone.sensor].name} contains a tone at about {tone.frequency:.0f} Hz: an engine, a wheel, the mains?"


def _whitened(e: Experiment, m: Metric, residual: Array) -> Array:
    """A residual [n, n_z] turned white within the band; what the noise of an input does to several sensors, one of them keeps."""
    white = np.zeros((len(e.frequencies), residual.shape[1]), dtype=complex)
    white[: len(m.root)] = np.einsum("fij,fj->fi", m.root, m.spectrum(residual))
    return fft.irfft(white, len(e.time), axis=0)


def swept(inputs: Array, step: float) -> bool:
    """Is an input [n, any] a sine, most of the time, though one whose frequency may change? Below 10 Hz a second does not tell."""
    if step > 0.1:
        return False
    power = _seconds(np.diff(inputs, axis=0), step)[:, : int(TOP)]
    near = sliding_window_view(power, 5, axis=1).sum(axis=-1)
    shares = np.max(near, axis=1) / np.maximum(np.sum(power, axis=1), 1e-300)
    return bool(len(shares)) and bool(np.any(np.median(shares, axis=0) > 0.9))


def _moves(inputs: Array, step: float) -> bool:
    """Does the frequency of each input [n, any], a sine, change by more than 1 Hz in the middle half of the time?"""
    low, high = np.quantile(np.argmax(_seconds(np.diff(inputs, axis=0), step), axis=1), [0.25, 0.75], axis=0)
    return bool(np.all(high - low > 1.0))


def _multiples(inputs: Array, step: float, top: int) -> NDArray[np.bool_]:
    """Where in each second the multiples of the frequency of an input are, a sine [seconds, HALF .. top]."""
    bins = np.arange(HALF, top)[:, None]
    own = np.argmax(_seconds(np.diff(inputs, axis=0, append=inputs[-1:]), step), axis=1)[:, None, None, :]
    orders = np.arange(1, ORDERS + 1)[:, None]
    found: NDArray[np.bool_] = np.any(np.abs(bins[:, None] - orders * own) <= 2 + orders // 3, axis=(2, 3))
    return found


def _seconds(signals: Array, step: float) -> Array:
    """Periodograms [seconds, f, any] of signals [n, any], each of one second, which overlap by half."""
    size = round(1.0 / step)
    window = np.hanning(size)[:, None]
    parts = [signals[a : a + size] for a in range(0, len(signals) - size + 1, size // 2)]
    return np.array([np.abs(fft.rfft(x * window, axis=0)) ** 2 for x in parts]).reshape(len(parts), size // 2 + 1, signals.shape[1])


def _pureness(power: Array) -> Array:
    """How far each bin stands out of a spectrum [seconds, f, any] around it, but for HALF bins at both ends.

    In noise of any smooth colour this has a mean of 1 at the most and falls off as an exponential does: it is in means of what
    is around it, by the median of the HALF bins to either side, and by three bins on either side if these are more.
    """
    around = sliding_window_view(power, 2 * HALF + 1, axis=1)
    beside = np.median(np.delete(around, [HALF - 1, HALF, HALF + 1], axis=-1), axis=-1) / np.log(2.0)
    sides = np.maximum(*(around[..., HALF + a : HALF + a + 3].mean(axis=-1) for a in (-4, 2)))
    pure: Array = power[:, HALF:-HALF] / np.maximum(np.maximum(beside, sides), 1e-300)
    return pure


def _says(pure: Array) -> Array:
    """The log likelihood ratio [seconds, models, bins] of a tone of random phase and strength against noise where bins stand out so far
    [seconds, bins]."""
    x = TAIL * np.log1p(np.nan_to_num(pure) / TAIL)  # exponential, though medians of a few bins scatter
    says = np.minimum(LEVELS * x[:, None] / (1.0 + LEVELS) - np.log1p(LEVELS), MAX_SURPRISE)
    return np.where(np.isnan(pure)[:, None], 0.0, says)


def _followed(ratio: Array) -> tuple[float, int]:
    """The surprise [nat] that a bin which stays, or goes to its neighbours, stands out by chance, from likelihood ratios [seconds,
    models or 1, bins] of a tone that is there; and about which.

    The sum over all its ways of the likelihood that a tone went there over that of noise: in noise its mean is 1 at the most, so that
    its chance to come to L is 1 / L (Markov). The sum is that of a hidden Markov model, with a few levels of the tone and chances to
    stay.
    """
    at = np.full((len(STAYS), ratio.shape[2]), 1.0 / ratio.shape[2])
    surprise, where = np.zeros(len(at)), np.zeros(at.shape)
    for second in ratio:
        gone = 0.5 * (1.0 - STAYS) * at
        at = at - 2.0 * gone
        at[:, 1:] += gone[:, :-1]
        at[:, :-1] += gone[:, 1:]
        at *= second
        total = np.sum(at, axis=1, keepdims=True)
        surprise += np.log(total[:, 0])
        at /= total
        where += at
    best = np.max(surprise)
    return float(best + np.log(np.mean(np.exp(surprise - best)))), int(np.argmax(where[np.argmax(surprise)]))
