# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode measure`: signals of a controller, a sample a step, by DAQ lists into an MDF4 file."""

from __future__ import annotations

from pathlib import Path

import click

from ..calibration import address as addresses
from ..console import FILE


@click.command()
@click.option("--signals", required=True, help="Signals by their names in the A2L, separated by commas.")
@click.option("--to", "to", required=True, metavar="ADDRESS", help=f"Where the controller is: {addresses.FORMS}.")
@click.option("--a2l", type=FILE, help="A2L file of the controller (default: the one it uploads).")
@click.option("--duration", help='How long, like "10 s"; default: until Ctrl-C.')
@click.option(
    "--stage",
    "staged",
    metavar="SET",
    help="Write this set while recording, as penode stage does: MODEL.toml:NAME, or a file in serial form.",
)
@click.option("--after", default="1 s", show_default=True, help="When to start writing it.")
@click.option("--every", type=click.IntRange(1, 255), default=1, show_default=True, help="Take a sample every so many steps.")
@click.option("-o", "--output", type=FILE, required=True, help="File to write (.mf4).")
def measure(
    signals: str, to: str, a2l: Path | None, duration: str | None, staged: str | None, after: str, every: int, output: Path
) -> None:
    """Record signals of a running controller, a sample a step, with units and its own time stamps."""
    from ..calibration.measure import measure as run

    run(signals, to, a2l, duration, staged, after, every, output)
