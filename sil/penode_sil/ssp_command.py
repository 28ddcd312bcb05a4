# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode simulate --ssp` takes and prints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from .console import note
from .errors import WrongUse
from .output import check_writable, write_csv


def play(model: Path | None, ssp: Path, other: bool, given: dict[str, Any]) -> None:
    """Run an SSP and write its table. `other`: an option was given that is for model files. Raises UserError."""
    from . import ssp_player

    records, output = given["records"], given["output"]
    foreign = other or any(given[key] for key in ("scenario", "plot", "signal", "set_name", "start")) or given["how"] != "linear"
    if model is not None or foreign or len(records) > 1 or output.suffix != ".csv":
        raise WrongUse("--ssp: it goes with one --input, --channel and -o FILE.csv only, and without a model file; leave the others out")
    check_writable(output)
    columns = ssp_player.play(ssp, records[0] if records else None, note, given["channel"])
    write_csv(output, columns)
    click.echo(f"{ssp.name}: {columns[0].values.size} samples -> {output}")
