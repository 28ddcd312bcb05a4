# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a simulation is wrong: in time, in frequency and in the state space, and by how much of the signal.

All is SI. `before` is the model as its file says, parameters within their tolerance and start state as they fit best;
`after` is the same with the named causes, None if there are none. Spectra are one-sided densities [unit^2/Hz].
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.fft import rfft, rfftfreq

from penode_gen import units
from penode_gen.model import Model

from .missing import Missing
from .noise import Experiment
from .restoring import Surface, rms, short, surface_numbers
from .study import Study

Array = NDArray[np.float64]
STRETCHES = 40  # of time, at most
OVERLAP = 1.0 + 2.0 / 36.0  # variance of a mean over Hann segments that overlap by half, over that of separate ones
CHANCE = 0.05  # probability of a false alarm at a limit


@dataclass(frozen=True)
class Whiteness:
    """Bartlett's test on the periodogram over the noise spectrum. `distance`: the largest of its normalised running sum
    from a straight line; noise exceeds `limit` in 5 % of all cases. `level`: mean ratio, 1 for noise."""

    distance: float
    limit: float
    p_value: float
    level: float


@dataclass(frozen=True, eq=False)
class Residual:
    """Residual of one sensor in one recording: samples [n]; densities [unit^2/Hz], coherence with the inputs [f], test for
    whiteness."""

    values: Array
    density: Array
    coherence: Array
    white: Whiteness
    running: Array  # the running sum of the test, over the frequencies `Channel.bins`


@dataclass(frozen=True, eq=False)
class Channel:
    """One sensor in one recording. `good`: samples that count; `noise`: RMS that measurement alone leaves, `floor`
    its density; `limit`: coherence that chance exceeds at 5 % of all frequencies, `chance`: its mean; `beyond`: samples
    farther or faster than trained."""

    recording: str
    sensor: str
    unit: str
    time: Array
    measured: Array
    good: NDArray[np.bool_]
    noise: float
    f: Array
    signal: Array
    floor: Array
    limit: float
    chance: float
    bins: Array
    before: Residual
    after: Residual | None
    beyond: NDArray[np.bool_] | None = None

    @property
    def strength(self) -> float:
        """RMS of the measured signal about its mean."""
        return rms(self.measured[self.good] - np.mean(self.measured[self.good]))

    def level(self, r: Residual) -> float:
        """RMS of a residual over the samples that count."""
        return rms(r.values[self.good])

    @property
    def share(self) -> float:
        """Residual before as a share of the signal; 0 of a signal that stands still."""
        return self.level(self.before) / self.strength if self.strength > 0.0 else 0.0


