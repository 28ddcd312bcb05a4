# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""`penode tune-filter`: noises of a filter from recordings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ..console import FILE, Several


@click.command(name="tune-filter", cls=Several)
@click.argument("model", type=FILE)
@click.option("--data", "records", type=FILE, multiple=True, required=True, help="Recordings (CSV with units, or MDF) to fit to.")
@click.option("--holdout", type=FILE, multiple=True, help="Recordings to look at before and after; never fitted.")
@click.option("-o", "--output", type=FILE, required=True, help="Model file to write; it extends MODEL.")
@click.option("--sensors", is_flag=True, help="Fit the noises of the sensors as well.")
@click.option("--set", "set_name", help="Parameter set.")
@click.option("--channel", multiple=True, help="What the recording calls a signal: a_body=acc, or a_body=Beschl [g].")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def tune_filter(model: Path, **given: Any) -> None:
    """Fit the noises in [filter] of the model file MODEL to recordings, by the likelihood of the innovations."""
    from ..filtering.tune_command import tune

    tune(model, **given)
