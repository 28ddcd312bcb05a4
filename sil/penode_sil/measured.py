# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings made ready for a diagnosis: SI units on the model's raster, and per sensor which samples can be trusted.

Nothing is repaired in silence. A sensor's bad samples are masked. A gap in an input, which no simulation can cross,
parts the recording; only up to BRIDGE missing samples, or a spike, are bridged by a straight line. All of it is said
in `Quality.problems`. What cannot be used at all is a UserError.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import noise, quality
from .errors import UserError, hint
from .recording import GAP, Kernel, Recording, aliases, more, pick, read
from .units import factor

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
BRIDGE = 3  # missing samples of an input that a straight line may bridge
SHORTEST = 100  # samples on the model's raster; less says nothing about a model
SCATTER = 0.05  # of an interval: time stamps that are off by less are taken as those of a regular clock
SPILL = 0.1  # a filtered sample is bad if bad samples have more than this share of its weights
WILD = 20.0  # an input so many times beyond the model's range is a mistake
REST = 0.25  # [s] blocks in which a standstill is looked for
FACTORS = {1000.0: "1000 (mm and m)", 9.80665: "9.81 (g and m/s^2)", 100.0: "100 (cm and m)"}


@dataclass(frozen=True, eq=False)
class Channel:
    """What is known of a sensor or input from its samples alone. SI; counts are of rows in the file."""

    name: str
    interval: float  # [s] between rows
    rows: int
    missing: int
    saturated: int
    held: int
    spikes: int
    low: float | None  # where the sensor is cut off
    high: float | None
    quantum: float  # 0 if there is none
    constant: bool
    noise: noise.Noise | None  # of the samples on the raster; of the rows, if these are slower; None: too few to tell


@dataclass(frozen=True, eq=False)
class Quality:
    """All channels of a recording, and one line for each thing that is not as it should be."""

    channels: dict[str, Channel]
    problems: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Measured:
    """A recording without a gap in its inputs, SI, on the model's raster: n samples, sample_time apart.

    `mask` is True where a sensor's sample was measured and is sound; a sensor slower than the raster counts once per
    row. Elsewhere `z` is bridged or bad. `rest` is True where inputs and sensors stand still.
    """

    path: Path
    part: int  # 1, 2, ... of a recording that had to be parted; 0 if not
    time: Array  # [n] s, as in the file
    u: Array  # [n, inputs]
    z: dict[str, Array]  # [n] each
    mask: dict[str, Flags]
    rest: Flags
    quality: Quality

    @property
    def title(self) -> str:
        """The file's name, with the part if there are several."""
        return f"{self.path.name}, part {self.part}" if self.part else self.path.name


@dataclass(frozen=True, eq=False)
class _Clock:
    """The rows of a table that have a time of their own, in order; parts [first, last) between gaps."""

    rows: NDArray[np.int64]
    time: Array
    interval: float
    parts: list[tuple[int, int]]


def load(paths: Iterable[Path], model: Any, channels: Iterable[str] = ()) -> list[Measured]:
    """Read recordings for a model; `channels` are texts like `x=pos_mm` that say what a file calls a signal.

    Signals are the model's inputs (required), sensors and outputs (at least one), by name. UserError has one line for
    each reason why a recording cannot be used.
    """
    pairs = aliases(channels)
    known = [s.name for s in (*model.inputs, *model.sensors, *model.outputs)]
    problems = [
        f'channel {name}: the model has no input or sensor "{name}"; {hint(name, known)}'
        for name in pairs
        if name not in (*known, "time")
    ]
    if problems:
        raise UserError(*problems)
    found: list[Measured] = []
    for path in paths:
        try:
            found += _load(Path(path), model, pairs)
        except UserError as exc:
            problems += exc.problems
    if problems:
        raise UserError(*problems)
    return found


