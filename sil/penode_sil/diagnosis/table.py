# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The table over many diagnoses: on the terminal, as diagnoses.csv and diagnoses.json, and as a page of links."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import jinja2

from penode_gen.resources import resource

from ..output import whole

JSON = "diagnoses.json"
KEPT = (
    "verdict",
    "causes",
    "gain",
    "numerics",
    "explained",
    "evidence",
    "explanations",
    "advice",
    "notes",
    "seconds",
)  # of each diagnosis.json


@dataclass(frozen=True)
class Row:
    """One recording and KEPT of its diagnosis, or the line that says why there is none.

    `folder` is where its files are, from that of the table; `source` names what it was made from.
    """

    recording: str
    folder: str
    source: str
    diagnosis: dict[str, Any] | None
    error: str = ""

    @property
    def verdict(self) -> str:
        return self.diagnosis["verdict"] if self.diagnosis else "failed"

    @property
    def causes(self) -> list[dict[str, Any]]:
        return self.diagnosis["causes"] if self.diagnosis else []


def read(folder: Path) -> list[Row]:
    """The rows with a diagnosis of an earlier table in a folder; none if there is no sound one."""
    try:
        rows = [Row(**row) for row in json.loads((folder / JSON).read_text(encoding="utf-8"))["recordings"]]
    except (OSError, ValueError, TypeError, KeyError):
        return []
    return [row for row in rows if row.diagnosis and (folder / row.folder / "diagnosis.json").exists()]


def write(folder: Path, model: str, rows: Sequence[Row]) -> None:
    """All files of the table."""
    folder.mkdir(exist_ok=True)
    with whole(folder / JSON) as part:
        part.write_text(as_json(model, rows) + "\n", encoding="utf-8")
    with whole(folder / "diagnoses.csv") as part, open(part, "w", encoding="utf-8", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows(_cells(rows))
    with whole(folder / "index.html") as part:
        part.write_text(_page(folder, model, rows), encoding="utf-8")


def as_json(model: str, rows: Sequence[Row], more: Mapping[str, Any] | None = None) -> str:
    """What diagnoses.json holds, and `more`."""
    return json.dumps({"model": model, "recordings": [asdict(row) for row in rows], **(more or {})}, indent=2)


def sentences(model: str, rows: Sequence[Row], folder: Path) -> str:
    """The table for people: a line for each cause, and what was found how often."""
    lines = [("recording", "verdict", "cause", "where", "parameters", "gain", "time")]
    for row in rows:
        head = (Path(row.recording).name, row.verdict.replace("_", " "))
        seconds = f"{row.diagnosis['seconds']:.0f} s" if row.diagnosis else ""
        for k, cause in enumerate(row.causes or (None,)):
            named = (cause["kind"], cause["where"], _parameters(cause)) if cause else ("", "", "")
            lines.append((*(head if k == 0 else ("", "")), *named, *((_gain(row), seconds) if k == 0 else ("", ""))))
    wide = [max(map(len, column)) for column in zip(*lines, strict=True)]
    text = ["  ".join(cell.ljust(w) for cell, w in zip(line, wide, strict=True) if w).rstrip() for line in lines]
    return "\n".join([*text, "", f"{model}: {summary(rows)} -> {folder / 'index.html'}"])


def summary(rows: Sequence[Row]) -> str:
    """How often what was found."""
    named = [[f"{c['kind']} at {c['where']}".removesuffix(" at ") for c in row.causes] for row in rows]
    found = Counter(" + ".join(names) or row.verdict for names, row in zip(named, rows, strict=True))
    counts = ", ".join(f"{n} {what.replace('_', ' ')}" for what, n in found.most_common())
    return f"{len(rows)} recording{'s' * (len(rows) != 1)}: {counts}"


def _parameters(cause: dict[str, Any]) -> str:
    """force = 60.1 N [58.2, 62]"""
    return ", ".join(
        f"{name} = {v['value']:.4g} {v['unit']} [{v['ci95'][0]:.4g}, {v['ci95'][1]:.4g}]".replace(" 1 [", " [")
        for name, v in cause["parameters"].items()
    )


def _gain(row: Row) -> str:
    """a_body 0.31 -> 0.021 m/s^2: RMS errors on held-out data."""
    gain = row.diagnosis["gain"] if row.diagnosis else {}
    return ", ".join(f"{name} {g['before_rmse']:.3g} -> {g['after_rmse']:.3g} {g['unit']}" for name, g in gain.items())


def _cells(rows: Sequence[Row]) -> Iterator[list[Any]]:
    """diagnoses.csv: a line for each cause, or one for a recording without."""
    signals = {name: g["unit"] for row in rows if row.diagnosis for name, g in row.diagnosis["gain"].items()}
    what = ("before_rmse", "after_rmse", "noise_floor")
    gains = [f"{name} {key.replace('_', ' ')} [{unit}]" for name, unit in signals.items() for key in what]
    yield ["recording", "verdict", "cause", "where", "confidence", "parameters", *gains, "time [s]", "error"]
    for row in rows:
        gain = row.diagnosis["gain"] if row.diagnosis else {}
        tail = [gain[name][key] if name in gain else "" for name in signals for key in what]
        tail += [round(row.diagnosis["seconds"], 1) if row.diagnosis else "", row.error]
        for c in row.causes or (None,):
            named = [c["kind"], c["where"], round(c["confidence"], 3), _parameters(c)] if c else [""] * 4
            yield [row.recording, row.verdict, *named, *tail]


def _page(folder: Path, model: str, rows: Sequence[Row]) -> str:
    """index.html: the same with links."""
    text = resource("penode_sil.diagnosis", "templates", "diagnoses.html").read_text(encoding="utf-8")
    template = jinja2.Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(text)
    links = {row.folder: (folder / row.folder / "report.html").exists() for row in rows}
    context = {"summary": summary(rows), "links": links, "parameters": _parameters, "gain": _gain}
    return template.render(model=model, rows=rows, **context)
