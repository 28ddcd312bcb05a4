# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode measure` does: signals of a controller, a sample a step, by DAQ lists into an MDF4 file."""

from __future__ import annotations

import itertools
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from ..console import note, progress
from ..errors import TargetError, UserError, WrongUse, hint
from ..mdf_write import write_mf4
from ..output import Column, check_writable
from ..recordings.units import UnitError, quantity
from . import address as addresses, pages
from .a2l_read import A2l, Entry
from .codes import Slave
from .link import Link, connected
from .stage import Staged, stage_set

_TYPES = {"u1": "U8", "i1": "I8", "u2": "U16", "i2": "I16", "u4": "U32", "i4": "I32", "u8": "U64", "i8": "I64", "f4": "F32", "f8": "F64"}


@dataclass
class Samples:
    """What has come: time stamps [ns of the controller], and a list of numbers each."""

    stamps: list[int] = field(default_factory=list)
    rows: list[list[float]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)  # of the columns: pyxcp puts them in the order of their addresses


@dataclass(frozen=True, eq=False)
class Log:
    """
    A measurement: time [s] from the first sample, [n]; values [n] of each signal; samples that the controller took, but that never
    came, None where it does not state the period of its event; whether it fell silent before the measurement was over.
    """

    time: NDArray[np.float64]
    values: dict[str, NDArray[Any]]
    lost: int | None
    period: float  # [s] between two samples; 0: not stated
    broken: bool = False


def _policy(entries: list[Entry], every: int) -> tuple[Any, Samples]:
    """What pyxcp feeds, and where it ends up."""
    from pyxcp.daq_stim import DaqList, DaqOnlinePolicy

    kept = Samples()

    class Collector(DaqOnlinePolicy):
        """Keeps every sample. Called by the thread that listens."""

        def initialize(self) -> None:
            """Nothing to open."""

        def on_daq_list(self, daq_list: int, timestamp0: int, timestamp1: int, payload: list[float]) -> None:
            kept.stamps.append(timestamp1)
            kept.rows.append(list(payload))

        def finalize(self) -> None:
            """Nothing to close."""

    places = {entry.address: entry for entry in entries}.values()  # two names of one place are one column
    measured = [(entry.name, entry.address, 0, _TYPES[entry.type.str[1:]]) for entry in places]
    lists = [
        DaqList(
            name="step", event_num=int(Slave.STEP), stim=False, enable_timestamps=True, measurements=measured, priority=0, prescaler=every
        )
    ]
    policy = Collector(lists, logger=logging.getLogger("penode.measure"))  # else pyxcp reads the command line, which is ours
    policy.pid_off = False  # which it sets only then
    return policy, kept


def choose(a2l: A2l, names: list[str]) -> list[Entry]:
    """The measurements of that name. Raises UserError."""
    if not names:
        raise WrongUse(f"--signals names none; name some of {a2l.name}, with commas between")
    problems = [f'--signals: {a2l.name} has no "{name}"; {hint(name, a2l.measurements)}' for name in names if name not in a2l.measurements]
    if problems:
        raise WrongUse(*problems)
    entries = [a2l.measurements[name] for name in dict.fromkeys(names)]
    several = [entry.name for entry in entries if entry.count != 1]
    if several:
        raise WrongUse(f"--signals: {several[0]} is an array; name single numbers")
    places = sorted({(entry.address, entry.type.str): entry for entry in entries}.values(), key=lambda entry: entry.address)
    for before, after in itertools.pairwise(places):
        if after.address < before.address + before.size:  # pyxcp would leave out one of them
            raise WrongUse(f"--signals: {after.name} lies in the bytes of {before.name}; measure one after the other")
    return entries


def _period(link: Link, every: int) -> float:
    """[s] between two samples; 0 if the controller does not state it."""
    info = link.ask("GET_DAQ_EVENT_INFO", link.master.getDaqEventInfo, int(Slave.STEP))
    unit = int(info.eventChannelTimeUnit)  # 0: 1 ns, ... 9: 1 s, 10: 1 ps, ...
    return float(info.eventChannelTimeCycle) * 10.0 ** (unit - (9 if unit < 10 else 22)) * every


def _log(period: float, entries: list[Entry], kept: Samples, broken: bool = False) -> Log:
    """Unwrap the time stamps and count what is missing between them."""
    rows = list(kept.rows)
    stamps = np.array(kept.stamps[: len(rows)], dtype=np.int64) // 1000  # us
    steps = np.diff(stamps) % (1 << 32)  # they are of 32 bits
    time_ = np.concatenate([[0.0], np.cumsum(steps) * 1e-6]) if stamps.size else np.zeros(0)
    lost = int(np.maximum(np.rint(steps * 1e-6 / period) - 1, 0).sum()) if period > 0.0 else None
    columns = np.array(rows, dtype=object).reshape(stamps.size, len(kept.names))
    column = {entry.address: kept.names.index(entry.name) for entry in entries if entry.name in kept.names}
    values = {entry.name: columns[:, column[entry.address]].astype(entry.type) for entry in entries}
    return Log(time_, values, lost, period, broken)


