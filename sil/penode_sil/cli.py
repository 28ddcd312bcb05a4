# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The `penode` command. Exit code 0: done; 2: wrong use or bad input, a line each on stderr; 3: a fault of ours."""

from __future__ import annotations

from importlib import import_module

import click

from penode_gen.version import VERSION

from . import environment  # noqa: F401 - checks the variables that numerical libraries read, before any is loaded
from .guard import guarded

# name -> its module of commands/ and the command there, and the first line of its help
COMMANDS: dict[str, tuple[str, str]] = {
    "compare": (
        "compare:compare",
        "Which of the sets of the model file MODEL a controller runs, and what differs from its reference page.",
    ),
    "diagnose": ("diagnose:diagnose", "Show what the model file MODEL gets wrong, name the cause, extend the model, measure the gain."),
    "export": ("export:export", "Write the model file MODEL in the format of another tool."),
    "filter": (
        "filter:filter",
        "Estimate the states of the model file MODEL, and what its sensors would show, from the sensors that its [filter] uses.",
    ),
    "generate": ("generate:generate", "Check the model file MODEL and write its C."),
    "import": ("import_:import_", "Read a network of FILE, a Modelica record of weights, and write it as JSON, with the same bits;"),
    "inspect": (
        "inspect:inspect",
        "List the channels of the recording FILE with units, clock and quality, and match them to the signals of MODEL.",
    ),
    "measure": ("measure:measure", "Record signals of a controller that runs, a sample a step, with units and its own time stamps."),
    "serve": ("serve:serve", "Run the compiled model file MODEL in real time, for calibration tools to connect to by XCP."),
    "simulate": ("simulate:simulate", "Run the model file MODEL on a scenario or on recorded inputs, or play an SSP."),
    "stage": ("stage:stage", "Write a parameter set into a controller that runs: written, proven by its checksum, switched, read back."),
    "train": ("train:train", "Fit the networks of the model file MODEL, and its parameters within their tolerances, to recordings."),
    "tune-filter": (
        "tune_filter:tune_filter",
        "Fit the noises in [filter] of the model file MODEL to recordings, by the likelihood of the innovations.",
    ),
}


class Commands(click.Group):
    """A group whose commands are imported when they are called; their first lines are listed without that."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name][0].partition(":")
        found: click.Command = getattr(import_module(f".commands.{module}", __package__), name)
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        width = formatter.width - 6 - max(map(len, COMMANDS))
        with formatter.section("Commands"):
            formatter.write_dl([(n, click.Command(n, help=COMMANDS[n][1]).get_short_help_str(width)) for n in self.list_commands(ctx)])


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(VERSION, prog_name="penode")
def cli() -> None:
    """Physics-enhanced neural ODEs: from a model file to checked C, in the loop on host and Cortex-M."""


def main() -> None:
    """Entry point."""
    guarded(lambda: cli.main(standalone_mode=False))
