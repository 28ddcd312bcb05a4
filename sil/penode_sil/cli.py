# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The `penode` command. Exit code 0: done; 2: wrong use or bad input, a line each on stderr; 3: a fault of ours."""

from __future__ import annotations

import gc
import json
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

import penode_gen

from . import inspection, mil, recording, scenario as scenarios, status, units
from .errors import UserError, hint
from .guard import guarded
from .output import Column, check_writable, write_csv
from .schedule import instance_calls
from .several import Several
from .signals import Samples
from .targets import MACHINES, Pil, Run, Sil

FILE = click.Path(path_type=Path)


@dataclass(frozen=True, eq=False)
class Result:
    """What one instance did on any target. `status` is None on MiL; `adopted` are samples."""

    instance: scenarios.Instance
    x: NDArray[Any]
    y: NDArray[Any]
    z: NDArray[Any]
    status: NDArray[np.uint32] | None
    adopted: tuple[int, ...]
    run: Run | None = None


@contextmanager
def progress(title: str, total: float) -> Iterator[Callable[[float], None]]:
    """A bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task(title, total=total)
        yield lambda done: bars.update(task, completed=done)


@contextmanager
def counted(title: str) -> Iterator[Callable[[int, int], None]]:
    """The same for things that are done one by one, whose number shows later."""
    with progress(title, 1.0) as tell:
        yield lambda done, total: tell(done / max(total, 1))


@contextmanager
def staged() -> Iterator[Callable[[float, str], None]]:
    """The same for work of several stages, that says which one is next."""
    if not sys.stderr.isatty():
        yield lambda done, doing: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<32}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("reading", total=1.0)
        yield lambda done, doing: bars.update(task, completed=done, description=doing)


def note(text: str) -> None:
    """A line for people; stdout stays for results."""
    click.echo(f"note: {text}", err=True)


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(penode_gen.VERSION, prog_name="penode")
def cli() -> None:
    """Physics-enhanced neural ODEs: from a model file to checked C, in the loop on host and Cortex-M."""


cli.add_command(inspection.inspect)


@cli.command()
@click.argument("model", type=FILE)
@click.option("-o", "--output", type=FILE, required=True, help="Directory for the C files; created if need be.")
def generate(model: Path, output: Path) -> None:
    """Check the model file MODEL and write its C."""
    loaded = penode_gen.load(model)
    if output.exists() and not output.is_dir():
        raise UserError(f"{output}: this is a file; name a directory")
    if not output.exists() and not output.absolute().parent.is_dir():
        raise UserError(f"{output}: there is no directory {output.parent}; create it")
    for path in penode_gen.generate(loaded, output):
        click.echo(str(path))


@cli.command(cls=Several)
@click.argument("model", type=FILE)
@click.option("--scenario", type=FILE, help="Scenario file (TOML) to run.")
@click.option("--input", "record", type=FILE, help="Recording (CSV with units, or MDF) whose inputs drive the model.")
@click.option(
    "--on",
    "target",
    default="sil",
    show_default=True,
    metavar="mil|sil|pil[:machine]",
    help=f"Exact reference, C on this machine, or C on an emulated one of {', '.join(MACHINES)}.",
)
@click.option("-o", "--output", type=FILE, required=True, help="CSV file to write.")
@click.option("--plot", type=FILE, help="Picture to write as well (.png, .svg, .pdf).")
@click.option("--signal", help="Signal to plot; the first output if not given.")
@click.option("--set", "set_name", help="Parameter set for --input.")
@click.option("--channel", multiple=True, help="What the recording calls an input: x=pos_mm, or x=Weg [mm].")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
def simulate(
    model: Path,
    scenario: Path | None,
    record: Path | None,
    target: str,
    output: Path,
    plot: Path | None,
    signal: str | None,
    set_name: str | None,
    channel: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run the model file MODEL on a scenario or on recorded inputs."""
    if (scenario is None) == (record is None):
        raise UserError("simulate needs exactly one of --scenario and --input; name a scenario file or a recording")
    place, _, machine = target.partition(":")
    if place not in ("mil", "sil", "pil") or (machine and place != "pil"):
        raise UserError(f'--on: "{target}" is not known; use mil, sil, pil or pil:MACHINE')
    if machine and machine not in MACHINES:
        raise UserError(f'--on: there is no machine "{machine}"; {hint(machine, MACHINES)}')
    for path in filter(None, (output, plot)):
        check_writable(path)
    if plot is not None and plot.suffix not in (".png", ".svg", ".pdf"):
        raise UserError(f'{plot}: a picture cannot be written as "{plot.suffix}"; end its name in .png, .svg or .pdf')
    loaded = penode_gen.load(model)
    names = list(dict.fromkeys([*(s.name for s in (*loaded.outputs, *loaded.sensors)), *loaded.states]))
    if signal is not None and signal not in names:
        raise UserError(f'--signal: the model has no signal "{signal}"; {hint(signal, names)}')
    if channel and scenario is not None:
        raise UserError("--channel: it names what a recording holds, and a scenario has none; remove it")
    if set_name is not None and (scenario is not None or set_name not in loaded.sets):
        raise UserError(
            "--set: scenarios name their sets themselves; remove it"
            if scenario is not None
            else f'--set: the model has no set "{set_name}"; {hint(set_name, loaded.sets)}'
        )
    length = int(np.asarray(penode_gen.set_values(loaded, next(iter(loaded.sets)))).size)
    if scenario is not None:
        plan = scenarios.load(scenario, loaded, length)
        times = scenarios.sample_times(plan, loaded.sample_time)
        offset, u = 0.0, scenarios.sampled(plan, loaded, times)
    else:
        plan, times, offset, u = _replay(record, loaded, set_name, channel)
    _warn_range(loaded, u)
    results = _run(loaded, plan, times, u, place, machine or next(iter(MACHINES)), length)
    for result in results:
        for call, code in result.run.calls if result.run else ():
            if code:
                note(
                    f"{result.instance.name}: {call.kind} before sample {call.sample} was refused: "
                    + ", ".join(status.names(code))
                )
    write_csv(output, _table(loaded, times + offset, u, results, prefix=len(plan.instances) > 1, full=record is None))
    if plot is not None:
        _plot(loaded, plan, times, results, signal or names[0], plot, target)
    summary = _summary(loaded, plan, times, results, target, output)
    click.echo(json.dumps(summary, indent=2) if as_json else _sentences(summary))


