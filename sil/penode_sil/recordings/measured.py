# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Recordings made ready for a diagnosis: SI units on the model's raster, and per sensor which samples can be trusted.

Nothing is repaired in silence. A sensor's bad samples are masked. A gap in an input, which no simulation can cross,
parts the recording; only up to BRIDGE missing samples, or a spike, are bridged by a straight line. All of it is reported
in `Quality.problems`. What cannot be used at all is a UserError.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Input, Model, Signal

from ..errors import RecordingError, UserError
from . import noise, quality
from .files import pick, read
from .named import aliases
from .raster import BRIDGE, SHORTEST, Clock, TooShort, clock_of, filled, held_on_raster, on_raster, stretches
from .sampled import Own, origin, own_of, steady
from .table import Recording, more
from .units import factor

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
WILD = 20.0  # an input so many times beyond the model's range is a mistake
REST = 0.25  # [s] blocks in which a standstill is looked for


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
    how: str = ""  # "held", "lines", "sparse": what rows between its samples are, see clocks


@dataclass(frozen=True, eq=False)
class Quality:
    """All channels of a recording, and one line for each thing that is not as it should be."""

    channels: dict[str, Channel]
    problems: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Measured:
    """A recording without a gap in its inputs, SI, on the model's raster: n samples, sample_time apart.

    `mask` is True where a sensor's sample was measured and is sound; a sensor slower than the raster counts once per
    sample. Elsewhere `z` is bridged or bad. `shown` is True where the file has a value that was measured, sound or not. `rest`
    is True where inputs and sensors stand still.
    """

    path: Path
    part: int  # 1, 2, ... of a recording that had to be parted; 0 if not
    time: Array  # [n] s, as in the file
    u: Array  # [n, inputs]
    z: dict[str, Array]  # [n] each
    mask: dict[str, Flags]
    shown: dict[str, Flags]
    rest: Flags
    quality: Quality
    whole: int = 0  # samples of the file on the raster, with those in gaps
    smooth: Array | None = None  # [n, inputs] with what the file repeats between samples joined to a band-limited curve; None: nothing

    @property
    def title(self) -> str:
        """The file's name, with the part if there are several."""
        return f"{self.path.name}, part {self.part}" if self.part else self.path.name


def with_shared_rails(recordings: Sequence[Measured]) -> list[Measured]:
    """The recordings, with the rails that a sensor shows in one of them known in all: there they may be touched too rarely."""
    rails: dict[tuple[str, str], float] = {}
    for m in recordings:
        for name, side in product(m.z, ("low", "high")):
            rail = getattr(m.quality.channels[name], side)
            rails |= {(name, side): rail} if rail is not None else {}
    return [_railed(m, rails) for m in recordings]


def _railed(m: Measured, rails: dict[tuple[str, str], float]) -> Measured:
    channels, mask = dict(m.quality.channels), dict(m.mask)
    for (name, side), rail in rails.items():
        if name in m.z and getattr(channels[name], side) is None:
            at = mask[name] & (np.abs(m.z[name] - rail) < 1e-9 * abs(rail))
            beyond = (m.z[name] - rail) * (1.0 if side == "high" else -1.0) > 1e-9 * abs(rail)
            if at.any() and not np.any(beyond & mask[name]):
                channel = replace(channels[name], saturated=channels[name].saturated + int(at.sum()))
                channels[name] = replace(channel, low=rail) if side == "low" else replace(channel, high=rail)
                mask[name] = mask[name] & ~at
    return replace(m, mask=mask, quality=replace(m.quality, channels=channels))


def load(paths: Iterable[Path], model: Model, channels: Iterable[str] = ()) -> list[Measured]:
    """Read recordings for a model; `channels` are texts like `x=pos_mm` that say what a file calls a signal.

    Signals are the model's inputs (required), sensors and outputs (at least one), by name. UserError has one line for
    each reason why a recording cannot be used. One that is too short is left out, which is noted, if others are not.
    """
    pairs = aliases(channels, [*(s.name for s in model.inputs), *(s.name for s in (*model.sensors, *model.outputs))])
    found: list[Measured] = []
    problems: list[str] = []
    short: list[str] = []
    for path in paths:
        try:
            found += _load(Path(path), model, pairs)
        except TooShort as exc:
            short += exc.problems
        except UserError as exc:
            problems += exc.problems
    if problems or (short and not found):
        raise RecordingError(*problems, *short)
    if short:
        notes = (*found[0].quality.problems, *(f"{line.partition('; ')[0]}; the recording is left out" for line in short))
        found[0] = replace(found[0], quality=replace(found[0].quality, problems=notes))
    return found


