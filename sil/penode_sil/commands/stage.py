# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode stage`: a set into a controller that runs."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..calibration import address as addresses
from ..console import FILE, note
from ..errors import WrongUse


@click.command()
@click.argument("chosen", metavar="[SET]", required=False)
@click.option("--to", "to", required=True, metavar="ADDRESS", help=f"Where the controller is: {addresses.FORMS}.")
@click.option("--a2l", type=FILE, help="A2L file of the controller (default: the one it uploads).")
@click.option("--back", is_flag=True, help="Switch back to the reference page, the set in flash; without SET.")
@click.option("--json", "as_json", is_flag=True, help="Print what was done as JSON.")
def stage(chosen: str | None, to: str, a2l: Path | None, back: bool, as_json: bool) -> None:
    """Write a parameter set into a running controller: write, verify the checksum, switch, read back.

    SET is MODEL.toml:NAME, or a file in serial form. The controller adopts it between two steps, all or none.
    """
    if (chosen is None) != back:
        raise WrongUse("stage needs a SET, or --back, and not both; name a set as MODEL.toml:NAME, or a file in serial form")
    from ..calibration import pages
    from ..calibration.codes import Page, Who
    from ..calibration.link import connected
    from ..calibration.stage import stage_set

    with connected(addresses.parse(to)) as link:
        found = link.a2l(a2l)
        if back:
            link.set_page(Who.ECU, Page.REFERENCE)
            click.echo(json.dumps({"page": "reference"}) if as_json else f"{to}: {found.name} runs the reference page")
            return
        staged = stage_set(link, found, pages.choose(str(chosen), pages.segment(found)[2]))
    if as_json:
        click.echo(json.dumps(vars(staged)))
        return
    click.echo(staged.sentence())
    if staged.id is None:
        note("the A2L does not say where the id of the running set lies; measure it yourself")