def record(
    address: addresses.Address,
    a2l: A2l,
    names: list[str],
    duration: float | None,
    every: int = 1,
    during: Callable[[Link], object] = lambda link: None,
) -> Log:
    """
    Measure while `during(link)` runs, and then for `duration` seconds, until an interrupt, or until the controller falls silent: what has
    come until then is in the log. Raises UserError.
    """
    entries = choose(a2l, names)
    policy, kept = _policy(entries, every)
    with connected(address, policy) as link:
        period = _period(link, every)
        link.ask("the DAQ commands", policy.setup)
        kept.names = [header[0] for header in policy.daq_lists[0].headers]
        link.ask("START_STOP_SYNCH", policy.start)
        broken = False
        try:
            during(link)
            broken = _wait(duration, kept)
        except KeyboardInterrupt:
            pass
        if broken:
            link.give_up()
        try:
            link.ask("START_STOP_SYNCH", policy.stop)
        except UserError:
            if not kept.rows:
                raise
            broken = True
            link.give_up()
        time.sleep(0.2)  # what is still on its way
        return _log(period, entries, kept, broken)


def _wait(duration: float | None, kept: Samples, silence: float = 10.0) -> bool:
    """Until the time is over; True if no sample comes for `silence` [s] after others have: as long as an answer may take (connected)."""
    begin = latest = time.monotonic()
    seen = 0
    with progress("measuring", duration or 1.0) as tell:
        while duration is None or time.monotonic() - begin < duration:
            time.sleep(min(0.1, (duration or 1.0)))
            tell(min(time.monotonic() - begin, duration or 0.0))
            if len(kept.rows) != seen:
                seen, latest = len(kept.rows), time.monotonic()
            elif seen and time.monotonic() - latest > silence:
                return True
    return False


def _seconds(option: str, text: str) -> float:
    try:
        found = quantity(text, "s")
    except UnitError as exc:
        raise WrongUse(f"{option}: {exc}") from exc
    if not 0.0 < found < 1e6:
        raise WrongUse(f'{option}: "{text}" is not a time; give one like "10 s"')
    return found


def measure(
    signals: str, to: str, a2l: Path | None, duration: str | None, staged: str | None, after: str, every: int, output: Path
) -> None:
    """Write what the options name (commands/measure.py), and print a summary. Raises UserError."""
    seconds, wait = None if duration is None else _seconds("--duration", duration), _seconds("--after", after)
    if output.suffix.lower() != ".mf4":
        raise WrongUse(f'{output}: a log cannot be written as "{output.suffix}"; end its name in .mf4')
    check_writable(output)
    address = addresses.parse(to)
    with connected(address) as link:
        described = link.a2l(a2l)
    names = [name.strip() for name in signals.split(",") if name.strip()]
    chosen = None if staged is None else pages.choose(staged, pages.segment(described)[2])
    done: list[Staged] = []

    def during(link: Link) -> None:
        if chosen is not None:
            time.sleep(wait)
            done.append(stage_set(link, described, chosen))

    log = record(address, described, names, seconds, every, during)
    for one in done:
        click.echo(one.sentence())
    if not log.time.size:
        raise TargetError(f"{to}: no sample arrived; is the controller stepping?")
    write_mf4(output, columns(log, described), "penode measure")
    lost = "lost ones not counted" if log.lost is None else f"{log.lost} lost"
    click.echo(f"{to}: {log.time.size} samples in {log.time[-1]:.3f} s, {lost} -> {output}")
    if log.lost is None:
        note(
            "XCP has no code for the controller's period (1 to 255 times 1 ns, 10 ns, ... 1 s): measure a counter, such as sample, to "
            "see gaps"
        )
    if log.broken:
        raise TargetError(f"{to}: the controller stopped answering, or the connection broke; samples until then are in {output}")
    if log.lost:
        note("the line was too slow for some samples: measure fewer signals, or --every 2")


def columns(log: Log, a2l: A2l) -> list[Column]:
    """A log as a table."""
    entries = a2l.measurements
    return [
        Column("time", "s", log.time),
        *(Column(name, entries[name].unit or "1", entries[name].shown(values)) for name, values in log.values.items()),
    ]
