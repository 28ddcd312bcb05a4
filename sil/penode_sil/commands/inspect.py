# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode inspect`: what is in a recording, how good it is, and how it maps to a model."""

from __future__ import annotations

import json
from pathlib import Path

import click

from ..console import FILE, Several


@click.command(cls=Several)
@click.argument("file", type=FILE)
@click.argument("model", type=FILE, required=False)
@click.option("--channel", multiple=True, help="What the file calls a signal: x=pos_mm, or x=Weg [mm], or x=pos@10ms.")
@click.option("--json", "as_json", is_flag=True, help="Print it as JSON.")
def inspect(file: Path, model: Path | None, channel: tuple[str, ...], as_json: bool) -> None:
    """List the channels of the recording FILE with units, clock and quality, and match them to the signals of MODEL."""
    import penode_gen

    from ..inspection import machine, people
    from ..recordings import look, named

    loaded = None if model is None else penode_gen.load(model)
    known = [] if loaded is None else [*(i.name for i in loaded.inputs), *(s.name for s in (*loaded.sensors, *loaded.outputs))]
    found = look.look(file, loaded, named.aliases(channel, known))
    click.echo(json.dumps(machine(found), indent=2) if as_json else "\n".join(people(found)))
