# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode import` does: weights of another tool become a network file, a Modelica model becomes a model file."""

from __future__ import annotations

from pathlib import Path

import click

import penode_gen
from penode_gen import imports
from penode_gen.emission.network_json import to_json

from .errors import ModelError, WrongUse, hint
from .output import check_writable, whole


def import_(file: Path, output: Path, network: str | None, activation: str, model: str | None) -> None:
    """Write what the options name (commands/import_.py), and print the file. Raises UserError."""
    whole_model = output.suffix.lower() == ".toml"
    foreign = [f"--{name}" for name in (("network", "activation") if whole_model else ("model",)) if _given(name)]
    if foreign:
        kind = "a model, which it writes as .toml" if not whole_model else "a network, which it writes as .json"
        raise WrongUse(*(f"{name}: it is for {kind}; leave it out" for name in foreign))
    if whole_model:
        _model(file, output, model)
        return
    if output.suffix.lower() != ".json":
        raise WrongUse(f'{output}: a network cannot be written as "{output.suffix}"; end its name in .json, or in .toml for a model')
    check_writable(output)
    found = imports.read(file, imports.Options(activation))
    if network is None and len(found) > 1:
        raise WrongUse(f"{file}: it has {len(found)} networks: {', '.join(found)}; choose one with --network")
    chosen = network or next(iter(found))
    if chosen not in found:
        raise WrongUse(f'--network: {file} has no network "{chosen}"; {hint(chosen, found)}')
    text = to_json(found[chosen])
    with whole(output) as part:
        part.write_text(text, encoding="utf-8")
    click.echo(str(output))


def _given(name: str) -> bool:
    """Is an option on the command line, rather than left at its default?"""
    return click.get_current_context().get_parameter_source(name) is not click.core.ParameterSource.DEFAULT


def _model(file: Path, output: Path, model: str | None) -> None:
    """Write a model file, which penode has read itself before anyone sees it."""
    from penode_gen.imports.modelica_model import model_file

    check_writable(output)
    text = model_file(imports.text_of(file), file, model)
    with whole(output) as part:
        part.write_text(text, encoding="utf-8")
        try:
            penode_gen.load(part)
        except penode_gen.ModelError as error:
            raise ModelError([f"{file}: no model file can be made of it: {error.problems[0].replace(str(part), output.name)}"]) from None
    click.echo(str(output))
