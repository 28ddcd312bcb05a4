# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode train`."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import click

from ..console import FILE, Several, staged
from ..errors import NotConverged


@click.command(cls=Several)
@click.argument("model", type=FILE)
@click.option("--data", type=FILE, multiple=True, required=True, help="Recordings (CSV or MDF4) to learn from.")
@click.option("--holdout", type=FILE, multiple=True, help="Recordings to measure the gain on; never fitted.")
@click.option("-o", "--output", type=FILE, required=True, help="Directory for the results; created if missing.")
@click.option("--known", multiple=True, help="A parameter that was measured: m_b, or m_b='351 kg'.")
@click.option(
    "--from", "start", type=FILE, multiple=True, help="Start from a trained or extended model file, NETWORK.onnx, or diagnosis.json."
)
@click.option("--channel", multiple=True, help="What a file calls a signal: x=pos_mm, or x=Weg [mm].")
@click.option("--seed", default=0, show_default=True, help="Seed of a network's initial weights; curves need none.")
@click.option("--resume", is_flag=True, help="Resume an interrupted training in DIR; the result has the same bits.")
@click.option("--json", "as_json", is_flag=True, help="Print training.json.")
def train(
    model: Path,
    data: tuple[Path, ...],
    holdout: tuple[Path, ...],
    output: Path,
    known: tuple[str, ...],
    start: tuple[Path, ...],
    channel: tuple[str, ...],
    seed: int,
    resume: bool,
    as_json: bool,
) -> None:
    """Fit the networks of the model file MODEL, and its parameters within their tolerances, to recordings.

    DIR gets an ONNX file for each network, model_trained.toml with a set `default` of them (and `before`), the set's serial form for a
    running controller, training.json, and report.html, which also lists what the recordings do not determine.

    Exit codes: 0 trained; 2 wrong use or bad input; 3 a bug in penode; 4 the fit did not reach the stated noise of the sensors
    from several starts, or the trained model predicts the held-out recordings worse than MODEL: the result is written, and marked.
    """
    from ..diagnosis.files import check_folder
    from ..training import files, result

    check_folder(output)
    with staged() as tell:
        found = files.run(files.Job(model, data, holdout, output, channel, known, seed, start, resume), tell)
    click.echo(json.dumps(found.as_json(), indent=2) if as_json else result.sentences(found, output))
    if not found.converged or found.rejected:
        sys.exit(NotConverged.exit)
