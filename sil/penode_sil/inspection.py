# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The output of `penode inspect`: channels of a recording, their quality, and their signals in a model."""

from __future__ import annotations

import math
from dataclasses import asdict

from .recordings import look, named


def machine(found: look.Look) -> dict[str, object]:
    """All that was found, for programs; None where a number is not finite."""
    plain = asdict(found) | {"path": str(found.path), "options": found.options}
    return {key: _finite(value) for key, value in plain.items()}


def _finite(value: object) -> object:
    """The value, None where a number in it is not finite; tuples as lists."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def people(found: look.Look) -> list[str]:
    """Lines for people; nothing is cut off."""
    lines = [f"{found.path}: {found.form}"]
    for k, table in enumerate(found.tables, 1):
        clock = f"{table.rows} rows"
        if math.isfinite(table.interval):
            clock += f", {table.interval * 1e3:.6g} ms apart, from {table.start:.6g} s to {table.end:.6g} s"
            clock += f", {table.gaps or 'no'} gap{'s' * (table.gaps != 1)}"
        lines += ["", f"table {k} of {len(found.tables)}: {clock}" if len(found.tables) > 1 else clock]
        lines += [f"  note: {note}" for note in table.notes]
        lines += _aligned([("channel", "unit", "least", "largest", "quality"), *map(_row, table.channels)])
    if found.signals:
        lines += ["", f"signals of the model {found.model}"]
        lines += _aligned([(f"{s.kind} {s.name} [{s.unit or '1'}]", _verdict(s)) for s in found.signals])
    if found.options:
        lines += ["", "options to copy:", "  " + " ".join(found.options)]
    return lines


def _row(c: look.Channel) -> tuple[str, ...]:
    if c.text:
        return c.name, c.unit or "none", "", "", f"holds no numbers ({c.text.partition(': channel ')[0]})"
    counts = {"missing": c.missing, "held": c.held, "cut off": c.clipped, "spikes": c.spikes}
    parts = [f"{count} {what}" for what, count in counts.items() if count]
    parts += [f"steps of {c.quantum:.4g}"] if c.quantum else []
    parts += ["constant"] if c.constant else []
    hows = {"held": "repeated between samples", "lines": "joined by lines between samples", "sparse": "empty between samples"}
    parts += [f"{hows[c.how]} {1e3 * c.interval:.6g} ms apart"] if c.how else []
    low, high = (f"{value:.5g}" if math.isfinite(value) else "" for value in (c.low, c.high))
    return c.name, "none" if c.unit is None else c.unit or "1", low, high, ", ".join(parts) or "good"


def _verdict(s: look.Signal) -> str:
    if s.problem:
        return s.problem if not s.option or s.option in s.problem else f"{s.problem}; say {s.option} ({s.why})"
    if s.column is not None:
        return f"is {s.column}" if s.column != s.name else "found"
    if s.option:
        return f"not found; say {s.option} ({s.why})"
    return "not found; an output need not be recorded" if s.kind == "output" else f"not found; say {named.option(s.name, 'COLUMN [UNIT]')}"


def _aligned(rows: list[tuple[str, ...]]) -> list[str]:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]) - 1)]
    return [
        "  " + "  ".join([*(cell.ljust(width) for cell, width in zip(row[:-1], widths, strict=True)), row[-1]]).rstrip() for row in rows
    ]
