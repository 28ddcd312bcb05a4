# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What every candidate would do to the sensors, whitened: the columns of a regression."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from penode_gen.model import GROUND, Model

from .elementary import force_laws
from .hypotheses import CLOCK, Basis, Fault, Motion, clock, sensor_faults
from .noise import Experiment, Metric
from .plant import Place, moving_ends
from .score import DAMPINGS, RESONANCES, Candidate, Seen, where

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Complex = NDArray[np.complex128] | NDArray[np.complex64]
Writer = Callable[[int, Array], object]  # writes whitened effects [candidates, rows] of a recording
COARSE = 0.002  # [s] step at which forces along a motion are looked at, if their recordings have a finer one
TOGETHER = 8  # candidates whose effects are computed together: they stay in the cache
FEW = 200  # samples of a sensor that are taken out one by one, sooner than by a transform


class _Effects:
    """Effects in every recording: of forces at places and of faults of sensors. Forces along a motion are looked at every `every`
    samples; samples of sensors that do not count are removed from effects as from the measurements."""

    def __init__(self, experiments: Sequence[Experiment], metrics: Sequence[Metric], seen: Sequence[Seen]) -> None:
        self.experiments = experiments
        most = max(int(COARSE / experiments[0].step + 1e-6), 1)
        self.every = max(q for q in range(1, most + 1) if all(len(x.time) % q == 0 for x in experiments))
        self.holes = [np.flatnonzero(~x.good.all(axis=0)) for x in experiments]  # sensors that have any
        self.metrics = [replace(m, root=m.root.astype(np.complex64)) for m in metrics]
        self.plain = [s.single() for s in seen]
        self.white = [s.white(m) for s, m in zip(self.plain, self.metrics, strict=True)]
        self.turns: dict[tuple[int, int], Single] = {}
        self.shows: dict[tuple[int, int], Single] = {}

    def turn(self, e: int, j: int) -> Single:
        """By how much the samples of a sensor that do not count are turned at each frequency [samples, numbers]."""
        if (e, j) not in self.turns:
            good = self.experiments[e].good[:, j]
            turn = np.exp(-2j * np.pi / len(good) * (np.outer(np.flatnonzero(~good), np.arange(self.experiments[e].band)) % len(good)))
            self.turns[e, j] = turn.astype(np.complex64).view(np.float32)
        return self.turns[e, j]

    def shown(self, e: int, j: int) -> Single:
        """Where the samples of a sensor count, as far as that is felt in the band: at few samples, and slowly."""
        if (e, j) not in self.shows:
            good, band = self.experiments[e].good[:, j], self.experiments[e].band
            few = fft.next_fast_len(4 * band, real=True)
            slow = fft.rfft(good.astype(float))[: 2 * band]
            self.shows[e, j] = (fft.irfft(slow, few) * few / len(good)).astype(np.float32)
        return self.shows[e, j]

    def masked(self, e: int, spectra: Complex) -> Complex:
        """Spectra [k, f, sensors] of effects without the samples that do not count."""
        good, band = self.experiments[e].good, self.experiments[e].band
        for j in self.holes[e]:
            if np.count_nonzero(~good[:, j]) <= FEW:
                turn, whole = self.turn(e, j), np.ascontiguousarray(spectra[:, :, j])
                lost = (2.0 * whole.view(np.float32) @ turn.T - whole[:, :1].real) / len(good)  # the mean counts once
                spectra[:, :, j] -= (lost @ turn).view(np.complex64)
            else:
                shown = self.shown(e, j)
                signals = fft.irfft(spectra[:, :, j], len(shown), axis=1)
                signals *= shown
                spectra[:, :, j] = fft.rfft(signals, axis=1)[:, :band]
        return spectra

    def answered(self, force: Complex, place: int, e: int, out: Array, settled: Sequence[bool] = ()) -> None:
        """Add the effects of spectra of forces [k, f] at a place."""
        if len(self.holes[e]):
            self.metrics[e].white(self.masked(e, self.plain[e].answer(force, place, settled)), out)
        else:
            self.white[e].answer(force, place, settled, out)

    def acted(self, place: int, laws: Sequence[Basis], e: int, out: Array) -> None:
        """Add the effects of elementary laws at a place."""
        rows = np.stack([b.series[e] for b in laws])
        phi = np.float32(self.every) * _transformed(rows, self.experiments[e].band)
        self.answered(phi, place, e, out, [b.settled for b in laws])

    def pulled(self, place: int, body: Sequence[Array], tried: Array, e: int, out: Array) -> None:
        """Add effects of hidden masses with frequencies and damping ratios `tried` [k, 2] on a body with acceleration spectra `body`."""
        x = self.experiments[e].frequencies[: self.experiments[e].band] / tried[:, :1]
        damped = 2j * tried[:, 1:] * x
        self.answered(((1.0 + damped) / (1.0 - x**2 + damped) * body[e]).astype(np.complex64), place, e, out)

    def faulty(self, sensor: int, faults: Sequence[Fault], e: int, out: Array) -> None:
        """Add the effects of faults of a sensor."""
        x, metric = self.experiments[e], self.metrics[e]
        spectra = _transformed(np.stack([f.series[e] for f in faults]) * x.good[:, sensor], x.band)
        out = out.view(np.complex64).reshape(len(faults), x.good.shape[1], x.band, copy=False)
        np.multiply(spectra[:, None], metric.triangle[:, sensor], out=out)