def _load(path: Path, model: Any, pairs: dict[str, str]) -> list[Measured]:
    signals = {s.name: s for s in (*model.outputs, *model.sensors, *model.inputs)}
    inputs = [s.name for s in model.inputs]
    tables = read(path, [*signals, "time"], pairs)
    errors: list[str] = []
    where: dict[str, Recording] = {}
    for name, signal in signals.items():
        try:
            if any(table.find(name, signal.unit) for table in tables):
                where[name] = pick(tables, name, signal.unit)
                where[name].channel(name, signal.unit, finite=False)
            elif name in inputs:
                has = ", ".join(sorted({c for table in tables for c in table.columns} - {"time"}))
                errors.append(
                    f"{path}: there is no channel {name}, which drives the model; "
                    f"record it, or say --channel {name}=NAME if it is one of: {has}"
                )
        except UserError as exc:
            errors += exc.problems
    if not errors and len(where) == len(inputs):
        sensors = ", ".join(n for n in signals if n not in inputs)
        errors.append(f"{path}: it holds no sensor of the model; record at least one of: {sensors}")
    notes: list[str] = []
    clocks: dict[int, _Clock] = {}
    for table in {id(t): t for t in where.values()}.values() or tables[:1]:
        try:
            clocks[id(table)] = _clock(table, notes)
        except UserError as exc:
            errors += exc.problems
    if errors:
        raise UserError(*errors)
    raster = _raster(path, model.sample_time, [clocks[id(where[name])] for name in inputs or where])
    taken: dict[str, _Taken] = {}
    for name, table in where.items():
        try:
            one = _take(raster, model.sample_time, signals[name], table, clocks[id(table)], name in inputs, notes)
            taken |= {name: one} if one is not None else {}
        except UserError as exc:
            errors += exc.problems
    if errors:
        raise UserError(*errors)
    return _parts(path, model.sample_time, raster, inputs, taken, notes)


@dataclass(frozen=True, eq=False)
class _Taken:
    """One channel: its rows in SI, what is wrong with them, and the same on the raster."""

    rows: Array
    faults: quality.Faults
    scale: float  # SI per unit of the file
    clock: _Clock
    values: Array
    usable: Flags


def _raster(path: Path, step: float, clocks: list[_Clock]) -> Array:
    """The times that all clocks cover, one sample time apart."""
    first, last = max(c.time[0] for c in clocks), min(c.time[-1] for c in clocks)
    count = max(0, int(min((last - first) / step + 1e-3, 1e12)) + 1)
    if count < SHORTEST:
        raise UserError(
            f"{path}: its {count} samples of {step * 1e3:g} ms are too few for a diagnosis; record at least {SHORTEST}"
        )
    if count > 20 * sum(c.time.size * max(1.0, c.interval / step) for c in clocks):
        raise UserError(f"{path}: it has far longer gaps than samples; split the recording there")
    return first + np.arange(count) * step


def _take(
    raster: Array, step: float, signal: Any, table: Recording, clock: _Clock, driving: bool, notes: list[str]
) -> _Taken | None:
    """One channel on the raster; None if it cannot be used, which is noted, or a UserError if it drives the model."""
    rows = table.channel(signal.name, signal.unit, finite=False)[clock.rows]
    raw = table.columns[table.find(signal.name, signal.unit)][clock.rows]
    faults = quality.examine(raw)
    good = np.flatnonzero(np.isfinite(raw) & (raw != 0.0))
    scale = float(rows[good[0]] / raw[good[0]]) if good.size else 1.0
    bad = faults.missing | faults.spikes if driving else faults.any
    if np.mean(bad) > 0.9 or (faults.constant and not driving):
        what = "does not change" if faults.constant else "has hardly a sound sample"
        place = f"{table.place(clock.rows[0])}: channel {signal.name} {what}"
        if driving:
            raise UserError(f"{place}, but it drives the model; record it anew")
        notes.append(f"{place}; it is left out")
        return None
    _tell(notes, table, clock, signal, faults, scale, driving)
    values, usable = _on_raster(raster, step, clock, rows, bad, driving)
    if driving and usable.any():
        _check_range(table.path, signal, values[usable], notes)
    return _Taken(rows, faults, scale, clock, values, usable)


