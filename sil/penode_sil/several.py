# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Options of several values on the command line."""

from __future__ import annotations

import click


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
