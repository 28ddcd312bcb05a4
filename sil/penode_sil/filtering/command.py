# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode filter` does."""

from __future__ import annotations

import json
from pathlib import Path

import click

import penode_gen
from penode_gen.model import Model

from ..console import note, progress
from ..errors import RecordingError, UserError, WrongUse, hint
from ..mdf_write import write_mf4
from ..output import Column, write_csv
from ..simulate import Asked
from . import recorded, results, watched
from .beside import check_signal, run
from .estimates import named, of


def over_recordings(
    model: Path,
    records: tuple[Path, ...],
    target: str,
    output: Path,
    plot: Path | None,
    signal: str | None,
    set_name: str | None,
    channel: tuple[str, ...],
    as_json: bool,
) -> None:
    """Filter recordings, write tables, print a summary. Raises UserError."""
    asked = Asked(model, target, None, records, output, plot, signal, set_name, channel, (), "linear")
    outputs = asked.outputs()
    loaded = penode_gen.load(model)
    of(loaded)
    check_signal(loaded, signal)
    if set_name is not None and set_name not in loaded.sets:
        raise WrongUse(f'--set: the model has no set "{set_name}"; {hint(set_name, loaded.sets)}')
    given = read(records, loaded, set_name, channel)
    summaries = []
    for one, path in zip(given, outputs, strict=True):
        with progress(f"{one.replay.plan.path.name} on {target}", len(one.z)) as tell:
            found, watch = run(target, loaded, set_name or next(iter(loaded.sets)), one.u, one.z, one.mask, {}, tell)
        times = one.replay.times + one.replay.offset
        time = Column("time", "s", times, "%.12g")
        path.parent.mkdir(parents=True, exist_ok=True)
        (write_mf4 if path.suffix == ".mf4" else write_csv)(path, [time, *results.columns(loaded, found), *watched.columns(loaded, watch)])
        if plot is not None:
            plot.parent.mkdir(parents=True, exist_ok=True)
            name = signal or named(loaded)[0][1]
            sensed = one.replay.sensed.get(name)
            results.plot(loaded, found, times, name, (sensed.time, sensed.values) if sensed else None, one.replay.plan.title, plot)
        entry = {"model": loaded.name, "recording": str(one.replay.plan.path), "target": target, "samples": len(one.z), "output": str(path)}
        summaries.append(
            entry
            | results.summary(loaded, found)
            | watched.summary(loaded, watch, times)
            | {"checked": results.checked(loaded, found, one.replay)}
        )
        if not as_json:
            head = f"{loaded.name} on {target}: {entry['recording']}, {len(one.z)} samples -> {path}"
            click.echo("\n".join([head, *results.sentences(summaries[-1]), *watched.sentences(summaries[-1])]))
    if as_json:
        click.echo(json.dumps(summaries[0] if len(summaries) == 1 else {"recordings": summaries}, indent=2))


def read(records: tuple[Path, ...], model: Model, set_name: str | None, channel: tuple[str, ...]) -> list[recorded.Measured]:
    """All recordings, or one error for what is wrong with any of them."""
    found: list[recorded.Measured] = []
    problems: list[UserError] = []
    for path in records:
        try:
            found.append(recorded.load(path, model, set_name, channel, note))
        except UserError as error:
            problems.append(error)
    if problems:
        raise problems[0] if len(problems) == 1 else RecordingError(*dict.fromkeys(p for error in problems for p in error.problems))
    return found