def _load(path: Path, model: Model, pairs: dict[str, str]) -> list[Measured]:
    signals: dict[str, Input | Signal] = {s.name: s for s in (*model.outputs, *model.sensors)}
    signals |= {s.name: s for s in model.inputs}
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
    bases: dict[int, Clock] = {}
    for table in {id(t): t for t in where.values()}.values() or tables[:1]:
        try:
            bases[id(table)] = clock_of(table, notes)
        except UserError as exc:
            if isinstance(exc, TooShort) and not errors:
                raise
            errors += exc.problems
    if errors:
        raise RecordingError(*errors)
    own = {name: own_of(signals[name], table, bases[id(table)], name in inputs) for name, table in where.items()}
    for table in {id(t): t for t in where.values()}.values():
        steady(own, [name for name, t in where.items() if t is table], bases[id(table)], path, notes)
    raster = _raster(path, model.sample_time, [own[name].clock for name in inputs or where])
    taken: dict[str, _Taken] = {}
    for name, table in where.items():
        try:
            one = _take(raster, model, signals[name], table, own[name], notes)
            taken |= {name: one} if one is not None else {}
        except UserError as exc:
            errors += exc.problems
    if errors:
        raise RecordingError(*errors)
    return _parts(path, model.sample_time, raster, inputs, taken, notes)


@dataclass(frozen=True, eq=False)
class _Taken:
    """One channel: its rows in SI, what is wrong with them, and the same on the raster."""

    rows: Array
    faults: quality.Faults
    own: Own  # its unit
    clock: Clock
    values: Array
    usable: Flags
    shown: Flags
    how: str
    smooth: Array | None = None  # of a held input


def _raster(path: Path, step: float, clocks: list[Clock]) -> Array:
    """The times that all clocks cover, one sample time apart."""
    first, last = float(max(c.time[0] for c in clocks)), float(min(c.time[-1] for c in clocks))
    count = max(0, int(min((last - first) / step + 1e-3, 1e12)) + 1)
    if count < SHORTEST:
        raise TooShort(f"{path}: its {count} samples of {step * 1e3:g} ms are too few; record at least {SHORTEST}")
    most = min(20.0 * sum(c.time.size * max(1.0, c.interval / step) for c in clocks), 1e9)  # times are no clock, or fill any memory
    if count > most:
        raise RecordingError(f"{path}: it has far longer gaps than samples; split the recording there")
    return first + np.arange(count, dtype=np.float64) * step


def _take(raster: Array, model: Model, signal: Input | Signal, table: Recording, own: Own, notes: list[str]) -> _Taken | None:
    """One channel on the raster; None if it cannot be used, which is noted, or a UserError if it drives the model."""
    clock, rows, step = own.clock, own.rows, model.sample_time
    driving = signal in model.inputs
    faults = quality.examine(own.raw, clock.uneven)
    bad = faults.missing | faults.spikes if driving else faults.any
    if np.mean(bad) > 0.9 or (faults.constant and not driving):
        what = "does not change" if faults.constant else "has almost no valid sample"
        place = f"{table.place(clock.rows[0])}: channel {signal.name} {what}"
        if driving:
            raise RecordingError(f"{place}, but it drives the model; record it anew", channel=signal.name)
        notes.append(f"{place}; it is left out")
        return None
    notes += [origin(table, signal.name, own, driving)] if own.how else []
    if own.zero:
        notes.append(
            f"{table.header}: channel {signal.name}: 0 of its unit is {own.zero:.6g} K; it is read as a temperature, not a difference"
        )
    _tell(notes, table, clock, signal, faults, own, driving, driving and model.interpolation == "held")
    smooth = None
    if driving and model.interpolation == "held" and (own.how or clock.one_by_one(step) or clock.interval > step):
        values, usable = held_on_raster(raster, clock, rows, bad)
    elif driving and own.how == "held":
        values, usable = held_on_raster(raster, clock, rows, bad)
        smooth, curved = on_raster(raster, step, clock, rows, bad, driving, curved=True)
        usable &= curved
    else:
        values, usable = on_raster(raster, step, clock, rows, bad, driving)
    shown = usable
    if faults.any.any() and not driving:
        shown = on_raster(raster, step, clock, filled(rows, ~faults.missing), faults.missing, driving)[1]
    if isinstance(signal, Input) and usable.any():
        _check_range(table.path, signal, values[usable], notes)
    return _Taken(rows, faults, own, clock, values, usable, shown, own.how, smooth)