@cli.command(cls=Several)
@click.argument("model", type=FILE)
@click.option("--data", type=FILE, multiple=True, required=True, help="Recordings (CSV or MDF4), or folders of them.")
@click.option("--each", is_flag=True, help="Diagnose each recording by itself, as in a folder.")
@click.option("--holdout", type=FILE, multiple=True, help="Recordings to measure the gain on; not learnt from.")
@click.option("-o", "--output", type=FILE, required=True, help="Directory for what is found; created if need be.")
@click.option("--set", "set_name", default="default", show_default=True, help="Parameter set to start from.")
@click.option("--channel", multiple=True, help="What a file calls a signal: x=pos_mm, or x=Weg [mm].")
@click.option("--jobs", type=click.IntRange(1), help="Processes for a folder; as many as cores if not given.")
@click.option("--scheduler", help="Address of a Dask scheduler for a folder, like tcp://host:8786.")
@click.option("--resume", is_flag=True, help="Keep what DIR has of the same model, recordings and options.")
@click.option("--json", "as_json", is_flag=True, help="Print diagnosis.json, or diagnoses.json for a table.")
def diagnose(
    model: Path,
    data: tuple[Path, ...],
    each: bool,
    holdout: tuple[Path, ...],
    output: Path,
    set_name: str,
    channel: tuple[str, ...],
    jobs: int | None,
    scheduler: str | None,
    resume: bool,
    as_json: bool,
) -> None:
    """Show what the model file MODEL gets wrong, name the cause, extend the model, measure the gain.

    Several files are one study: the same plant with the same cause, one answer. A folder, or files with --each, are as
    many studies: an answer for each recording in a directory of its own below DIR, and one table over all of them in
    diagnoses.csv, diagnoses.json and index.html.
    """
    from .diagnosis import files, folder, sentences, table  # SciPy's parts are slow to load

    gc.freeze()  # what has been loaded stays to the end: not to be looked through for garbage again and again
    files.check_folder(output)
    job = files.Job(model, data, holdout, output, set_name, channel)
    if not each and not any(path.is_dir() for path in data):
        for given, name in ((jobs, "--jobs"), (scheduler, "--scheduler"), (resume, "--resume")):
            if given:
                raise UserError(f"{name}: these recordings are one study; give a folder, or --each for one by one")
        with staged() as tell:
            loaded, found = files.run(job, tell=tell)
        click.echo(json.dumps(found.as_json(), indent=2) if as_json else sentences(loaded, found, output))
        return
    if jobs and scheduler:
        raise UserError("--jobs: the cluster of --scheduler has its own number of processes; leave one of them out")
    with counted("recordings") as tell:
        rows = folder.diagnose(job, jobs or len(os.sched_getaffinity(0)), scheduler or "", resume, tell)
    name = penode_gen.load(model).name
    click.echo(table.as_json(name, rows) if as_json else table.sentences(name, rows, output))
    failed = [row.error for row in rows if row.error]
    if failed:
        raise UserError(*failed)


