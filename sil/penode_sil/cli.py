# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The `penode` command. Exit code 0: done; 2: wrong use or bad input, a line each on stderr; 3: a bug in penode."""

from __future__ import annotations

from importlib import import_module

import click

from penode_gen.version import VERSION

from . import environment  # noqa: F401 - checks the variables that numerical libraries read, before any is loaded
from .guard import guarded

# name -> its module of commands/ and the command there, and a line for the list of commands
COMMANDS: dict[str, tuple[str, str]] = {
    "compare": ("compare:compare", "Show which parameter set a controller runs."),
    "diagnose": ("diagnose:diagnose", "Name the cause of a model's error, and extend the model."),
    "export": ("export:export", "Write a model in the format of another tool."),
    "filter": ("filter:filter", "Estimate states and sensors by a Kalman filter."),
    "generate": ("generate:generate", "Check a model file and write its C."),
    "import": ("import_:import_", "Read weights or a model from Modelica."),
    "inspect": ("inspect:inspect", "List the channels of a recording, with units and quality."),
    "measure": ("measure:measure", "Record signals of a running controller."),
    "serve": ("serve:serve", "Run a model in real time, for XCP tools."),
    "simulate": ("simulate:simulate", "Run a model on a scenario or on recorded inputs."),
    "stage": ("stage:stage", "Write a parameter set into a running controller."),
    "train": ("train:train", "Fit networks and parameters to recordings."),
    "tune-filter": ("tune_filter:tune_filter", "Fit the noises of a Kalman filter to recordings."),
}


class Commands(click.Group):
    """A group whose commands are imported when they are called; their list needs no import."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _, name = COMMANDS[cmd_name][0].partition(":")
        found: click.Command = getattr(import_module(f".commands.{module}", __package__), name)
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, COMMANDS[name][1]) for name in self.list_commands(ctx)])


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(VERSION, prog_name="penode")
def cli() -> None:
    """Models of physics and small networks: to C, simulation, training, and diagnosis from recordings."""


def main() -> None:
    """Entry point."""
    guarded(lambda: cli.main(standalone_mode=False))
