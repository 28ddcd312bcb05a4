# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode export`: a model in the format of another tool. Formats, and what options they have, stand in penode_gen.exports."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..console import FILE, note
from ..errors import WrongUse, hint
from .formats import OPTIONS, SUMMARIES, Shown

_KINDS = {"text": str, "file": click.Path(path_type=Path, exists=True, dir_okay=False), "number": float}


class _Export(click.Command):
    """A command with the options of all formats; for help, those of formats.py, which is quick to load."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.meta["help"] = not set(ctx.help_option_names).isdisjoint(args)
        return super().parse_args(ctx, args)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        return [*super().get_params(ctx), *map(_made, OPTIONS if ctx.meta.get("help") else declared())]

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Formats"):
            formatter.write_dl(list(SUMMARIES.items()))


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"


def declared() -> tuple[Shown, ...]:
    """The options of all formats, each once, with the formats that have it."""
    from penode_gen import exports

    found: dict[str, tuple[exports.Option, list[str]]] = {}
    for name in exports.FORMATS:
        for option in exports.exporter(name).options:
            found.setdefault(option.name, (option, []))[1].append(name)
    return tuple(Shown(o.name, f"{', '.join(formats)}: {o.help}", o.kind, o.choices) for o, formats in found.values())


def _made(option: Shown) -> click.Option:
    shape: dict[str, Any] = (
        {"is_flag": True} if option.kind == "flag" else {"type": click.Choice(option.choices) if option.choices else _KINDS[option.kind]}
    )
    return click.Option([_flag(option.name), option.name], default=None, help=option.help, **shape)


@click.command(cls=_Export)
@click.argument("model", type=FILE)
@click.option("--format", "name", required=True, metavar="NAME", help="Format, one of those below.")
@click.option("-o", "--output", type=FILE, required=True, help="File to write.")
def export(model: Path, name: str, output: Path, **given: Any) -> None:
    """Write the model file MODEL in the format of another tool."""
    import penode_gen
    from penode_gen import exports

    from ..output import check_writable, whole

    if name not in exports.FORMATS:
        raise WrongUse(f'--format: "{name}" is not known; {hint(name, exports.FORMATS)}')
    chosen = exports.exporter(name)
    options = {key: value for key, value in given.items() if value is not None}
    foreign = sorted(set(options) - {option.name for option in chosen.options})
    if foreign:
        raise WrongUse(*(f"{_flag(option)}: the format {name} has no such option; leave it out" for option in foreign))
    check_writable(output)
    data = exports.export(penode_gen.load(model), name, output, options)
    with whole(output) as part:
        part.write_bytes(data)
    for line in chosen.notes(options):
        note(line)
    click.echo(str(output))
