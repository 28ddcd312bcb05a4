# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Scenario files: inputs, duration, and exchanges of parameter sets.

The file is checked as a whole: UserError has one line for each problem, with file, key and remedy. All SI.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from .errors import Problem, ScenarioError, UserError, hint
from .recordings import pick, read
from .recordings.units import UnitError, quantity
from .signals import ROAD_CLASSES, Bump, Chirp, Constant, Ramp, Road, Samples, Signal, Sum, VelocityChirp

HOW = ("write", "select", "rollback")
CHUNK = 64


@dataclass(frozen=True)
class Exchange:
    """At `time` [s] the dynamics change to `set` ("" for a rollback): the state there is the last of the old set.

    write: staged in `chunk` values per sample beforehand, so that the last chunk and the commit fall on `time`;
    with `hold` the state is held while that lasts. select, rollback: no staging.
    """

    time: float
    set: str
    how: str
    chunk: int = CHUNK
    hold: bool = False


@dataclass(frozen=True)
class Instance:
    """One copy of the model: the set that it starts with and its exchanges, in the order of time."""

    name: str
    set: str
    exchanges: tuple[Exchange, ...] = ()


@dataclass(frozen=True)
class Scenario:
    """A checked scenario. `inputs` holds a signal for each input of the model; `initial` overrides start states."""

    title: str
    duration: float
    inputs: Mapping[str, Signal]
    initial: dict[str, float]
    instances: tuple[Instance, ...]
    path: Path


class _Table:
    """One table of the file: hands out checked values, collects problems, and knows which keys were asked for."""

    def __init__(self, data: object, key: str, path: Path, problems: list[str]):
        self.key, self.path, self.problems = key, path, problems
        self.asked: set[str] = set()
        self.data: dict[str, object] = data if isinstance(data, dict) else {}
        if not isinstance(data, dict):
            self.complain("", "is not a table", f"write [{key}]")

    def complain(self, key: str, what: str, remedy: str) -> None:
        place = ".".join(part for part in (self.key, key) if part)
        self.problems.append(Problem(what, str(self.path), None, place, remedy))

    def has(self, key: str) -> bool:
        self.asked.add(key)
        return key in self.data

    def raw(self, key: str, default: object, example: str = "") -> object:
        """The value as it stands, or the default; where that is None, a missing key is a problem."""
        if not self.has(key) and default is None:
            self.complain(key, "is missing", f"add {key} = {example}")
        return self.data.get(key, default)

    def quantity(self, key: str, unit: str, default: float | None = None, *, positive: bool = False, minimum: float = -math.inf) -> float:
        """An SI number that measures what `unit` does; NaN after a problem, so that reading goes on."""
        value = self.raw(key, default, f'"1 {unit}"' if unit else "1")
        if not self.has(key):
            return math.nan if default is None else default
        try:
            number = quantity(value, unit)
        except UnitError as exc:
            what, _, remedy = str(exc).partition("; ")
            self.complain(key, what, remedy)
            return math.nan
        if (positive and number <= 0.0) or number < minimum:
            self.complain(
                key,
                f"{value!r} is {'negative' if number < 0.0 else 'not positive'}",
                f"give {'more than 0' if positive else f'at least {minimum:g}'} {unit}".rstrip(),
            )
            return math.nan
        return number

    def text(self, key: str, default: str | None = None, choices: tuple[str, ...] = ()) -> str:
        """A text, one of the choices if there are any; "" after a problem."""
        value = self.raw(key, default, f'"{choices[0]}"' if choices else '"..."')
        if value is None:
            return ""
        if not isinstance(value, str):
            self.complain(key, f"{value!r} is not a text", "put it in quotes")
            return ""
        if choices and value not in choices:
            self.complain(key, f'"{value}" is not known', hint(value, choices))
            return ""
        return value

    def integer(self, key: str, default: int | None = None, minimum: int = 0) -> int:
        value = self.raw(key, default, str(minimum))
        if isinstance(value, bool) or not isinstance(value, int) or value < minimum:
            if value is not None:
                self.complain(key, f"{value!r} is not a whole number of at least {minimum}", "correct it")
            return minimum
        return value

    def flag(self, key: str, default: bool) -> bool:
        value = self.raw(key, default)
        if not isinstance(value, bool):
            self.complain(key, f"{value!r} is neither true nor false", "write true or false")
            return default
        return value

    def table(self, key: str) -> _Table:
        value = self.raw(key, {})
        return _Table(value, ".".join(part for part in (self.key, key) if part), self.path, self.problems)

    def tables(self, key: str) -> list[_Table]:
        """An array of tables; the n-th is called key[n] in problems, counted from 1."""
        value = self.raw(key, [])
        place = ".".join(part for part in (self.key, key) if part)
        if not isinstance(value, list):
            self.complain(key, "is not a list of tables", f"write [[{place}]]")
            return []
        return [_Table(item, f"{place}[{n}]", self.path, self.problems) for n, item in enumerate(value, start=1)]

    def finish(self) -> None:
        """Every key that nobody asked for is a problem."""
        for key in self.data:
            if key not in self.asked:
                self.complain(key, "is not known here", hint(key, sorted(self.asked)))


