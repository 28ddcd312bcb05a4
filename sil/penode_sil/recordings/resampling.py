# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Channels put on another raster: straight lines between slower rows, a low-pass without phase for faster ones."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ..errors import RecordingError, UserError
from .clocks import Samples, own_samples
from .files import pick
from .table import GAP, Recording
from .uneven import held_rows, joined, mean_interval

Array = NDArray[np.float64]
STOP_BAND = 60.0  # [dB] what lies above the new raster's Nyquist frequency is damped by this
PASS_BAND = 0.8  # of the Nyquist frequency: what lies below stays as it is, within 0.1 %


def on_raster(tables: list[Recording], wanted: Mapping[str, str], sample_time: float) -> tuple[Array, Array, list[str]]:
    """Channels (name -> unit) on one raster [s] over the time that all of them cover; values [n, channels], SI, notes.

    UserError lists every gap, missing value or missing channel: this is for input that must be complete.
    """
    problems: list[str] = []
    notes: list[str] = []
    found: dict[int, tuple[Recording, list[str]]] = {}
    for name, unit in wanted.items():
        try:
            table = pick(tables, name, unit)
            table.channel(name, unit, finite=False)
            found.setdefault(id(table), (table, []))[1].append(name)
        except UserError as exc:
            problems += exc.problems
    clocks = {}
    for key, (table, _) in found.items() or [(0, (tables[0], []))]:
        try:
            clocks[key] = table.time(notes)
        except UserError as exc:
            problems += exc.problems
    samples: dict[str, Samples | None] = {}
    for key, (table, names) in found.items():
        for name in names:
            values = table.channel(name, wanted[name], finite=False)
            own = samples[name] = own_samples(clocks[key], values, driving=True) if key in clocks else None
            if own is None or own.how != "sparse":
                try:
                    table.channel(name, wanted[name])
                except UserError as exc:
                    problems += exc.problems
    if problems:
        raise RecordingError(*problems)
    first, last = max(t[0] for t in clocks.values()), min(t[-1] for t in clocks.values())
    if last <= first:
        raise RecordingError(f"{tables[0].path}: its channels share no time; record them together")
    columns: dict[str, Array] = {}
    for key, (table, names) in found.items():
        for name in names:
            time, values, own = clocks[key], table.channel(name, wanted[name], finite=False), samples[name]
            if own is None:
                raster, column, note = resample(time, values[:, None], sample_time, first, last)
            else:
                raster, column, note = _of_samples(time, values, own, sample_time, first, last)
                note = f"{name} {note}"
            columns[name] = column[:, 0]
            notes += [note] if note else []
    return raster, np.column_stack([columns[name] for name in wanted]), list(dict.fromkeys(notes))


def _of_samples(time: Array, values: Array, own: Samples, sample_time: float, first: float, last: float) -> tuple[Array, Array, str]:
    """A channel with a clock of its own on the raster: held where the table holds it, else its samples joined; values [n, 1]."""
    clock = f"{1e3 * own.interval:.6g} ms, every {own.every:.4g} rows"
    if own.how == "held":
        raster = first + np.arange(int((last - first) / sample_time + 1e-3) + 1, dtype=float) * sample_time
        return raster, values[held_rows(time, raster).clip(0), None], f"repeats its last value between samples ({clock}): simulated as held"
    whole = np.interp(time, own.time, own.values)  # beyond its samples, the first and the last one
    raster, column, _ = resample(time, whole[:, None], sample_time, first, last)
    return raster, column, f"has empty cells between samples ({clock}): joined by straight lines"


