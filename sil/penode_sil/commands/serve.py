# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode serve`: the compiled model in real time, as a controller that a calibration tool connects to."""

from __future__ import annotations

from pathlib import Path

import click

from ..console import FILE


@click.command()
@click.argument("model", type=FILE)
@click.option("--tcp", type=click.IntRange(0, 65535), help="TCP port to listen on; 0: any free port.")
@click.option("--udp", type=click.IntRange(0, 65535), help="UDP port to listen on; 0: any free port.")
@click.option("--host", default="127.0.0.1", show_default=True, help="Address to listen on; 0.0.0.0: all interfaces.")
@click.option("--scenario", type=FILE, help="Scenario file whose inputs drive the model, repeated (default: zeros).")
@click.option(
    "--on", "target", default="sil", show_default=True, metavar="sil|pil[:machine]", help="On this machine, or on an emulated Cortex-M."
)
@click.option(
    "--quiet",
    type=click.IntRange(0, 60000),
    default=0,
    show_default=True,
    help="Commit edits after so many ms without further writes; 0: on page switch only.",
)
@click.option("--duration", type=click.FloatRange(min=0.0, min_open=True), help="Seconds to run (default: until Ctrl-C).")
@click.option("--a2l", type=FILE, help="Write the A2L file here, for tools that do not upload it.")
@click.option("--json", "as_json", is_flag=True, help="Print the address and the end as JSON.")
def serve(
    model: Path,
    tcp: int | None,
    udp: int | None,
    host: str,
    scenario: Path | None,
    target: str,
    quiet: int,
    duration: float | None,
    a2l: Path | None,
    as_json: bool,
) -> None:
    """Run the compiled model file MODEL in real time, for calibration tools to connect to by XCP."""
    from ..calibration.serve import serve as run

    run(model, tcp, udp, host, scenario, target, quiet, duration, a2l, as_json)