def _replay(
    record: Path, model: Any, set_name: str | None, channels: Iterable[str]
) -> tuple[scenarios.Scenario, Any, float, Any]:
    """A recording as a scenario; its sample times from 0, its first time [s], and its inputs on the model's raster."""
    wanted = {signal.name: signal.unit for signal in model.inputs}
    pairs = recording.aliases(channels, [s.name for s in (*model.inputs, *model.sensors, *model.outputs)])
    tables = recording.read(record, [*wanted, "time"], pairs)
    raster, u, remarks = recording.on_raster(tables, wanted, model.sample_time)
    for remark in remarks:
        note(f"{record}: {remark}")
    times = np.arange(raster.size) * model.sample_time
    inputs = {s.name: Samples(times, column) for s, column in zip(model.inputs, u.T)}
    instance = scenarios.Instance(model.name, set_name or next(iter(model.sets)))
    plan = scenarios.Scenario(record.stem, float(times[-1]), inputs, {}, (instance,), record)
    return plan, times, float(raster[0]), u


def _warn_range(model: Any, u: NDArray[np.float64]) -> None:
    """Say where an input leaves the range that the model file states."""
    for signal, column in zip(model.inputs, u.T):
        scale = units.factor(signal.unit)
        for bound, worst, outside in ((signal.minimum, column.min(), "below"), (signal.maximum, column.max(), "above")):
            if bound is not None and (worst < bound if outside == "below" else worst > bound):
                note(
                    f"input {signal.name} reaches {worst / scale:.6g} {signal.unit}, "
                    f"{outside} the model's range that ends at {bound / scale:.6g} {signal.unit}"
                )


def _run(
    model: Any,
    plan: scenarios.Scenario,
    times: NDArray[np.float64],
    u: NDArray[np.float64],
    place: str,
    machine: str,
    length: int,
) -> list[Result]:
    """All instances of a scenario, one after the other."""
    results = []
    target = None if place == "mil" else Sil(model) if place == "sil" else Pil(model, machine)
    for instance in plan.instances:
        if target is None:
            with progress(f"{instance.name} (exact)", plan.duration) as tell:
                exact = mil.run(model, plan, instance, times, length, tell)
            results.append(Result(instance, exact.x, exact.y, exact.z, None, exact.adopted))
        else:
            calls = instance_calls(model, instance, plan.initial, target.dtype)
            with progress(f"{instance.name} on {place}", times.size) as tell:
                run = target.run(u, calls, instance.set, tell)
            adopted = tuple(np.flatnonzero(run.status & status.BIT["adopted"]).tolist())
            results.append(Result(instance, run.x, run.y, run.z, run.status, adopted, run))
    return results


def _signals(model: Any, result: Result) -> Iterator[tuple[str, str, NDArray[Any]]]:
    """Name, unit as written in the model file, and SI values: outputs, sensors, then the states that are neither."""
    seen = set()
    state_units = scenarios.state_units(model)
    for name, unit, values in (
        *((s.name, s.unit, v) for s, v in zip(model.outputs, result.y.T)),
        *((s.name, s.unit, v) for s, v in zip(model.sensors, result.z.T)),
        *((name, state_units[name], v) for name, v in zip(model.states, result.x.T)),
    ):
        if name not in seen:
            seen.add(name)
            yield name, unit, values


