# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What `penode tune-filter` does."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

import penode_gen
from penode_gen.model import Model

from ..console import progress
from ..errors import WrongUse, hint
from . import tuned_file
from .command import read
from .estimates import of
from .innovations import Consistency, OfSensor
from .tuning import Tuned, fit, free


def tune(
    model: Path,
    records: tuple[Path, ...],
    holdout: tuple[Path, ...],
    output: Path,
    sensors: bool,
    set_name: str | None,
    channel: tuple[str, ...],
    as_json: bool,
) -> None:
    """Fit, write the model file, print a table. Raises UserError."""
    if output.resolve() == model.resolve():
        raise WrongUse(f"--output: {output} is the model file itself; name another, which will extend it")
    loaded = penode_gen.load(model)
    tuned_file.check(loaded, free(of(loaded), sensors), output)
    if set_name is not None and set_name not in loaded.sets:
        raise WrongUse(f'--set: the model has no set "{set_name}"; {hint(set_name, loaded.sets)}')
    recordings, held_out = (read(paths, loaded, set_name, channel) for paths in (records, holdout))
    with progress(f"noises of {loaded.name}", 0) as tell:
        found = fit(loaded, set_name or next(iter(loaded.sets)), recordings, held_out, sensors, tell)
    output.parent.mkdir(parents=True, exist_ok=True)
    tuned_file.write(loaded, found.factors, output)
    click.echo(json.dumps(summary(loaded, found, records, holdout, output), indent=2) if as_json else sentences(loaded, found, output))


def summary(model: Model, found: Tuned, records: tuple[Path, ...], holdout: tuple[Path, ...], output: Path) -> dict[str, Any]:
    """For machines."""
    entry: dict[str, Any] = {
        "model": model.name,
        "recordings": [str(path) for path in records],
        "holdout": [str(path) for path in holdout],
        "output": str(output),
        "evaluations": found.evaluations,
        "noises": [
            {"table": key[0], "name": key[1], "key": kind, "unit": unit, "before": before, "after": after, "needed": key not in found.idle}
            for key, kind, unit, before, after in tuned_file.noises(model, found.factors)
        ],
        "before": found.before.as_json(),
        "after": found.after.as_json(),
    }
    if found.held_out:
        entry["held_out"] = dict(zip(("before", "after"), (c.as_json() for c in found.held_out), strict=True))
    return entry


def sentences(model: Model, found: Tuned, output: Path) -> str:
    """For people: noises, then what the innovations say."""
    lines = [f"{model.name}: noises of the filter -> {output}"]
    for key, kind, unit, before, after in tuned_file.noises(model, found.factors):
        end = "; these recordings do not need it" if key in found.idle else ""
        lines.append(f"  {key[0]}.{key[1]}.{kind}: {before:.4g} -> {after:.4g} {unit}{end}")
    lines += _table("recordings", found.before, found.after)
    lines += _table("held out", *found.held_out) if found.held_out else []
    return "\n".join(lines)


def _table(title: str, before: Consistency, after: Consistency) -> list[str]:
    rows = [f"  {title}, {before.measurements} measurements: log-likelihood {before.log_likelihood:.1f} -> {after.log_likelihood:.1f}"]
    for name in before.sensors:
        rows.append(f"    {name}: {_sensor(before.sensors[name])} -> {_sensor(after.sensors[name])}")
    return rows


def _sensor(found: OfSensor) -> str:
    if found.mean_ratio is None or found.band is None:
        return f"none used, {found.refused} refused"
    inside = "in" if found.band[0] <= found.mean_ratio <= found.band[1] else "outside of"
    lag = "" if found.lag_1 is None else f", lag-1 correlation {found.lag_1:.3f}"
    return f"mean NIS {found.mean_ratio:.3f} ({inside} {found.band[0]:.3f} to {found.band[1]:.3f}){lag}, {found.refused} refused"
