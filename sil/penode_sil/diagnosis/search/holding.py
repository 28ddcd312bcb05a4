# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""An input that acts in steps: a controller that runs slower than the recorder, and holds its output in between.

A signal u held for a period P is u later by P/2 on average, and beside that its slope times a saw of that period: with edges at phase + k P
the error of the model's input is, to first order in P,

    held - u = -u' (P/2 + saw(t)),    saw(t) = ((t - phase) mod P) - P/2 = -(P/pi) (sin(w (t - phase)) + ...),    w = 2 pi/P.

So a delay of P/2, and a sine and a cosine of 1/P times u' of the amplitude P/pi, find period and phases without a start: phases follow
from sums of squares. The best of these are then compared as true steps. Innovations averaged over more than P show
only the delay. The search for a hold, and its comparison with a delay, therefore use four updates per period.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..catalogue import drives
from ..catalogue.form import Form
from ..evidence.bench import AGAIN, CORRELATION, Bench, fit_level
from ..evidence.blocks import Blocks
from ..evidence.gain import Level
from ..evidence.prior import stated
from ..evidence.screening import AT_ONCE, Beside, as_they_are
from ..study.fit import Free, Series
from .terms import Trial

Array = NDArray[np.float64]
SPREAD = 0.75, 1.35  # bounds of the search for a period, in units of twice the fitted delay
FINER = 3.0  # frequencies tried, of the widths of one, 1/(length of the recordings)
MOST = 1200  # of them: the finest periods of long recordings are left out


def held(u: Array, period: float, phase: float) -> Array:
    """A signal [n] held for `period` samples from `phase` on: at each sample the mean of the steps half a sample about it, for a simulation
    joins samples by lines."""
    n = len(u)
    at = np.arange(np.floor((-1.0 - phase) / period), np.ceil((n + 1.0 - phase) / period) + 1.0)
    edges = phase + at * period
    area = np.concatenate([[0.0], np.cumsum(np.interp(edges[:-1], np.arange(n), u)) * period])
    return np.diff(np.interp(np.arange(n + 1) - 0.5, edges, area))


def propose(bench: Bench, index: int, delay: float) -> Form | None:
    """The likeliest hold of an input that seems late by `delay` [s]; None if it cannot be longer than two samples, or the input moves in
    fewer steps than two for each value that is fitted: each of these may come late by itself."""
    about = 2.0 * delay / bench.step
    steps = [np.diff(r.u[:, index]) for r in bench.records]
    large = [np.abs(s) > np.sqrt(np.mean(np.square(s))) for s in steps]
    moves = [np.count_nonzero(np.diff(moving, prepend=False) & moving) for moving in large]  # a step may lie between rows of the raster
    fitted = 1 + len(bench.records)  # the period, and a phase for each recording
    if about * SPREAD[1] <= 2.0 or sum(moves) < fitted + fitted:
        return None
    return drives.hold(bench.model, index, _likeliest(_finer(bench, about), index, about))


def told_apart(bench: Bench, trials: Sequence[Trial]) -> list[Trial]:
    """The trials of a round, with each hold scored against the delay of the same input at an update rate
    that resolves its steps. Other trials keep their scores: interpolating between the samples of a late sensor lowers its noise, which
    would bias the comparison."""
    delays = {t.form.index: t for t in trials if drives.is_late(t.form)}
    return [_against(bench, t, delays[t.form.index]) if t.form.series and t.form.index in delays else t for t in trials]