def _parts(path: Path, step: float, raster: Array, inputs: list[str], taken: dict[str, _Taken], notes: list[str]) -> list[Measured]:
    """Channels on the raster, parted where an input is missing."""
    sensors = [name for name in taken if name not in inputs]
    sound = np.logical_and.reduce([np.ones(raster.size, dtype=bool), *(taken[name].usable for name in inputs)])
    parts = [(a, b) for a, b in stretches(sound) if b - a >= SHORTEST]
    if not parts:
        raise RecordingError(f"{path}: the inputs are nowhere measured {SHORTEST} samples in a row; record them without gaps", *notes)
    if not any(np.sum(taken[name].usable & sound) >= SHORTEST for name in sensors):
        raise RecordingError(f"{path}: no sensor has {SHORTEST} valid samples where the inputs are valid; record at least so many", *notes)
    _tell_resampling(path, step, {id(t.clock): t.clock for t in taken.values() if not t.how}, notes)
    lost = raster.size - sum(b - a for a, b in parts)
    if lost:
        notes.append(f"{path}: {lost} of {raster.size} samples lie in or beside gaps of the inputs; parts: {len(parts)}")
    u = np.column_stack([np.zeros((raster.size, 0)), *(taken[name].values for name in inputs)])
    smooth = None
    if any(taken[name].smooth is not None for name in inputs):
        both = (taken[name] for name in inputs)
        smooth = np.column_stack([t.values if t.smooth is None else t.smooth for t in both])
    rest = {name: _standstill(u, taken[name].values, sound & taken[name].usable, step) for name in sensors}
    still = np.logical_and.reduce(list(rest.values()))
    kept: noise.Kept = {}
    laws = {name: _noise(name, taken, inputs, sound, rest.get(name), step, kept) for name in taken}
    info = Quality({name: _channel(name, taken[name], laws[name]) for name in taken}, tuple(notes))
    return [
        Measured(
            path,
            k if len(parts) > 1 else 0,
            raster[a:b],
            u[a:b],
            {name: taken[name].values[a:b] for name in sensors},
            {name: taken[name].usable[a:b] for name in sensors},
            {name: taken[name].shown[a:b] for name in sensors},
            still[a:b],
            info,
            raster.size,
            None if smooth is None else smooth[a:b],
        )
        for k, (a, b) in enumerate(parts, start=1)
    ]


def _channel(name: str, taken: _Taken, law: noise.Noise | None) -> Channel:
    f, own = taken.faults, taken.own
    missing, saturated, held, spikes = (int(np.sum(flags)) for flags in (f.missing, f.saturated, f.held, f.spikes))
    low, high = (None if edge is None else edge * own.scale + own.zero for edge in (f.low, f.high))
    quantum = f.quantum * abs(own.scale)
    interval, rows = taken.clock.interval, taken.rows.size
    return Channel(name, interval, rows, missing, saturated, held, spikes, low, high, quantum, f.constant, law, taken.how)


def _noise(
    name: str, taken: dict[str, _Taken], inputs: list[str], sound: Flags, rest: Flags | None, step: float, kept: noise.Kept
) -> noise.Noise | None:
    """Noise of a channel: on the raster together with inputs and other sensors; by itself if its rows are slower."""
    own, quantum = taken[name], taken[name].faults.quantum * abs(taken[name].own.scale)
    if name in inputs or own.clock.interval > 1.001 * step:
        clock = own.clock
        count = int((clock.time[-1] - clock.time[0]) / clock.interval + 1e-3) + 1
        raster = clock.time[0] + np.arange(min(count, 20 * own.rows.size)) * clock.interval
        values, usable = on_raster(raster, clock.interval, clock, own.rows, own.faults.any, False)
        return noise.estimate(filled(values, usable), usable, clock.interval, quantum=quantum)
    drive = np.column_stack([np.zeros((sound.size, 0)), *(filled(taken[n].values, sound) for n in inputs)])
    others = [filled(t.values, t.usable) for n, t in taken.items() if n not in (name, *inputs) and t.clock.interval < 1.001 * step]
    company = [drive, np.column_stack([drive, *others])] if others else [drive]
    return noise.estimate(filled(own.values, own.usable), own.usable & sound, step, company, rest, quantum, kept)


