# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What commands show on a terminal, and an option that takes several words."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click

FILE = click.Path(path_type=Path)


@contextmanager
def progress(title: str, total: float) -> Iterator[Callable[[float], None]]:
    """A bar on a terminal, nothing in a pipe."""
    if not sys.stderr.isatty():
        yield lambda done: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task(title, total=total)
        yield lambda done: bars.update(task, completed=done)


@contextmanager
def counted(title: str) -> Iterator[Callable[[int, int], None]]:
    """The same for things that are done one by one, whose number shows later."""
    with progress(title, 1.0) as tell:
        yield lambda done, total: tell(done / max(total, 1))


@contextmanager
def staged() -> Iterator[Callable[[float, str], None]]:
    """The same for work of several stages, that says which one is next."""
    if not sys.stderr.isatty():
        yield lambda done, doing: None
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description:<32}"), BarColumn(), TextColumn("{task.percentage:3.0f} %"), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bars:
        task = bars.add_task("reading", total=1.0)
        yield lambda done, doing: bars.update(task, completed=done, description=doing)


def note(text: str) -> None:
    """A line for people; stdout stays for results."""
    click.echo(f"note: {text}", err=True)


class Several(click.Command):
    """A command whose options of several values take all words up to the next option: --data a.csv b.csv."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        several = {name for p in self.params if isinstance(p, click.Option) and p.multiple for name in p.opts}
        spread: list[str] = []
        current = ""
        for word in args:
            if word.startswith("-"):
                current = word if word in several else ""
                spread.append(word)
            elif current and spread[-1] != current:
                spread += [current, word]
            else:
                spread.append(word)
        return super().parse_args(ctx, spread)
