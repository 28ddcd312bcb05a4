# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode simulate`: a model on a scenario or on recordings, exact, as C on the host, or as C on an emulated core."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..choices import MACHINES, REPLAYS
from ..console import FILE, Several


@click.command(cls=Several)
@click.argument("model", type=FILE, required=False)
@click.option("--ssp", type=FILE, help="SSP to play with its schedule of sets, instead of MODEL (gen/SCHEDULE.md); inputs by --input.")
@click.option("--scenario", type=FILE, help="Scenario file (TOML) to run.")
@click.option("--input", "records", type=FILE, multiple=True, help="Recordings (CSV with units, or MDF) that drive the model.")
@click.option(
    "--on",
    "target",
    default="sil",
    show_default=True,
    metavar="mil|sil|pil[:machine]",
    help=f"Exact reference, C on this machine, or C on an emulated one of {', '.join(MACHINES)}.",
)
@click.option(
    "-o",
    "--output",
    type=FILE,
    required=True,
    help="File to write (.csv, .mf4); for several recordings a folder, or a name with {name}. Folders are made.",
)
@click.option("--plot", type=FILE, help="Picture to write as well (.png, .svg, .pdf).")
@click.option("--signal", help="Signal to plot (default: the first output).")
@click.option("--set", "set_name", help="Parameter set for --input.")
@click.option("--channel", multiple=True, help="What the recording calls a signal: x=pos_mm, or x=Weg [mm].")
@click.option("--start", multiple=True, help='Start: "state=0.01 m", or measured[:K], fitted to the first K samples of the sensors.')
@click.option(
    "--replay", "how", type=click.Choice(REPLAYS), default="linear", show_default=True, help="How an input continues between rows."
)
@click.option(
    "--filter", "filter", is_flag=True, help="Run the model's filter beside it, on noisy sensors; --plot: truth, estimate, 3 sigma."
)
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
def simulate(model: Path | None, ssp: Path | None, target: str, as_json: bool, **given: Any) -> None:
    """Run the model file MODEL on a scenario or on recorded inputs, or play an SSP."""
    from ..simulate import simulate as run

    run(model, ssp, target, as_json, **given)