def _table(
    model: Any, times: NDArray[np.float64], u: NDArray[np.float64], results: list[Result], *, prefix: bool, full: bool
) -> list[Column]:
    """Time, inputs, and per instance its signals; `full` adds states and status."""
    columns = [Column("time", "s", times, "%.12g")]
    columns += [Column(s.name, s.unit, v / units.factor(s.unit), "%.12g") for s, v in zip(model.inputs, u.T)]
    measured = {s.name for s in (*model.outputs, *model.sensors)}
    for result in results:
        head = f"{result.instance.name}." if prefix else ""
        digits = "%.9g" if result.x.dtype == np.float32 else "%.17g"
        columns += [
            Column(head + name, unit, values.astype(float) / units.factor(unit), digits)
            for name, unit, values in _signals(model, result)
            if full or name in measured
        ]
        if full and result.status is not None:
            columns.append(Column(f"{head}status", "1", result.status, "%d"))
    return columns


def _plot(
    model: Any,
    plan: scenarios.Scenario,
    times: NDArray[np.float64],
    results: list[Result],
    signal: str,
    path: Path,
    target: str,
) -> None:
    from . import plots  # matplotlib is slow to load

    lines, unit = [], ""
    for result in results:
        unit, values = next((unit, values) for name, unit, values in _signals(model, result) if name == signal)
        changes = tuple((e.time, f"{e.set or 'rollback'} from {e.time:g} s") for e in result.instance.exchanges)
        lines.append(plots.Line(result.instance.name, values.astype(float) / units.factor(unit), changes))
    how = {"mil": "exact solution", "sil": "generated C on the host"}.get(target, f"generated C on {target}")
    plots.draw(path, plan.title, f"{model.name}, {how}, {model.sample_time * 1e3:g} ms", times, signal, unit, lines)


def _summary(
    model: Any, plan: scenarios.Scenario, times: NDArray[np.float64], results: list[Result], target: str, output: Path
) -> dict[str, Any]:
    """What a machine may want to read."""
    instances = []
    for result in results:
        entry: dict[str, Any] = {
            "name": result.instance.name,
            "set": result.instance.set,
            "adopted_at_sample": list(result.adopted),
        }
        if result.status is not None:
            entry["flags"] = status.counts(result.status)
        if result.run is not None:
            entry["digest"] = result.run.digest
            if result.run.cost:
                entry["instructions_per_step"] = {
                    kind: {"steps": c.steps, "min": c.least, "max": c.most} for kind, c in result.run.cost.items()
                }
                entry["stack_bytes"] = result.run.stack
        instances.append(entry)
    return {
        "model": model.name,
        "scenario": plan.title,
        "target": target,
        "samples": int(times.size),
        "sample_time_s": model.sample_time,
        "output": str(output),
        "instances": instances,
    }


def _sentences(summary: dict[str, Any]) -> str:
    lines = [
        f"{summary['model']} on {summary['target']}: {summary['scenario']}, {summary['samples']} samples "
        f"of {summary['sample_time_s'] * 1e3:g} ms -> {summary['output']}"
    ]
    for entry in summary["instances"]:
        parts = [f"set {entry['set']}"]
        parts += [f"new set in force at sample {sample}" for sample in entry["adopted_at_sample"]]
        others = {k: n for k, n in entry.get("flags", {}).items() if k != "adopted"}
        parts += [f"{name} in {n} samples" for name, n in others.items()]
        parts += [
            f"{kind} step {c['min']}..{c['max']} instructions"
            if c["min"] != c["max"]
            else f"{kind} step {c['min']} instructions"
            for kind, c in entry.get("instructions_per_step", {}).items()
        ]
        parts += [f"stack {entry['stack_bytes']} B"] if "stack_bytes" in entry else []
        lines.append(f"  {entry['name']}: " + ", ".join(parts))
    return "\n".join(lines)


def main() -> None:
    """Entry point."""
    guarded(lambda: cli.main(standalone_mode=False))
