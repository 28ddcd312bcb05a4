# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode serve` does: the compiled model in real time, as a controller that a calibration tool connects to."""

from __future__ import annotations

import json
import math
import time
from pathlib import Path

import click

import penode_gen

from ..console import note
from ..errors import WrongUse
from .emulated import WITH_UART, emulated
from .virtual import Served, inputs, served

_WHY = {
    True: "this machine is too slow for the sample time, or a virtual one that is paused; use another, or a longer sample time",
    False: "other programs run first; end them, or give penode the right to real-time priority (CAP_SYS_NICE, or ulimit -r 1)",
}


def serve(
    model: Path,
    tcp: int | None,
    udp: int | None,
    host: str,
    scenario: Path | None,
    target: str,
    quiet: int,
    duration: float | None,
    a2l: Path | None,
    as_json: bool,
) -> None:
    """Serve as the options say (commands/serve.py). Raises UserError."""
    if (tcp is None) == (udp is None):
        raise WrongUse("serve needs one of --tcp PORT and --udp PORT; use --tcp 5555")
    place, _, machine = target.partition(":")
    if place not in ("sil", "pil") or (machine and place == "sil"):
        raise WrongUse(f'--on: "{target}" is not known; use sil, pil or pil:MACHINE')
    if place == "pil" and (tcp is None or quiet):
        raise WrongUse(
            "--on pil: its serial line is a TCP port, and edits are in force by page switch only; use --tcp PORT, without --quiet"
        )
    loaded = penode_gen.load(model)
    u = inputs(loaded, scenario)
    kind = "tcp" if tcp is not None else "udp"
    port = int(tcp if tcp is not None else udp or 0)
    with (
        emulated(loaded, machine or WITH_UART[0], host, port, u) if place == "pil" else served(loaded, kind, host, port, u, quiet) as found
    ):
        if a2l is not None:
            a2l.write_text(found.a2l, encoding="utf-8")
        if place == "pil":
            note(
                f"it offers no A2L: give penode measure, stage and compare --a2l {a2l}"
                if a2l
                else "it offers no A2L: write one by --a2l, for tools and for penode measure, stage and compare"
            )
        elif not found.a2l:
            note("it offers no A2L: that needs the Python package pyelftools; pip install penode[xcp]")
        click.echo(
            json.dumps({"address": found.address})
            if as_json
            else f"{loaded.name} at {found.address}, a step each {loaded.sample_time * 1e3:g} ms; end with Ctrl-C"
        )
        _wait(duration, found)
    if place == "sil":
        _tell_end(found, as_json)


def _tell_end(found: Served, as_json: bool) -> None:
    click.echo(
        json.dumps({"steps": found.steps, "late": found.late})
        if as_json
        else f"{found.steps} steps, {found.late} of them more than a period late"
    )


def _wait(duration: float | None, found: Served, interval: float = 5.0) -> None:
    """Until the end; late steps are shown as they come, a line each `interval` [s] at most."""
    end = time.monotonic() + duration if duration is not None else math.inf
    told = 0
    try:
        while (left := end - time.monotonic()) > 0:
            time.sleep(min(left, interval))
            if found.late > told:
                told = found.late
                note(f"{found.late} of {found.steps} steps so far came more than a period late: {_WHY[found.first]}")
    except KeyboardInterrupt:
        click.echo("", err=True)