def _against(bench: Bench, hold: Trial, delay: Trial) -> Trial:
    """A hold with the scores of a delay, and what it predicts better with updates that resolve its steps."""
    fine = _finer(bench, hold.form.series.period / bench.step) if hold.form.series else bench
    if fine is bench:
        return hold
    blocks, problem = Blocks.of([len(r) // fine.update for r in fine.records]), fine.problem()

    def scores(t: Trial) -> Array:
        fit = problem.solve(t.fit.free, fine.gains(fine.fit).at(fine.level), AGAIN)
        return blocks.scores(problem, fit_level(fine, problem, fit, fine.level)[1])

    relief = stated(delay.fit.free) - stated(hold.fit.free)
    return replace(hold, blocks=delay.blocks + scores(hold) - scores(delay) + relief / len(delay.blocks))


def _finer(bench: Bench, period: float) -> Bench:
    """The bench with at least four updates per `period` [samples]: averaging then keeps sin(pi/4)/(pi/4) = 90 % of the fundamental of the
    steps. The same bench if it is fine enough."""
    update = max(1, int(0.25 * period))
    if update >= bench.update:
        return bench
    fine = replace(bench, update=update)
    problem, level = fine.problem(), Level(bench.level.size, CORRELATION * update * bench.step)
    fit = problem.solve(bench.fit.free, fine.gains(bench.fit).at(level), AGAIN)
    level, fit = fit_level(fine, problem, fit, level)
    return replace(fine, level=level, fit=fit)


def _likeliest(bench: Bench, index: int, about: float) -> Series:
    """The hold with a period near `about` [samples] that gains most."""
    step, wide = bench.step, 1.0 / (FINER * max(len(r) for r in bench.records))
    frequencies = np.arange(1.0 / (SPREAD[1] * about), min(0.5, 1.0 / (SPREAD[0] * about)), wide)[:MOST]
    slopes = [np.gradient(r.u[:, index]) for r in bench.records]
    series = [Series([s * wave(2.0 * np.pi * f * np.arange(len(s))) for s in slopes]) for f in frequencies for wave in (np.sin, np.cos)]
    late, *waves = changes(bench, index, [Series([-s / step for s in slopes]), *series])
    beside, own = Beside.of(bench.fit), _of_recordings(bench)
    pairs = [[[w * one[:, None] for w in pair] for one in own] for pair in zip(waves[::2], waves[1::2], strict=True)]
    looks = [_look(beside, 1.0 / f, step, late, pair) for f, pair in zip(frequencies, pairs, strict=True)]
    steps = [_steps(bench, index, 1.0 / frequencies[k], looks[k][1]) for k in np.argsort([left for left, _ in looks])[:AT_ONCE]]
    tried = as_they_are(bench.fit, list(changes(bench, index, steps)))
    return steps[int(np.argmax([s.gain for s in tried]))]


def _look(beside: Beside, period: float, step: float, late: Array, waves: Sequence[Sequence[Array]]) -> tuple[float, Array]:
    """What a hold of so many samples leaves of the sum of squares, and its phases [periods], from the changes [updates, n_z] by a sine and
    a cosine of each recording."""
    rest = beside.rest + 0.5 * period * step * beside.columns(late[:, :, None])[1][:, 0]
    phases = []
    for pair in waves:
        columns = beside.columns(np.stack(pair, axis=-1))[1]
        a, b = np.linalg.lstsq(columns, -rest, rcond=1e-9)[0]
        size = period / np.pi / max(float(np.hypot(a, b)), 1e-300)
        rest = rest + columns @ (size * np.array([a, b]))
        phases.append(np.arctan2(-b, a) / (2.0 * np.pi))
    return float(rest @ rest), np.array(phases)


def _of_recordings(bench: Bench) -> list[Array]:
    """Which updates [updates] are of each recording, as 1.0 and 0.0."""
    lengths = [len(r) // bench.update for r in bench.records]
    ends = np.cumsum([0, *lengths])
    return [((np.arange(ends[-1]) >= a) & (np.arange(ends[-1]) < b)).astype(float) for a, b in itertools.pairwise(ends)]


def _steps(bench: Bench, index: int, period: float, phases: Array) -> Series:
    """What a hold of so many samples adds to the input, with a phase [periods] for each recording."""
    own = [held(r.u[:, index], period, p * period) - r.u[:, index] for r, p in zip(bench.records, phases, strict=True)]
    return Series(own, period * bench.step)


def changes(bench: Bench, index: int, series: Sequence[Series]) -> Array:
    """Changes [series, updates, n_z] of the innovations when series are added to an input."""
    problem, free = bench.problem(), bench.fit.free
    found = []
    for first in range(0, len(series), AT_ONCE):
        added = [Free(("input_added", index, s), 0.0, 1.0) for s in series[first : first + AT_ONCE]]
        shifts = np.vstack([np.zeros(len(free) + len(added)), np.hstack([np.zeros((len(added), len(free))), 0.1 * np.eye(len(added))])])
        nu = problem.nu((*free, *added), shifts, bench.fit.by)
        found.append((nu[1:] - nu[0]) / 0.1)
    return np.concatenate(found)