def _chirp(table: _Table, unit: str, duration: float) -> Signal:
    velocity = table.has("velocity_amplitude")
    if velocity == table.has("amplitude"):
        table.complain(
            "", "needs exactly one of amplitude and velocity_amplitude", f'amplitude = "1 {unit}" or velocity_amplitude = "1 {unit}/s"'
        )
        size = 0.0
    else:
        size = table.quantity("velocity_amplitude", f"{unit}/s") if velocity else table.quantity("amplitude", unit)
    start = table.quantity("start_frequency", "Hz", minimum=0.0)
    if table.has("rate") == table.has("end_frequency"):
        table.complain("", "needs exactly one of end_frequency and rate", 'end_frequency = "10 Hz" or rate = "0.25 Hz/s"')
        rate = 0.0
    elif table.has("rate"):
        rate = table.quantity("rate", "Hz/s")
    else:
        rate = (table.quantity("end_frequency", "Hz", minimum=0.0) - start) / duration
    phase = table.quantity("phase", "rad", 0.0)
    return VelocityChirp(size, start, rate, phase) if velocity else Chirp(size, start, rate, phase)


def _constant(table: _Table, unit: str, duration: float) -> Signal:
    return Constant(table.quantity("value", unit))


def _ramp(table: _Table, unit: str, duration: float) -> Signal:
    return Ramp(table.quantity("height", unit), table.quantity("start", "s", 0.0, minimum=0.0), table.quantity("rise", "s", positive=True))


def _bump(table: _Table, unit: str, duration: float) -> Signal:
    height, start = table.quantity("height", unit), table.quantity("start", "s", 0.0, minimum=0.0)
    return Bump(height, start, table.quantity("length", "m", positive=True) / table.quantity("speed", "m/s", positive=True))


def _road(table: _Table, unit: str, duration: float) -> Signal:
    roughness = ROAD_CLASSES.get(table.text("class", choices=tuple(ROAD_CLASSES)), 1.0)
    speed = table.quantity("speed", "m/s", positive=True)
    try:
        quantity(f"1 {unit}", "m")
    except UnitError:
        table.complain("kind", f"a road is a height in m, but this input is in {unit or '1'}", "use another kind")
    return Road(roughness, speed, table.integer("seed", 0), table.quantity("fade_in", "s", 0.5, minimum=0.0))


def _recording(table: _Table, unit: str, duration: float) -> Signal:
    file, channel = table.text("file"), table.text("channel", table.key.split(".")[-1].split("[")[0])
    if file:
        try:
            recording = pick(read(table.path.parent / file, [channel, "time"]), channel, unit)
            time, level = recording.time(), recording.channel(channel, unit)
        except UserError as exc:
            table.problems.extend(exc.problems)
        else:
            if time[-1] - time[0] < duration * (1.0 - 1e-9):
                table.complain("file", f"{file} ends after {time[-1] - time[0]:.6g} s", "shorten the scenario's duration")
            return Samples(time - time[0], level)
    return Constant(0.0)


def _sum(table: _Table, unit: str, duration: float) -> Signal:
    terms = tuple(_signal(term, unit, duration) for term in table.tables("terms"))
    if not terms:
        table.complain("terms", "is empty", f"add [[{table.key}.terms]] with a kind")
    return Sum(terms)


KINDS: dict[str, Callable[[_Table, str, float], Signal]] = {
    "chirp": _chirp,
    "constant": _constant,
    "ramp": _ramp,
    "bump": _bump,
    "road": _road,
    "recording": _recording,
    "sum": _sum,
}


def _signal(table: _Table, unit: str, duration: float) -> Signal:
    kind = table.text("kind", choices=tuple(KINDS))
    if not kind:
        return Constant(0.0)
    signal = KINDS[kind](table, unit, duration)
    table.finish()
    return signal


