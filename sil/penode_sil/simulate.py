# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode simulate` does: a model on a scenario or on recordings, exact, as C on the host, or as C on an emulated core."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import Model

from . import mil, replay, results, scenario as scenarios, starts, status
from .console import note, progress
from .errors import UserError, WrongUse, hint
from .filtering import beside
from .mdf_write import write_mf4
from .output import write_csv
from .recordings import units
from .results import Result
from .schedule import instance_calls
from .ssp_command import play
from .targets import MACHINES, Pil, Sil

ENDINGS = (".csv", ".mf4")
PICTURES = (".png", ".svg", ".pdf")


def simulate(model: Path | None, ssp: Path | None, target: str, as_json: bool, **given: Any) -> None:
    """Run a model on what the options name (commands/simulate.py), write the tables, print a summary. Raises UserError."""
    if ssp is not None:
        play(model, ssp, as_json or target != "sil", given)
        return
    if model is None:
        raise WrongUse("simulate needs a model file, or --ssp FILE; name one")
    asked = Asked(model, target, **given)
    place, machine = asked.place()
    outputs = asked.outputs()
    loaded = penode_gen.load(model)
    asked.check(loaded)
    asked.check_filter(loaded, place)
    start = starts.parse(asked.start, loaded)
    jobs = asked.jobs(loaded, start)
    for job in jobs:
        _warn_range(loaded, job.u)
    compiled = None if place == "mil" else Sil(loaded) if place == "sil" else Pil(loaded, machine)
    summaries = []
    for job, output in zip(jobs, outputs, strict=True):
        found = _run(loaded, job, place, compiled)
        _tell_refused(found)
        columns = results.table(loaded, job.times + job.offset, job.u, found, prefix=len(found) > 1, full=job.replay is None)
        filtered = [beside.Beside(loaded, place, job.u, result) for result in found] if asked.filter else []
        for own in filtered:
            columns += own.columns(f"{own.result.instance.name}." if len(found) > 1 else "")
        output.parent.mkdir(parents=True, exist_ok=True)
        (write_mf4 if output.suffix == ".mf4" else write_csv)(output, columns)
        if asked.plot is not None:
            asked.plot.parent.mkdir(parents=True, exist_ok=True)
            if filtered:
                filtered[0].plot(job.times, asked.signal, job.plan.title, asked.plot)
            else:
                results.plot(loaded, job.plan, job.times, found, asked.signal or _names(loaded)[0], asked.plot, target)
        summary = results.summary(loaded, job.plan, job.times, found, target, output)
        for entry, own in zip(summary["instances"], filtered, strict=False):
            entry["filter"] = own.summary()
        if job.replay is not None:
            summary["start"] = job.start
            summary["instances"][0]["rmse"] = results.rmse(loaded, job.replay, found[0])
        summaries.append(summary)
        if not as_json:
            click.echo("\n".join([results.sentences(summary), *(line for own in filtered for line in own.sentences())]))
    if as_json:
        click.echo(json.dumps(summaries[0] if len(summaries) == 1 else {"recordings": summaries}, indent=2))


@dataclass(frozen=True, eq=False)
class _Job:
    """One scenario or recording, ready to run; `start` as a line, empty if it is that of model file and scenario."""

    plan: scenarios.Scenario
    times: NDArray[np.float64]
    offset: float
    u: NDArray[np.float64]
    replay: replay.Replay | None = None
    start: str = ""


