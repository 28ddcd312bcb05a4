# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode generate`: the C of a model file."""

from __future__ import annotations

from pathlib import Path

import click

from ..console import FILE
from ..errors import WrongUse


@click.command()
@click.argument("model", type=FILE)
@click.option("-o", "--output", type=FILE, required=True, help="Directory for the C files; created if missing.")
def generate(model: Path, output: Path) -> None:
    """Check the model file MODEL and write its C."""
    import penode_gen

    loaded = penode_gen.load(model)
    if output.exists() and not output.is_dir():
        raise WrongUse(f"{output}: this is a file; name a directory")
    if not output.exists() and not output.absolute().parent.is_dir():
        raise WrongUse(f"{output}: there is no directory {output.parent}; create it")
    for path in penode_gen.generate(loaded, output):
        click.echo(str(path))