def _parts(
    path: Path, step: float, raster: Array, inputs: list[str], taken: dict[str, _Taken], notes: list[str]
) -> list[Measured]:
    """Channels on the raster, parted where an input is missing."""
    sensors = [name for name in taken if name not in inputs]
    sound = np.logical_and.reduce([np.ones(raster.size, dtype=bool), *(taken[name].usable for name in inputs)])
    parts = [(a, b) for a, b in _stretches(sound) if b - a >= SHORTEST]
    if not parts:
        raise UserError(
            f"{path}: the inputs are nowhere measured {SHORTEST} samples in a row; record them without gaps", *notes
        )
    if not any(np.sum(taken[name].usable & sound) >= SHORTEST for name in sensors):
        raise UserError(
            f"{path}: no sensor has {SHORTEST} sound samples beside those of the inputs; record at least so many",
            *notes,
        )
    _tell_resampling(path, step, {id(t.clock): t.clock for t in taken.values()}, notes)
    lost = raster.size - sum(b - a for a, b in parts)
    if lost:
        notes.append(
            f"{path}: {lost} of {raster.size} samples lie in or beside gaps of the inputs; parts: {len(parts)}"
        )
    u = np.column_stack([np.zeros((raster.size, 0)), *(taken[name].values for name in inputs)])
    rest = {name: _standstill(u, taken[name].values, sound & taken[name].usable, step) for name in sensors}
    still = np.logical_and.reduce(list(rest.values()))
    laws = {name: _noise(name, taken, inputs, sound, rest.get(name), step) for name in taken}
    info = Quality({name: _channel(name, taken[name], laws[name]) for name in taken}, tuple(notes))
    return [
        Measured(
            path,
            k if len(parts) > 1 else 0,
            raster[a:b],
            u[a:b],
            {name: taken[name].values[a:b] for name in sensors},
            {name: taken[name].usable[a:b] for name in sensors},
            still[a:b],
            info,
        )
        for k, (a, b) in enumerate(parts, start=1)
    ]


def _channel(name: str, taken: _Taken, law: noise.Noise | None) -> Channel:
    f, scale = taken.faults, taken.scale
    counts = [int(np.sum(flags)) for flags in (f.missing, f.saturated, f.held, f.spikes)]
    low, high = (None if edge is None else edge * scale for edge in (f.low, f.high))
    quantum = f.quantum * abs(scale)
    return Channel(name, taken.clock.interval, taken.rows.size, *counts, low, high, quantum, f.constant, law)


def _noise(
    name: str, taken: dict[str, _Taken], inputs: list[str], sound: Flags, rest: Flags | None, step: float
) -> noise.Noise | None:
    """Noise of a channel: on the raster together with inputs and other sensors; by itself if its rows are slower."""
    own, quantum = taken[name], taken[name].faults.quantum * abs(taken[name].scale)
    if name in inputs or own.clock.interval > 1.001 * step:
        clock = own.clock
        count = int((clock.time[-1] - clock.time[0]) / clock.interval + 1e-3) + 1
        raster = clock.time[0] + np.arange(min(count, 20 * own.rows.size)) * clock.interval
        values, usable = _on_raster(raster, clock.interval, clock, own.rows, own.faults.any, False)
        return noise.estimate(_filled(values, usable), usable, clock.interval, quantum=quantum)
    drive = np.column_stack([np.zeros((sound.size, 0)), *(_filled(taken[n].values, sound) for n in inputs)])
    others = [
        _filled(t.values, t.usable)
        for n, t in taken.items()
        if n not in (name, *inputs) and t.clock.interval < 1.001 * step
    ]
    company = [drive, np.column_stack([drive, *others])] if others else [drive]
    return noise.estimate(_filled(own.values, own.usable), own.usable & sound, step, company, rest, quantum)


