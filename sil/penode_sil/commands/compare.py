# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode compare`: what a controller runs."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..calibration import address as addresses
from ..console import FILE


@click.command()
@click.argument("model", type=FILE)
@click.option("--to", "to", required=True, metavar="ADDRESS", help=f"Where the controller is: {addresses.FORMS}.")
@click.option("--a2l", type=FILE, help="A2L file of the controller (default: the one it uploads).")
@click.option("--list", "listed", type=click.IntRange(min=0), default=20, show_default=True, help="How many differing values to print.")
@click.option("--json", "as_json", is_flag=True, help="Print everything as JSON.")
def compare(model: Path, to: str, a2l: Path | None, listed: int, as_json: bool) -> None:
    """Show which set of the model file MODEL a controller runs, and how it differs from its reference page."""
    import penode_gen

    from ..calibration import pages
    from ..calibration.link import connected
    from ..calibration.stage import what_runs

    loaded = penode_gen.load(model)
    with connected(addresses.parse(to)) as link:
        described = link.a2l(a2l)
        address, _, kind = pages.segment(described)
        found = pages.look(link, described)
    running, reference = what_runs(loaded, kind, found)
    differing = found.differing(described, address)
    if as_json:
        keys = ("name", "unit", "running", "reference")
        click.echo(
            json.dumps(
                {"running": running, "reference": reference, "differing": [dict(zip(keys, row, strict=True)) for row in differing]},
                indent=1,
            )
        )
        return
    click.echo(f"running: {running}, reference: {reference}")
    for name, unit, now, then in differing[:listed]:
        click.echo(f"  {name:<32} {now:14.7g} {then:14.7g} {unit}".rstrip())
    if len(differing) > listed:
        click.echo(f"  and {len(differing) - listed} more values of {found.running[1].size} (--list, --json)")