def _tell(
    notes: list[str], table: Recording, clock: Clock, signal: Input | Signal, faults: quality.Faults, own: Own, driving: bool, stepped: bool
) -> None:
    """A line for each kind of trouble in a channel; a `stepped` one may repeat its values."""
    unit, per = signal.unit or "1", factor(signal.unit)
    edges = " and ".join(f"{(e * own.scale + own.zero) / per:.6g} {unit}" for e in (faults.low, faults.high) if e is not None)
    left = "they are bridged" if driving else "they are left out"
    stays = "it is used as it is: check the sensor" if driving else left
    held = 'it is used as it is: check the sensor; if a controller holds it, write input = "held" in the model file' if driving else left
    for flags, what, done in (
        (faults.missing, "has no value", f"up to {BRIDGE} in a row are bridged" if driving else left),
        (faults.saturated, f"is cut off at {edges}", stays),
        (faults.held & (not stepped), "repeats a value while the signal goes on", held),
        (faults.spikes, "has a spike", left),
    ):
        if flags.any():
            row = clock.rows[np.flatnonzero(flags)[0]]
            notes.append(f"{table.place(row)}: channel {signal.name} {what}{more(int(flags.sum()))}; {done}")


def _tell_resampling(path: Path, step: float, clocks: dict[int, Clock], notes: list[str]) -> None:
    for clock in clocks.values():
        if not clock.even or 0.999 * step <= clock.interval <= 1.001 * step:
            continue  # uneven rows are noted with their clock
        if clock.one_by_one(step):
            how = "a sensor counts at the sample nearest to its row, inputs are joined between rows"
        elif clock.interval < step:
            how = "low-passed without phase, at 0.4 of the model's rate, inputs and sensors alike"
        else:
            how = "inputs are joined by straight lines, a sensor counts once per row"
        notes.append(f"{path}: its rows are {clock.interval * 1e3:.6g} ms apart, the model's samples {step * 1e3:.6g} ms; {how}")


def _check_range(path: Path, signal: Input, values: Array, notes: list[str]) -> None:
    """UserError if an input is far outside of the model's range; a note if it is a little outside."""
    per, unit = factor(signal.unit), signal.unit or "1"
    widest = max(abs(signal.minimum or 0.0), abs(signal.maximum or 0.0))
    for bound, worst, sign in ((signal.minimum, np.min(values), -1.0), (signal.maximum, np.max(values), 1.0)):
        if bound is None or sign * worst <= sign * bound:
            continue
        text = f"{path}: channel {signal.name} reaches {worst / per:.6g} {unit}, the model's range ends at {bound / per:.6g} {unit}"
        if abs(worst) > WILD * widest:
            what = " its numbers look like thousandths (mm for m);" if abs(worst) < 2000.0 * widest else ""
            raise RecordingError(f"{text};{what} correct the unit in the recording, or the range in the model file", channel=signal.name)
        notes.append(f"{text}; the model is not made for that")


def _standstill(u: Array, z: Array, usable: Flags, step: float) -> Flags:
    """Where neither the inputs nor the sensor show more than their noise, for at least four blocks in a row."""
    size = max(8, round(REST / step))
    blocks = usable.size // size
    rest = np.zeros(usable.size, dtype=bool)
    if blocks < 8:
        return rest
    cut = slice(0, blocks * size)
    whole: Flags = np.all(usable[cut].reshape(blocks, size), axis=1)
    quiet = whole.copy()
    for column, often, share in (*((x, 2.0, 0.05) for x in u.T), (z, 1.5, 0.2)):
        level = np.where(whole, np.nan_to_num(column[cut]).reshape(blocks, size).std(axis=1), np.inf)
        if not quiet.any():
            return rest
        quiet &= (level <= often * np.quantile(level[quiet], 0.1)) & (level <= share * np.nanstd(column[usable]))
    for a, b in stretches(quiet):
        if b - a >= 4:
            rest[a * size : b * size] = True
    return rest