def _transformed(rows: Array, band: int) -> Complex:
    """Spectra [k, f] of signals [k, n], in single but for their means."""
    mean = np.mean(rows, axis=1, keepdims=True)
    spectra = fft.rfft((rows - mean).astype(np.float32), axis=1)[:, :band]
    spectra[:, :1] = rows.shape[1] * mean
    return spectra


def collect(
    model: Model,
    experiments: Sequence[Experiment],
    metrics: Sequence[Metric],
    seen: Sequence[Seen],
    found: Sequence[Place],
    sensor_names: Sequence[str],
    parameters: int = 0,
    kinds: Collection[str] = (),
) -> tuple[list[Candidate], Single]:
    """All candidates, or those of some kinds, and their whitened effects [candidates, rows], with room for `parameters` more."""
    own = _Effects(experiments, metrics, seen)
    groups = [*_at_places(model, own, seen, found, kinds), *_of_sensors(own, seen, sensor_names, kinds)]
    candidates = [c for some, _ in groups for c in some]
    rows = sum(2 * x.band * len(sensor_names) for x in experiments)
    effects = np.empty((len(candidates) + parameters, rows), dtype=np.float32)
    column = 0
    for e, x in enumerate(experiments):
        row, columns = 0, slice(column, column := column + 2 * x.band * len(sensor_names))
        for some, write in groups:
            write(e, effects[row : (row := row + len(some)), columns])
    return candidates, effects


def _at_places(
    model: Model, own: _Effects, seen: Sequence[Seen], found: Sequence[Place], kinds: Collection[str]
) -> Iterator[tuple[list[Candidate], Writer]]:
    """Laws at all places, and masses hidden on bodies, a few at a time."""
    step = own.every * own.experiments[0].step
    for k, place in enumerate(found):
        motions = [Motion(m.s[:: own.every], m.v[:: own.every], m.t[:: own.every]) for m in (s.motions[k] for s in seen)]
        laws = list(force_laws(k, place, motions, step, not moving_ends(model) & set(place.ends), kinds))
        body = next((b.name for b in model.bodies if set(place.ends) == {b.name, GROUND}), None)
        for i in range(0, len(laws), TOGETHER):
            some = laws[i : i + TOGETHER]
            yield [Candidate(b.kind, where(b.kind, place, model), b.sign, b.companion, b) for b in some], partial(own.acted, k, some)
        if body is not None and (not kinds or "hidden_resonance" in kinds):
            pull = [own.every * fft.rfft(np.gradient(m.v, step))[: x.band] for x, m in zip(own.experiments, motions, strict=True)]
            for f0 in RESONANCES:
                masses = [Candidate("hidden_resonance", body, 1, False, ("absorber", k, float(f0), zeta)) for zeta in DAMPINGS]
                yield masses, partial(own.pulled, k, pull, np.array([(f0, zeta) for zeta in DAMPINGS]))


def _of_sensors(
    own: _Effects, seen: Sequence[Seen], sensor_names: Sequence[str], kinds: Collection[str]
) -> Iterator[tuple[list[Candidate], Writer]]:
    """Faults of all sensors, and of the clock of all together."""
    experiments, step = own.experiments, own.every * own.experiments[0].step
    for j, name in enumerate(sensor_names):
        times = [s.motions[0].t if s.motions else e.time for e, s in zip(experiments, seen, strict=True)]
        faults = list(sensor_faults(j, [s.sensors[:, j] for s in seen], times, step, kinds))
        if faults:
            yield [Candidate(f.kind, name, f.sign, f.companion, f) for f in faults], partial(own.faulty, j, faults)
    if not kinds or CLOCK in kinds:
        drift = clock([s.sensors for s in seen], [e.time - e.time[0] for e in experiments], experiments[0].step)
        apart = Candidate(drift.kind, "", drift.sign, drift.companion, drift)
        yield [apart], lambda e, out: own.metrics[e].white(own.metrics[e].spectrum(drift.series[e] * experiments[e].good)[None], out)