def _clock(table: Recording, notes: list[str]) -> _Clock:
    """Rows in the order of time, each time once; what had to be done is noted. UserError if that makes no clock."""
    time = table.channel("time", "s", finite=False)
    rows = np.flatnonzero(np.isfinite(time))
    if rows.size < time.size:
        bad = np.flatnonzero(~np.isfinite(time))
        notes.append(f"{table.place(bad[0])}: channel time has no value there{more(bad.size)}; such rows are left out")
    back = np.flatnonzero(np.diff(time[rows]) < 0.0)
    if back.size:
        order = np.argsort(time[rows], kind="stable")
        place = f"{table.place(rows[back[0] + 1])}: channel time goes back there{more(back.size)}"
        if np.any(np.diff(time[rows][order]) == 0.0):
            raise UserError(f"{place}, and times repeat; split the recording where its clock starts anew")
        rows = rows[order]
        notes.append(f"{place}; rows are sorted by time")
    again = np.flatnonzero(np.diff(time[rows]) == 0.0)
    if again.size:
        notes.append(
            f"{table.place(rows[again[0] + 1])}: channel time has the same value as the row before{more(again.size)}; "
            "the first of such rows counts"
        )
        rows = np.delete(rows, again + 1)
    if rows.size < 2:
        raise UserError(f"{table.path}: it has {rows.size} rows with a time of their own; record at least {SHORTEST}")
    steps = np.diff(time[rows])
    interval = float(np.median(steps))
    gaps = np.flatnonzero(steps > GAP * interval)
    if gaps.size:
        notes.append(
            f"{table.place(rows[gaps[0] + 1])}: channel time has a gap of {steps[gaps[0]]:.6g} s before that row "
            f"(rows are usually {interval:.6g} s apart){more(gaps.size)}; no sample there is used"
        )
    cuts = np.flatnonzero(steps > (BRIDGE + GAP) * interval) + 1
    bounds = [0, *cuts.tolist(), rows.size]
    parts = [(a, b) for a, b in zip(bounds, bounds[1:]) if b - a > 1]
    lengths = [int(_ticks(time[rows][a:b], interval)[-1]) for a, b in parts]
    if sum(lengths):
        interval = sum(float(time[rows][b - 1] - time[rows][a]) for a, b in parts) / sum(lengths)
    scatter = max((_line(time[rows][a:b], interval)[2] for a, b in parts), default=0.0)
    if scatter > SCATTER:
        notes.append(
            f"{table.path}: time stamps are off a regular clock of {interval:.6g} s by up to {100.0 * scatter:.2g} % "
            "of that; samples are joined by straight lines at their own times"
        )
    return _Clock(rows, time[rows], interval, parts)


def _ticks(time: Array, interval: float) -> NDArray[np.int64]:
    """The number of each row on a regular clock, from 0."""
    steps = np.maximum(1, np.round(np.diff(time) / interval).astype(np.int64))
    return np.concatenate((np.zeros(1, dtype=np.int64), np.cumsum(steps)))


def _line(time: Array, interval: float) -> tuple[float, float, float]:
    """Start [s] and interval [s] of the regular clock nearest to the times; the largest distance, in intervals."""
    ticks = _ticks(time, interval)
    if np.max(np.abs(time[0] + ticks * interval - time)) < 1e-3 * interval:
        return float(time[0]), interval, 0.0
    slope, start = np.polynomial.polynomial.polyfit(ticks, time - time[0], 1)[::-1]
    start += time[0]
    return float(start), float(slope), float(np.max(np.abs(start + ticks * slope - time)) / slope)