def segment(n: int, step: float, few: int) -> int:
    """Samples of the segments of a spectrum: for a resolution of 0.5 Hz if that leaves `few` of them, at least; at most
    1/16 of the recording if that is longer."""
    return max(n // 16, min(n // few, int(2.0 / step)), 8)


def density(r: Array, step: float, length: int, good: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
    """Frequencies [Hz] and one-sided power density of r [n] (Welch, Hann, overlap by half); r is 0 where it is not
    good."""
    window = np.hanning(length + 1)[:length]
    starts = range(0, len(r) - length + 1, max(length - length // 2, 1))
    power = np.mean([np.abs(rfft(window * r[k : k + length])) ** 2 for k in starts], axis=0)
    power[1 : (length + 1) // 2] *= 2.0  # a mean and the highest frequency have no other side
    good = np.ones(len(r), bool) if good is None else good
    counted = [window**2 @ good[k : k + length] for k in starts]
    return rfftfreq(length, step), power * step / max(float(np.mean(counted)), 1e-300)


def coherence(r: Array, u: Array, step: float, length: int) -> tuple[Array, float, float]:
    """Multiple coherence [f] of r [n] with inputs u [n, n_u]: share of its power that is linear in them; of independent
    signals, what it exceeds with CHANCE, and its mean."""
    window = np.hanning(length + 1)[:length, None]
    starts = range(0, len(r) - length + 1, max(length // 2, 1))
    if not u.shape[1]:
        return np.zeros(length // 2 + 1), 0.0, 0.0
    r, u = r - np.mean(r), u - np.mean(u, axis=0)
    x = np.stack([rfft(window * u[k : k + length], axis=0) for k in starts])
    y = np.stack([rfft(window[:, 0] * r[k : k + length]) for k in starts])
    power = np.einsum("kfi,kfj->fij", x, np.conj(x))
    power += 1e-12 * np.trace(power, axis1=1, axis2=2)[:, None, None] * np.eye(u.shape[1]) + 1e-300 * np.eye(u.shape[1])
    cross = np.einsum("kfi,kf->fi", x, np.conj(y))
    linear = np.real(np.einsum("fi,fi->f", np.conj(cross), np.linalg.solve(power, cross[:, :, None])[:, :, 0]))
    number = len(starts) / OVERLAP
    limit = float(special.betaincinv(u.shape[1], max(number - u.shape[1], 0.5), 1.0 - CHANCE))
    found = np.clip(linear / np.maximum(np.sum(np.abs(y) ** 2, axis=0), 1e-300), 0.0, 1.0)
    return found, limit, min(u.shape[1] / number, 1.0)


def _segments(e: Experiment) -> tuple[int, int]:
    """Samples of the segments of a density and, shorter, of a coherence."""
    n = len(e.time)
    return segment(n, e.step, 6), max(segment(n, e.step, 12) // 2, 8)


def _residual(e: Experiment, j: int, simulated: Array, variance: Array, kept: NDArray[np.bool_]) -> Residual:
    """What a simulation [n, n_z] leaves of a sensor: `variance` of its noise per sample [bins], frequencies of its density that are
    `kept`."""
    length, short_length = _segments(e)
    good = e.good[:, j]
    r = np.where(good, e.y[:, j] - simulated[:, j], 0.0)
    f, power = density(r, e.step, length, good)
    linear = np.interp(f[kept], rfftfreq(short_length, e.step), coherence(r, e.u, e.step, short_length)[0])
    ratio = np.abs(rfft(r)[1 : e.band]) ** 2 / (len(e.time) * float(np.mean(good)) * variance)
    white, running = whiteness(ratio)
    return Residual(r, power[kept], linear, white, running)


def whiteness(ratio: Array) -> tuple[Whiteness, Array]:
    """The test on periodogram ordinates over the noise spectrum [m], and their running sum [m], which ends at 1."""
    m = len(ratio)
    running = np.cumsum(ratio) / max(float(np.sum(ratio)), 1e-300)
    inner = np.sort(running[:-1])
    line = np.arange(m) / max(m - 1, 1)
    distance = float(max(np.max(line[1:] - inner), np.max(inner - line[:-1]))) if m > 1 else 0.0
    limit = float(special.kolmogi(CHANCE)) / np.sqrt(max(m - 1, 1))
    return Whiteness(distance, limit, float(special.kolmogorov(distance * np.sqrt(max(m - 1, 1)))), float(np.mean(ratio))), running


def stretches(time: Array, good: NDArray[np.bool_], *signals: Array) -> list[tuple[float, float, list[float]]]:
    """From, to [s] and the RMS of each signal in equal stretches of time; those without a good sample are left out."""
    edges = np.linspace(0, len(time), min(STRETCHES, max(len(time) // 20, 1)) + 1).astype(int)
    step = time[1] - time[0]
    return [
        (float(time[a]), float(time[b - 1] + step), [rms(x[a:b][good[a:b]]) for x in signals])
        for a, b in itertools.pairwise(edges)
        if good[a:b].any()
    ]


def third_octaves(low: float, high: float) -> Array:
    """Edges [Hz] of third-octave bands (base ten) that lie between two frequencies."""
    k = np.arange(np.ceil(10.0 * np.log10(low) - 0.5), np.floor(10.0 * np.log10(high) + 0.5) + 1)
    return 10.0 ** ((k - 0.5) / 10.0)


def band_rms(f: Array, power: Array, edges: Array) -> Array:
    """RMS [bands] of a density between edges: the integral of its straight lines."""
    total = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(f))])
    inner = np.interp(edges, f, power)
    at = np.clip(np.searchsorted(f, edges, "right") - 1, 0, len(f) - 1)
    whole = total[at] + 0.5 * (power[at] + inner) * (np.clip(edges, f[0], f[-1]) - f[at])
    return np.sqrt(np.maximum(np.diff(whole), 0.0))


def channels(
    e: Experiment, model: Model, before: Array, after: Array | None, floor: tuple[Array, Array], beyond: NDArray[np.bool_] | None = None
) -> list[Channel]:
    """All sensors of a recording that were measured, from what was simulated [n, n_z]; `floor`: frequencies and noise
    variance per sample [f, n_z]."""
    step, found = e.step, []
    length, short_length = _segments(e)
    top = e.frequencies[e.band - 1]
    for j, sensor in enumerate(model.sensors):
        good = e.good[:, j]
        if not good.any():
            continue
        variance = np.interp(e.frequencies[1 : e.band], floor[0], floor[1][:, j])
        f, power = density(np.where(good, e.y[:, j] - np.mean(e.y[good, j]), 0.0), step, length, good)
        kept = (f > 0.0) & (f <= top)
        _, limit, chance = coherence(e.y[:, j], e.u, step, short_length)
        found.append(
            Channel(
                e.name,
                sensor.name,
                units.si(sensor.unit),
                e.time - e.time[0],
                e.y[:, j],
                good,
                float(np.sqrt(np.mean(floor[1][:, j]))),
                f[kept],
                power[kept],
                2.0 * step * np.interp(f[kept], floor[0], floor[1][:, j]),
                limit,
                chance,
                e.frequencies[1 : e.band],
                _residual(e, j, before, variance, kept),
                None if after is None else _residual(e, j, after, variance, kept),
                beyond,
            )
        )
    return found


def noise_floor(study: Study, k: int) -> tuple[Array, Array]:
    """Frequencies and noise variance per sample [f, n_z] of recording k: sensors, and inputs through the plant."""
    e = study.experiments[k]
    f = e.frequencies[: e.band]
    through = study.linear.transfer(f)[:, : len(study.model.sensors), : len(study.model.inputs)]
    return f, study.levels[k] + np.sum(np.abs(through * e.unsure[: e.band, None, :]) ** 2, axis=2)


def noise_rms(study: Study) -> Array:
    """RMS [n_z] that measurement alone leaves in the first recording: noise of the sensors, and of the measured inputs through the plant.

    Above the band a sensor's noise is what its own record shows, or goes on evenly if that shows none.
    """
    e, level = study.experiments[0], study.levels[0]
    beyond = np.where(np.isfinite(e.quiet), e.quiet, level[-1])[e.band :]
    power: Array = np.mean(np.concatenate([level, beyond]), axis=0) + driven(study)
    return np.sqrt(power)


def stated_noise(study: Study) -> Array:
    """The same with noise of sensors as the model file states it, where it does: slow noise, or more of it, may be what a model lacks."""
    stated = np.array([s.noise for s in study.model.sensors])
    return np.where(stated > 0.0, np.minimum(np.sqrt(stated**2 + driven(study)), noise_rms(study)), noise_rms(study))


def driven(study: Study) -> Array:
    """Mean power [n_z] that noise of the inputs has in the sensors."""
    e = study.experiments[0]
    through = study.linear.transfer(e.frequencies)[:, : len(study.model.sensors), : len(study.model.inputs)]
    power: Array = np.mean(np.sum(np.abs(through * np.array([i.noise for i in study.model.inputs])) ** 2, axis=2), axis=0)
    return power


# -- numbers ----------------------------------------------------------------------------------------------------------


def channel_numbers(c: Channel) -> dict[str, Any]:
    """Where in time and frequency a sensor's residual is, and by how much of the signal."""
    both = [c.before, *([c.after] if c.after else [])]
    names = ["before", "after"][: len(both)]
    values = {name: c.level(r) for name, r in zip(names, both, strict=True)}
    edges = third_octaves(c.f[0], c.f[-1])
    in_bands = {name: band_rms(c.f, r.density, edges) for name, r in zip(names, both, strict=True)}
    noise, whole = band_rms(c.f, c.floor, edges), band_rms(c.f, c.signal, edges)
    found_in = {name: map(short, values) for name, values in (*in_bands.items(), ("noise", noise), ("signal", whole))}
    frequency = [
        {"from": short(a), "to": short(b), **dict(zip(found_in, levels, strict=True)), "coherence": short(_mean(c, a, b))}
        for (a, b), *levels in zip(itertools.pairwise(edges), *found_in.values(), strict=True)
    ]
    time = [
        {"from": short(a), "to": short(b), **dict(zip(names, map(short, found), strict=True))}
        for a, b, found in stretches(c.time, c.good, *(r.values for r in both))
    ]
    return {
        "recording": c.recording,
        "signal": c.sensor,
        "unit": c.unit,
        "signal_rms": short(c.strength),
        "noise_rms": short(c.noise),
        **{f"{name}_rms": short(x) for name, x in values.items()},
        "share_of_signal": short(c.share),
        "linear_in_input": short(linear_share(c, c.before)),
        "coherence_limit": short(c.limit),
        "whiteness": {name: {k: short(x) for k, x in vars(r.white).items()} for name, r in zip(names, both, strict=True)},
        "time": time,
        "frequency": frequency,
    }


def _mean(c: Channel, low: float, high: float) -> float:
    """Mean coherence before in a band; NaN if no frequency lies in it."""
    inside = (c.f >= low) & (c.f < high)
    return float(np.mean(c.before.coherence[inside])) if inside.any() else np.nan


def linear_share(c: Channel, r: Residual) -> float:
    """Share of a residual's power that is a linear function of the inputs; what chance gives is taken off."""
    corrected = np.maximum(r.coherence - c.chance, 0.0) / max(1.0 - c.chance, 1e-12)
    return float(np.sum(corrected * r.density) / max(float(np.sum(r.density)), 1e-300))


@dataclass(frozen=True, eq=False)
class Shown:
    """All that a report draws."""

    train: tuple[Channel, ...]
    holdout: tuple[Channel, ...]
    surfaces: tuple[Surface, ...]
    missing: tuple[Missing, ...] = ()

    def numbers(self) -> dict[str, Any]:
        """As in diagnosis.json."""
        return {
            "signals": [channel_numbers(c) for c in self.train],
            "holdout": [channel_numbers(c) for c in self.holdout],
            "state_space": [surface_numbers(s) for s in self.surfaces],
            "places": [m.numbers() for m in self.missing],
        }