def staging_samples(length: int, chunk: int) -> int:
    """How many chunks a set of `length` values takes; they fall on as many samples, the last on the exchange's time."""
    return -(-length // chunk)


def on_raster(time: float, sample_time: float, table: _Table, key: str) -> float:
    """The sample's time nearest to `time`; a problem if it is another one. NaN stays NaN."""
    if math.isnan(time):
        return time
    if not math.isfinite(time / sample_time):
        table.complain(key, f"{time:g} s is more samples than there are numbers", "give a shorter time")
        return math.nan
    ticks = round(time / sample_time)
    if abs(time / sample_time - ticks) > 1e-6:
        table.complain(key, f"{time:g} s is not on the raster of {sample_time:g} s", f'use "{ticks * sample_time:.9g} s"')
    return ticks * sample_time


def _instance(table: _Table, sets: Iterable[str], length: int, sample_time: float, duration: float, name: str) -> Instance:
    name = table.text("name", name)
    start = table.text("set", next(iter(sets)), choices=tuple(sets))
    exchanges: list[Exchange] = []
    free = 0.0  # [s] the next staging may begin here
    for item in table.tables("exchange"):
        time = on_raster(item.quantity("time", "s", minimum=0.0), sample_time, item, "time")
        how = item.text("how", "write", choices=HOW)
        if how == "rollback":
            if not exchanges:
                item.complain("how", "there is nothing to roll back to", "put an exchange before it")
            exchange = Exchange(time, "", how)
        else:
            target = item.text("set", choices=tuple(sets))
            exchange = Exchange(time, target, how)
            if how == "write":
                exchange = Exchange(time, target, how, item.integer("chunk", CHUNK, minimum=1), item.flag("hold", False))
        item.finish()
        if time > duration - sample_time / 2:
            item.complain("time", f"{time:g} s is not before the end at {duration:g} s", "exchange earlier or run longer")
        begin = time - (staging_samples(length, exchange.chunk) - 1) * sample_time if how == "write" else time
        if begin < free - sample_time / 2:
            item.complain(
                "time", f"staging would begin at {begin:.6g} s, before {free:.6g} s, when it may", "exchange later or in larger chunks"
            )
        free = time + sample_time
        exchanges.append(exchange)
    table.finish()
    return Instance(name, start, tuple(exchanges))


def state_units(model: Model) -> dict[str, str]:
    """Name and SI unit of each state, in order."""
    units = {body.position: body.unit for body in model.bodies} | {body.velocity: f"{body.unit}/s" for body in model.bodies}
    return units | {state.name: state.unit for state in model.extra_states}


def load(path: Path, model: Model, set_length: int) -> Scenario:
    """Read and check a scenario for a model whose sets have `set_length` values."""
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as exc:
        raise ScenarioError(f"{path}: {exc.strerror or exc}; name a scenario file that can be read") from exc
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as exc:
        found = re.search(r"at line (\d+)", str(exc))
        raise ScenarioError(f"{path}: it is not valid TOML: {exc}; correct it there", line=int(found[1]) if found else None) from exc
    problems: list[str] = []
    table = _Table(data, "", path, problems)
    title = table.text("title", path.stem)
    duration = on_raster(table.quantity("duration", "s", positive=True), model.sample_time, table, "duration")

    inputs: dict[str, Signal] = {}
    given = table.table("input")
    for signal in model.inputs:
        if given.has(signal.name):
            inputs[signal.name] = _signal(given.table(signal.name), signal.unit, duration)
        else:
            given.complain(signal.name, "is missing", f"add [input.{signal.name}] with a kind")
    given.finish()

    start = table.table("initial")
    initial = {name: start.quantity(name, unit) for name, unit in state_units(model).items() if start.has(name)}
    start.finish()

    instances = tuple(
        _instance(item, model.sets, set_length, model.sample_time, duration, f"instance{n}")
        for n, item in enumerate(table.tables("instance"), start=1)
    ) or (Instance(model.name, next(iter(model.sets))),)
    names = [instance.name for instance in instances]
    for name in sorted({name for name in names if names.count(name) > 1}):
        table.complain("instance", f'two are called "{name}"', "give each its own name")
    table.finish()
    if problems:
        raise ScenarioError(*problems)
    return Scenario(title, duration, inputs, initial, instances, path)


def sample_times(scenario: Scenario, sample_time: float) -> NDArray[np.float64]:
    """The raster 0, h, 2h, ... up to the duration [s]."""
    return np.arange(round(scenario.duration / sample_time) + 1, dtype=float) * sample_time


def sampled(scenario: Scenario, model: Model, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """All inputs at the given times, [n, n_u]."""
    return np.column_stack([np.zeros((len(times), 0)), *(scenario.inputs[signal.name].value(times) for signal in model.inputs)])