def _on_raster(raster: Array, step: float, clock: _Clock, si: Array, bad: Flags, driving: bool) -> tuple[Array, Flags]:
    """Rows of one channel on the raster, NaN outside of them; True where a sound row stands behind the sample.

    Of a channel that drives the model, up to BRIDGE bad rows in a row are bridged. Rows faster than the raster, or
    beside it, are low-passed without phase.
    """
    bridge = BRIDGE if driving else 0
    values, usable = np.full(raster.size, np.nan), np.zeros(raster.size, dtype=bool)
    for a, b in clock.parts:
        start, interval, scatter = _line(clock.time[a:b], clock.interval)
        ticks = _ticks(clock.time[a:b], clock.interval)
        even, wrong = np.full(ticks[-1] + 1, np.nan), np.ones(ticks[-1] + 1, dtype=bool)
        if np.all(bad[a:b]):
            continue
        if scatter <= SCATTER:
            even[ticks], wrong[ticks] = si[a:b], bad[a:b]
        else:
            start, interval = float(clock.time[a]), float(clock.time[b - 1] - clock.time[a]) / ticks[-1]
            sound = ~bad[a:b]
            even = np.interp(start + np.arange(even.size) * interval, clock.time[a:b][sound], si[a:b][sound])
            near = np.searchsorted(clock.time[a:b], start + np.arange(even.size) * interval).clip(1, b - a - 1)
            gap = np.diff(clock.time[a:b])[near - 1] > GAP * clock.interval
            wrong = bad[a:b][near] | bad[a:b][near - 1] | gap
        for i, j in _stretches(wrong):
            wrong[i:j] = not (j - i <= bridge and i > 0 and j < wrong.size)
        hole = ~np.isfinite(even) | (wrong if interval < 0.999 * step else False)
        if driving and scatter <= SCATTER:
            hole[ticks[bad[a:b]]] = True
        known = np.flatnonzero(~hole)
        if known.size < 2:
            continue
        unknown = np.ones(even.size, dtype=bool)
        unknown[known] = False
        even[unknown] = np.interp(np.flatnonzero(unknown), known, even[known])
        end = start + (even.size - 1) * interval
        inside = slice(*np.searchsorted(raster, (start - 1e-3 * step, end + 1e-3 * step)))
        values[inside], usable[inside] = _move(raster[inside], step, start, interval, even, wrong, driving)
    return values, usable


def _move(
    raster: Array, step: float, start: float, interval: float, even: Array, wrong: Flags, driving: bool
) -> tuple[Array, Flags]:
    """Evenly spaced samples to a raster within them."""
    place = (raster - start) / interval
    nearest = np.round(place).astype(np.int64).clip(0, even.size - 1)
    if interval > 1.001 * step:
        before, after = np.floor(place + 1e-3).astype(np.int64), np.ceil(place - 1e-3).astype(np.int64)
        usable = ~(wrong[before.clip(0, even.size - 1)] | wrong[after.clip(0, even.size - 1)])
        if not driving:  # one sample of the raster for each row
            usable &= np.abs(place - nearest) <= 0.5 * step / interval + 1e-9
        return np.interp(place, np.arange(even.size), even), usable
    if interval > 0.999 * step and np.all(np.abs(place - nearest) < 1e-2):
        return even[nearest], ~wrong[nearest]
    kernel = Kernel(raster, start, interval, even.size, step)
    spilt = kernel.apply(wrong[:, None].astype(float), magnitude=True)[:, 0] if wrong.any() else np.zeros(raster.size)
    return kernel.apply(even[:, None])[:, 0], spilt <= SPILL


def _stretches(flags: Flags) -> list[tuple[int, int]]:
    """[first, last) of each run of True."""
    change = np.flatnonzero(np.diff(np.concatenate(([False], flags, [False])).astype(np.int8)))
    return list(zip(change[::2].tolist(), change[1::2].tolist()))


def _filled(values: Array, usable: Flags) -> Array:
    """Straight lines where a sample is not usable."""
    good = np.flatnonzero(usable & np.isfinite(values))
    return np.interp(np.arange(values.size), good, values[good]) if good.size else np.zeros(values.size)


def _tell(
    notes: list[str],
    table: Recording,
    clock: _Clock,
    signal: Any,
    faults: quality.Faults,
    scale: float,
    driving: bool,
) -> None:
    """A line for each kind of trouble in a channel."""
    unit, per = signal.unit or "1", factor(signal.unit)
    edges = " and ".join(f"{e * scale / per:.6g} {unit}" for e in (faults.low, faults.high) if e is not None)
    left = "they are bridged" if driving else "they are left out"
    stays = "it is used as it is: check the sensor" if driving else left
    for flags, what, done in (
        (faults.missing, "has no value", f"up to {BRIDGE} in a row are bridged" if driving else left),
        (faults.saturated, f"is cut off at {edges}", stays),
        (faults.held, "repeats a value while the signal goes on", stays),
        (faults.spikes, "has a spike", left),
    ):
        if flags.any():
            row = clock.rows[np.flatnonzero(flags)[0]]
            notes.append(f"{table.place(row)}: channel {signal.name} {what}{more(int(flags.sum()))}; {done}")


