# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode import`: weights from the file of another tool, as a network file; or a Modelica model, as a model file."""

from __future__ import annotations

from pathlib import Path

import click

from penode_gen.choices import ACTIVATIONS

from ..console import FILE


@click.command("import")
@click.argument("file", type=FILE)
@click.option(
    "-o",
    "--output",
    type=FILE,
    required=True,
    help="Network file to write (.json), to be named in a set of a model file; or model file (.toml), from a Modelica model.",
)
@click.option("--network", help="Network to read, if the file has several.")
@click.option(
    "--activation",
    type=click.Choice(ACTIVATIONS),
    default="relu",
    show_default=True,
    help="Activation of hidden layers, if the file states none.",
)
@click.option("--model", help="Modelica model to read, if the file has several; for a .toml only.")
def import_(file: Path, output: Path, network: str | None, activation: str, model: str | None) -> None:
    """Convert FILE, a Modelica record of weights to a network in JSON, with the same bits;
    or a Modelica model of masses, springs and dampers to a model file."""
    from ..importing import import_ as run

    run(file, output, network, activation, model)