@dataclass(frozen=True)
class Asked:
    """The options, to be checked before anything is read or run. Every method raises UserError."""

    model: Path
    target: str
    scenario: Path | None
    records: tuple[Path, ...]
    output: Path
    plot: Path | None
    signal: str | None
    set_name: str | None
    channel: tuple[str, ...]
    start: tuple[str, ...]
    how: str
    filter: bool = False

    def place(self) -> tuple[str, str]:
        """mil, sil or pil, and the machine of pil."""
        if (self.scenario is None) == (not self.records):
            raise WrongUse("simulate needs exactly one of --scenario and --input; name a scenario file or recordings")
        place, _, machine = self.target.partition(":")
        if place not in ("mil", "sil", "pil") or (machine and place != "pil"):
            raise WrongUse(f'--on: "{self.target}" is not known; use mil, sil, pil or pil:MACHINE')
        if machine and machine not in MACHINES:
            raise WrongUse(f'--on: there is no machine "{machine}"; {hint(machine, MACHINES)}')
        return place, machine or next(iter(MACHINES))

    def outputs(self) -> list[Path]:
        """A file for each recording, or one for the scenario; none of them, nor the picture, has a wrong name."""
        if self.plot is not None:
            if self.plot.suffix not in PICTURES:
                raise WrongUse(f'{self.plot}: a picture cannot be written as "{self.plot.suffix}"; end its name in .png, .svg or .pdf')
            if len(self.records) > 1:
                raise WrongUse("--plot: it draws one recording, and there are several; leave it out or give one --input")
            check_makeable(self.plot)
        pattern = str(self.output)
        if len(self.records) > 1 and "{name}" not in pattern:
            if self.output.suffix in ENDINGS:
                raise WrongUse(f"{self.output}: several recordings need several files; name a folder, or a file with {{name}} in it")
            pattern = str(self.output / "{name}.csv")
        outputs = [Path(pattern.replace("{name}", path.stem)) for path in self.records] or [self.output]
        for path in outputs:
            check_makeable(path)
            if path.suffix not in ENDINGS:
                raise WrongUse(f'{path}: a table cannot be written as "{path.suffix}"; end its name in .csv or .mf4')
        twice = sorted({str(p) for p in outputs if outputs.count(p) > 1})
        if twice:
            raise WrongUse(f"{twice[0]}: two recordings would be written to it; rename one of the recordings")
        for record, path in ((r, p) for r in self.records for p in outputs):
            if path.exists() and record.exists() and path.samefile(record):
                raise WrongUse(f"{path}: this is the recording itself; name another file")
        return outputs

    def check(self, model: Model) -> None:
        """Check options against the model."""
        names = _names(model)
        if self.signal is not None and self.signal not in names:
            raise WrongUse(f'--signal: the model has no signal "{self.signal}"; {hint(self.signal, names)}')
        if self.scenario is not None:
            for option, given, why in (
                ("--channel", self.channel, "it names what a recording holds, and a scenario has none"),
                ("--start", self.start, "a scenario names its start states itself"),
                ("--replay", self.how != "linear", "it is about the rows of a recording, and a scenario has none"),
                ("--set", self.set_name, "scenarios name their sets themselves"),
            ):
                if given:
                    raise WrongUse(f"{option}: {why}; remove it")
        if self.set_name is not None and self.set_name not in model.sets:
            raise WrongUse(f'--set: the model has no set "{self.set_name}"; {hint(self.set_name, model.sets)}')

    def check_filter(self, model: Model, place: str) -> None:
        """What --filter needs."""
        if self.filter and self.scenario is None:
            raise WrongUse('--filter: it needs the truth of a scenario; for a recording use "penode filter"')
        if self.filter and place not in beside.RUN:
            raise WrongUse("--filter: it runs on mil and sil; choose one of them by --on")
        if self.filter:
            beside.check_signal(model, self.signal)

    def jobs(self, model: Model, start: starts.Start) -> list[_Job]:
        """All that is to be run, read and checked."""
        if self.scenario is not None:
            length = int(np.asarray(penode_gen.set_values(model, next(iter(model.sets)))).size)
            plan = scenarios.load(self.scenario, model, length)
            times = scenarios.sample_times(plan, model.sample_time)
            return [_Job(plan, times, 0.0, scenarios.sampled(plan, model, times))]
        found: list[replay.Replay] = []
        refused: list[UserError] = []
        for path in self.records:
            try:
                found.append(replay.load(path, model, self.set_name, self.channel, self.how, note))
            except UserError as exc:
                refused.append(exc)
        if refused:
            refused[0].problems = list(dict.fromkeys(problem for exc in refused for problem in exc.problems))
            raise refused[0]
        return [self._started(model, start, one) for one in found]

    def _started(self, model: Model, start: starts.Start, one: replay.Replay) -> _Job:
        initial, text = dict(start.given), ""
        if start.fitted:
            initial, text = starts.fit(model, one.plan.instances[0].set, one, start)
        return _Job(replace(one.plan, initial=initial), one.times, one.offset, one.u, one, text)


def check_makeable(path: Path) -> None:
    """UserError now rather than after long work, if `path` cannot be written, its folders made if need be."""
    if path.is_dir():
        raise WrongUse(f"{path}: this is a directory; name a file in it")
    folder = path.absolute().parent
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise WrongUse(f"{path}: {folder} is a file and no directory; name another one")
    if not os.access(folder, os.W_OK):
        raise WrongUse(f"{path}: the directory {folder} is not writable; name another one")


def _names(model: Model) -> list[str]:
    return list(dict.fromkeys([*(s.name for s in (*model.outputs, *model.sensors)), *model.states]))


def _tell_refused(found: list[Result]) -> None:
    for result in found:
        for call, code in result.run.calls if result.run else ():
            if code:
                refused = ", ".join(status.names(code))
                note(f"{result.instance.name}: {call.kind} before sample {call.sample} was refused: {refused}")


def _warn_range(model: Model, u: NDArray[np.float64]) -> None:
    """Say where an input leaves the range that the model file states."""
    for signal, column in zip(model.inputs, u.T, strict=True):
        scale = units.factor(signal.unit)
        for bound, worst, outside in ((signal.minimum, column.min(), "below"), (signal.maximum, column.max(), "above")):
            if bound is not None and (worst < bound if outside == "below" else worst > bound):
                note(
                    f"input {signal.name} reaches {worst / scale:.6g} {signal.unit}, "
                    f"{outside} the model's range that ends at {bound / scale:.6g} {signal.unit}"
                )


def _run(model: Model, job: _Job, place: str, target: Sil | Pil | None) -> list[Result]:
    """All instances of a scenario, one after the other."""
    found = []
    for instance in job.plan.instances:
        title = f"{job.plan.path.name}: {instance.name}"
        if target is None:
            length = int(np.asarray(penode_gen.set_values(model, next(iter(model.sets)))).size)
            with progress(f"{title} (exact)", job.plan.duration) as tell:
                exact = mil.run(model, job.plan, instance, job.times, length, tell)
            found.append(Result(instance, exact.x, exact.y, exact.z, None, exact.adopted))
        else:
            calls = instance_calls(model, instance, job.plan.initial, target.dtype)
            with progress(f"{title} on {place}", job.times.size) as tell:
                run = target.run(job.u, calls, instance.set, tell)
            adopted = tuple(np.flatnonzero(run.status & status.BIT["adopted"]).tolist())
            found.append(Result(instance, run.x, run.y, run.z, run.status, adopted, run))
    return found