def resample(
    time: Array, values: Array, sample_time: float, first: float | None = None, last: float | None = None
) -> tuple[Array, Array, str]:
    """Put rows [n, channels] on the raster first + k*sample_time <= last; default is all of `time`.

    Rows slower than the raster are joined by straight lines; faster ones are low-passed without phase first; uneven ones, and those within
    5 % of it, are joined by curves where these predict rows better. Returns raster, values, and a note that is empty if the rows lay on
    the raster already (within 1/1000 sample).
    """
    first = float(time[0]) if first is None else first
    count = int(((time[-1] if last is None else last) - first) / sample_time + 1e-3) + 1
    raster = first + np.arange(count, dtype=float) * sample_time
    begin = int(np.searchsorted(time, first - 1e-3 * sample_time))
    inside = time[begin : begin + count]
    if inside.size == count and np.all(np.abs(inside - raster) <= 1e-3 * sample_time):
        return raster, values[begin : begin + count], ""
    usual = float(np.median(np.diff(time)))
    grid = time[0] + np.arange(round((time[-1] - time[0]) / usual) + 1, dtype=float) * usual
    even = grid.size == time.size and bool(np.max(np.abs(grid - time)) <= 1e-2 * usual)
    usual = usual if even else mean_interval(np.diff(time), GAP)
    if np.isclose(usual, sample_time, rtol=0.05, atol=0.0) or (not even and GAP * usual >= sample_time):
        how = "by curves or straight lines through them"
        moved = np.column_stack([joined(time, column, raster) for column in values.T])
    elif usual < 0.999 * sample_time:
        if not even:
            values = np.column_stack([np.interp(grid, time, column) for column in values.T])
        interval = float(grid[1] - grid[0])
        moved = Kernel(raster, float(grid[0]), interval, grid.size, sample_time).apply(values)
        how = f"by a low-pass without phase ({PASS_BAND * 0.5 / sample_time:.4g} Hz)"
    else:
        how = "by straight lines"
        moved = np.column_stack([np.interp(raster, time, column) for column in values.T])
    note = f"resampled {how} from {time.size} rows {usual * 1e3:.6g} ms apart to {count} samples {sample_time * 1e3:.6g} ms apart"
    return raster, moved, note


class Kernel:
    """Band-limited interpolation from samples start + k*interval, k < count, to the times of a raster.

    A sinc under a Kaiser window, symmetric (no phase), each row of weights with the sum 1: passes what lies below
    PASS_BAND of the Nyquist frequency of the raster, and stops what lies above that frequency.
    """

    def __init__(self, raster: Array, start: float, interval: float, count: int, sample_time: float):
        wide = max(sample_time, interval)
        self.half = int(np.ceil((STOP_BAND - 7.95) / 14.36 / (0.5 * (1.0 - PASS_BAND)) / 2.0 * wide / interval))
        place = (raster - start) / interval
        self.base = np.floor(place + 1e-6).astype(np.int64)
        self.part = place - self.base
        self.count, self.cut = count, 0.5 * (1.0 + PASS_BAND) * interval / wide
        self.same = bool(np.ptp(self.part) < 1e-6)  # one row of weights serves all

    def _weights(self, part: Array) -> Array:
        offset = np.arange(1 - self.half, self.half + 1) - part[:, None]
        inside = np.sqrt(np.maximum(0.0, 1.0 - (offset / self.half) ** 2))
        weights = np.sinc(self.cut * offset) * np.i0(0.1102 * (STOP_BAND - 8.7) * inside) * (inside > 0.0)
        shares: Array = weights / weights.sum(axis=1, keepdims=True)
        return shares

    def apply(self, values: Array, magnitude: bool = False) -> Array:
        """Rows [count, channels] on the raster, turned round at both ends; `magnitude`: by the weights' shares."""
        out = np.empty((self.base.size, values.shape[1]))
        for first in range(0, self.base.size, 16384):  # bounded memory
            rows = slice(first, first + 16384)
            weights = self._weights(self.part[rows][:1] if self.same else self.part[rows])
            if magnitude:
                weights = np.abs(weights) / np.abs(weights).sum(axis=1, keepdims=True)
            index = self.base[rows, None] + np.arange(1 - self.half, self.half + 1)
            near = np.clip(index, 0, self.count - 1)
            mirror = np.clip(2 * near - index, 0, self.count - 1)
            for k, column in enumerate(values.T):
                taken = column[near] if magnitude else 2.0 * column[near] - column[mirror]
                out[rows, k] = np.einsum("ij,ij->i", np.broadcast_to(weights, index.shape), taken)
        return out
