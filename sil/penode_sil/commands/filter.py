# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode filter`: the filter of a model file over recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..console import FILE, Several


@click.command(name="filter", cls=Several)
@click.argument("model", type=FILE)
@click.option(
    "--data", "records", type=FILE, multiple=True, required=True, help="Recordings (CSV with units, or MDF) with sensors of the filter."
)
@click.option(
    "--on", "target", default="sil", show_default=True, type=click.Choice(["mil", "sil"]), help="An independent float64 filter, or the C."
)
@click.option(
    "-o", "--output", type=FILE, required=True, help="Table to write (.csv, .mf4); for several recordings a folder, or with {name}."
)
@click.option("--plot", type=FILE, help="Picture to write as well (.png, .svg, .pdf).")
@click.option("--signal", help="Signal to plot (default: the first output).")
@click.option("--set", "set_name", help="Parameter set.")
@click.option("--channel", multiple=True, help="What the recording calls a signal: a_body=acc, or a_body=Beschl [g].")
@click.option("--json", "as_json", is_flag=True, help="Print the summary as JSON.")
def filter(model: Path, **given: Any) -> None:
    """Estimate the states and all sensors of the model file MODEL from the sensors that its [filter] uses."""
    from ..filtering.command import over_recordings

    over_recordings(model, **given)
