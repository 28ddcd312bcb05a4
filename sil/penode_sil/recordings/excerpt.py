# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Stretches of long recordings: those that tell most about a model to learn from, others to test what was learnt.

An hour at 1 kHz says hardly more about a quarter vehicle than its best minute, and a search goes through its data some hundred times.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from .measured import Measured

Array = NDArray[np.float64]
LENGTH, MOST = 10_000, 60_000  # samples of a stretch, and of all that are used to learn from, or to test


@dataclass(frozen=True)
class _Stretch:
    """Samples begin to end of a recording, by its place in the list."""

    recording: int
    begin: int
    end: int


def excerpted(train: Sequence[Measured], holdout: Sequence[Measured]) -> tuple[list[Measured], list[Measured]]:
    """What to learn from and what to test on, about MOST samples each at most, noted in the quality of the first. All of it if there are no
    more. Where no hold-out is given, it is taken from what is not learnt from."""
    total = sum(m.time.size for m in train)
    notes: list[str] = []
    kept, held = list(train), list(holdout)
    if total > MOST:
        stretches = _cut(train)
        best = _most_telling(train, stretches)
        kept = _joined(train, best)
        notes.append(
            f"{train[0].path}: {_samples(kept)} of {total} samples are used for training: the stretches with the most informative motion"
        )
        if not holdout:
            held = _joined(train, [s for s in stretches if s not in best], len(kept))
    tested = sum(m.time.size for m in held)
    if tested > MOST:
        spread = _cut(held)
        places = np.linspace(0, len(spread) - 1, MOST // LENGTH).round().astype(int)
        held = _joined(held, [spread[i] for i in np.unique(places)], len(kept))
    if held and (total > MOST or tested > MOST):
        what = "of the hold-out" if holdout else "not used for training"
        notes.append(f"{held[0].path}: {_samples(held)} of {tested} samples {what} are used for testing, evenly spread")
    if notes:
        problems = (*kept[0].quality.problems, *notes)
        kept[0] = replace(kept[0], quality=replace(kept[0].quality, problems=problems))
    return kept, held


def _samples(recordings: Iterable[Measured]) -> int:
    return sum(m.time.size for m in recordings)


def _cut(recordings: Sequence[Measured]) -> list[_Stretch]:
    """All samples in stretches of about LENGTH."""
    found = []
    for i, m in enumerate(recordings):
        n = m.time.size
        edges = np.linspace(0, n, max(round(n / LENGTH), 1) + 1).astype(int)
        found += [_Stretch(i, int(a), int(b)) for a, b in itertools.pairwise(edges)]
    return found


def _most_telling(recordings: Sequence[Measured], stretches: Sequence[_Stretch]) -> list[_Stretch]:
    """A D-optimal choice of up to MOST samples, one stretch after the other: each time the one that adds most to the determinant of the
    information about a law that is linear and quadratic in all channels."""
    names = sorted({name for m in recordings for name in m.z})
    channels = [_channels(m, names) for m in recordings]
    rows = [_features(channels[s.recording], s) for s in stretches]
    size = np.sqrt(np.mean([np.mean(r**2, axis=0) for r in rows], axis=0)) + 1e-300
    information = np.array([(r / size).T @ (r / size) / len(r) for r in rows])
    chosen: list[int] = []
    known = 1e-6 * np.eye(len(size))
    while sum(stretches[i].end - stretches[i].begin for i in chosen) < MOST - LENGTH:
        gain = np.linalg.slogdet(known + information)[1]
        gain[chosen] = -np.inf
        chosen.append(int(np.argmax(gain)))
        known = known + information[chosen[-1]]
    return [stretches[i] for i in sorted(chosen)]


def _channels(m: Measured, names: Sequence[str]) -> list[Array]:
    """Inputs and the named sensors [n] each, about their mean; 0 where they are no measurements."""
    nothing = np.full(m.time.size, np.nan)
    found = [*m.u.T, *(np.where(m.mask[name], m.z[name], np.nan) if name in m.z else nothing for name in names)]
    return [np.nan_to_num(c - (np.nanmean(c) if np.isfinite(c).any() else 0.0)) for c in found]


def _features(channels: Sequence[Array], s: _Stretch) -> Array:
    """[samples, features] of a stretch, of a thousand samples or so: channels, and these times their size."""
    rows = [c[s.begin : s.end : -(-(s.end - s.begin) // 1000)] for c in channels]
    return np.column_stack([*rows, *(c * np.abs(c) for c in rows)])


def _joined(recordings: Sequence[Measured], stretches: Sequence[_Stretch], before: int = 0) -> list[Measured]:
    """The samples of stretches; neighbours are one. They are numbered on from the part `before`."""
    runs: list[_Stretch] = []
    for s in stretches:
        if runs and (runs[-1].recording, runs[-1].end) == (s.recording, s.begin):
            runs[-1] = replace(runs[-1], end=s.end)
        else:
            runs.append(s)
    return [_part(recordings[s.recording], s.begin, s.end, k) for k, s in enumerate(runs, start=before + 1)]


def _part(m: Measured, begin: int, end: int, number: int) -> Measured:
    at = slice(begin, end)
    smooth = None if m.smooth is None else m.smooth[at]
    m = replace(m, part=number, time=m.time[at], u=m.u[at], rest=m.rest[at], smooth=smooth)
    mask, shown = ({name: flags[at] for name, flags in of.items()} for of in (m.mask, m.shown))
    return replace(m, z={name: values[at] for name, values in m.z.items()}, mask=mask, shown=shown)