def _tell_resampling(path: Path, step: float, clocks: dict[int, _Clock], notes: list[str]) -> None:
    for clock in clocks.values():
        if clock.interval < 0.999 * step:
            how = "low-passed without phase, at 0.4 of the model's rate, inputs and sensors alike"
        elif clock.interval > 1.001 * step:
            how = "inputs are joined by straight lines, a sensor counts once per row"
        else:
            continue
        notes.append(
            f"{path}: its rows are {clock.interval * 1e3:.6g} ms apart, the model's samples {step * 1e3:.6g} ms; {how}"
        )


def _check_range(path: Path, signal: Any, values: Array, notes: list[str]) -> None:
    """UserError if an input is far outside of the model's range; a note if it is a little outside."""
    per, unit = factor(signal.unit), signal.unit or "1"
    widest = max(abs(signal.minimum or 0.0), abs(signal.maximum or 0.0))
    for bound, worst, sign in ((signal.minimum, np.min(values), -1.0), (signal.maximum, np.max(values), 1.0)):
        if bound is None or sign * worst <= sign * bound:
            continue
        text = (
            f"{path}: channel {signal.name} reaches {worst / per:.6g} {unit}, "
            f"the model's range ends at {bound / per:.6g} {unit}"
        )
        if abs(worst) > WILD * widest:
            what = " its numbers look like thousandths (mm for m);" if abs(worst) < 2000.0 * widest else ""
            raise UserError(f"{text};{what} correct the unit in the recording, or the range in the model file")
        notes.append(f"{text}; the model is not made for that")


def _standstill(u: Array, z: Array, usable: Flags, step: float) -> Flags:
    """Where neither the inputs nor the sensor show more than their noise, for at least four blocks in a row."""
    size = max(8, round(REST / step))
    blocks = usable.size // size
    rest = np.zeros(usable.size, dtype=bool)
    if blocks < 8:
        return rest
    cut = slice(0, blocks * size)
    whole = usable[cut].reshape(blocks, size).all(axis=1)
    quiet = whole.copy()
    for column, often, share in (*((x, 2.0, 0.05) for x in u.T), (z, 1.5, 0.2)):
        level = np.where(whole, np.nan_to_num(column[cut]).reshape(blocks, size).std(axis=1), np.inf)
        if not quiet.any():
            return rest
        quiet &= (level <= often * np.quantile(level[quiet], 0.1)) & (level <= share * np.nanstd(column[usable]))
    for a, b in _stretches(quiet):
        if b - a >= 4:
            rest[a * size : b * size] = True
    return rest


def scale_hint(measured: Array, simulated: Array) -> str | None:
    """A remark if measured and simulated samples [n] differ by a factor that a wrong unit or sign makes; None if not.

    Their changes must go together (correlation above 0.8), and their ratio be within 15 % of that factor.
    """
    good = np.isfinite(measured) & np.isfinite(simulated)
    a, b = (x[good] - np.mean(x[good]) if good.any() else x[good] for x in (measured, simulated))
    size = float(np.linalg.norm(a) * np.linalg.norm(b))
    if size == 0.0:
        return None
    alike = float(a @ b) / size
    ratio = float(np.linalg.norm(a) / np.linalg.norm(b))
    if abs(alike) < 0.8:
        return None
    for known, text in FACTORS.items():
        if abs(np.log(ratio / known)) < 0.14:
            return f"is {ratio:.4g} times what is simulated: a factor of {text} would explain that; check the unit"
        if abs(np.log(ratio * known)) < 0.14:
            return f"is 1/{1.0 / ratio:.4g} of what is simulated: a factor of {text} would explain that; check the unit"
    return "goes against what is simulated; check the sign" if alike < 0.0 and 0.5 < ratio < 2.0 else None
