# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode diagnose`: what a model gets wrong, and why."""

from __future__ import annotations

import gc
import json
import os
from pathlib import Path

import click

from ..console import FILE, Several, counted, staged
from ..errors import RecordingError, WrongUse


@click.command(cls=Several)
@click.argument("model", type=FILE)
@click.option("--data", type=FILE, multiple=True, required=True, help="Recordings (CSV or MDF4), or folders of them.")
@click.option("--each", is_flag=True, help="Diagnose each recording by itself, as in a folder.")
@click.option("--holdout", type=FILE, multiple=True, help="Recordings to measure the gain on; never fitted.")
@click.option("--still", type=FILE, multiple=True, help="Recordings at standstill: the noise of each channel, instead of the model file's.")
@click.option("-o", "--output", type=FILE, required=True, help="Directory for the results; created if missing.")
@click.option("--set", "set_name", default="default", show_default=True, help="Parameter set to start from.")
@click.option("--channel", multiple=True, help="What a file calls a signal: x=pos_mm, or x=Weg [mm].")
@click.option("--jobs", type=click.IntRange(1), help="Processes for a folder (default: one per core).")
@click.option("--scheduler", help="Address of a Dask scheduler for a folder, like tcp://host:8786.")
@click.option("--resume", is_flag=True, help="Keep results in DIR that are of the same model, recordings and options.")
@click.option("--json", "as_json", is_flag=True, help="Print diagnosis.json, or diagnoses.json for a table.")
def diagnose(
    model: Path,
    data: tuple[Path, ...],
    each: bool,
    holdout: tuple[Path, ...],
    still: tuple[Path, ...],
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
    import penode_gen

    from ..diagnosis import files, folder, sentences, table

    gc.freeze()  # what has been loaded stays to the end: not to be looked through for garbage again and again
    files.check_folder(output)
    job = files.Job(model, data, holdout, output, set_name, channel, still)
    if not each and not any(path.is_dir() for path in data):
        for given, name in ((jobs, "--jobs"), (scheduler, "--scheduler"), (resume, "--resume")):
            if given:
                raise WrongUse(f"{name}: these recordings are one study; give a folder, or --each for one by one")
        with staged() as tell:
            loaded, found = files.run(job, tell=tell)
        click.echo(json.dumps(found.as_json(), indent=2) if as_json else sentences(loaded, found, output))
        return
    if jobs and scheduler:
        raise WrongUse("--jobs: the cluster of --scheduler has its own number of processes; leave one of them out")
    with counted("recordings") as tell:
        rows = folder.diagnose(job, jobs or len(os.sched_getaffinity(0)), scheduler or "", resume, tell)
    name = penode_gen.load(model).name
    failed = RecordingError(*(row.error for row in rows if row.error))
    if as_json:
        click.echo(table.as_json(name, rows, failed.as_json() if failed.problems else {}))
        failed.printed = True
    else:
        click.echo(table.sentences(name, rows, output))
    if failed.problems:
        raise failed
