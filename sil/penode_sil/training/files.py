# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""One training from files to files: networks, the model file with them, the parameter set, JSON and report; all or none."""

from __future__ import annotations

import json
import os
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import penode_gen
from penode_gen import units
from penode_gen.model import Model

from ..compared import REJECTED, rejected
from ..diagnosis.files import all_or_none
from ..errors import RecordingError, WrongUse
from ..output import whole
from ..recordings.excerpt import excerpted
from ..recordings.measured import Measured, load
from . import begin, onnx_file, report, resume, threads
from .engine import compiler
from .final import checked
from .result import TRAINED, Trained
from .settings import SETTINGS
from .story import Options, check, train, versions


@dataclass(frozen=True)
class Job:
    """What is trained, and the folder where the answer goes. `known` are texts like `m_b` or `m_b=351 kg`."""

    model: Path
    data: tuple[Path, ...]
    holdout: tuple[Path, ...]
    output: Path
    channels: tuple[str, ...] = ()
    known: tuple[str, ...] = ()
    seed: int = 0
    start: tuple[Path, ...] = ()
    resume: bool = False  # from the checkpoint in the folder, if there is one


def run(job: Job, tell: Callable[[float, str], None] = lambda share, doing: None) -> Trained:
    """Train and write into the job's folder. UserError for bad input."""
    model = penode_gen.load(job.model)
    check(model)
    known, start = tuple(_known(text, model) for text in job.known), begin.read(job.start, model)
    measured, held = load(job.data, model, job.channels), load(job.holdout, model, job.channels)
    _check_kept([*measured, *held])
    measured, held = excerpted(measured, held)
    with resume.journal(job.output, _identity(job, model, start), job.resume) as journal:
        with threads.one():
            _, found = train(model, measured, held, Options(known, job.seed, start, journal), tell)
        with all_or_none(job.output):
            job.output.mkdir(exist_ok=True)
            return _write(job, model, found, measured, held)


def _check_kept(measured: Sequence[Measured]) -> None:
    """UserError if less than half of a recording can be used: what is learnt from the rest is no answer to the recording."""
    kept: dict[Path, int] = {}
    for m in measured:
        kept[m.path] = kept.get(m.path, 0) + len(m.time)
    problems = [
        f"{m.path}: {m.whole - kept[m.path]} of its {m.whole} samples lie in or beside gaps of the inputs, more than half; record them "
        "without gaps, or cut the recording to where they were measured"
        for m in {m.path: m for m in measured}.values()
        if m.whole - kept[m.path] > kept[m.path]
    ]
    if problems:
        raise RecordingError(*problems)


def _identity(job: Job, model: Model, start: begin.Start) -> dict[str, str]:
    """All that the bits of a training follow from, in the words of its call."""
    return resume.identity(
        {
            "model file": model.digest,
            "--data": job.data,
            "--holdout": job.holdout,
            "--channel": job.channels,
            "--known": job.known,
            "--seed": job.seed,
            "--from": start,
            "versions of programs": (versions(), compiler(), SETTINGS),
        }
    )


def _known(text: str, model: Model) -> tuple[str, float | None]:
    """A parameter, and its value in SI if one is given."""
    name, equals, value = (part.strip() for part in text.partition("="))
    if not equals:
        return name, None
    if name not in model.parameters:
        raise WrongUse(f"--known {name}: the model has no such parameter; it has {', '.join(model.parameters)}")
    unit = model.parameters[name].unit
    try:
        number, given = units.quantity(value)
    except units.UnitError as exc:
        raise WrongUse(f"--known {text}: {exc}; write --known {name}='{model.parameters[name].value:g} {unit}'") from exc
    if units.dimension(given) != units.dimension(unit):
        raise WrongUse(f"--known {text}: {name} is measured in {unit}; write --known {name}='{model.parameters[name].value:g} {unit}'")
    return name, number


def _write(job: Job, model: Model, found: Trained, measured: Sequence[Measured], held: Sequence[Measured]) -> Trained:
    """All files, and the training with the figures of the written model; no set for a model that predicts worse than the nominal one."""
    facts = {
        "penode.seed": str(found.seed),
        "penode.chi2": "" if found.chi2 is None else f"{found.chi2:.6g}",
        "penode.converged": str(found.converged).lower(),
        "penode.versions": json.dumps(found.versions),
        "penode.recordings": json.dumps(found.digests),
        "penode.holdout": json.dumps({e.signal: {"before": e.before, "after": e.after, "noise": e.noise} for e in found.holdout}),
        "penode.not_identifiable": json.dumps([u.text for u in found.unknown]),
    }
    for force in found.forces:
        own = facts | {
            "penode.band": json.dumps(
                [
                    {"x": x[::4].tolist(), "sigma1": s[::4].tolist(), "sigma2": (2.0 * s[::4]).tolist()}
                    for x, s in zip(force.x, force.sigma, strict=True)
                ]
            ),
            "penode.visited": json.dumps(
                [{"edges": e.tolist(), "counts": c.tolist()} for e, c in zip(force.edges, force.counts, strict=True)]
            ),
        }
        text = (
            f"{force.name} of {found.model}; inputs in {', '.join(force.units)}, output in {force.output}; trained by penode "
            f"{found.versions['penode']}"
        )
        onnx_file.write(job.output / f"{force.name}.onnx", onnx_file.model(force.network, force.name, text, own))
    text = _model_file(job, model, found)
    for name in (TRAINED, REJECTED, f"{model.name}.set"):  # of a training before
        (job.output / name).unlink(missing_ok=True)
    with whole(job.output / TRAINED) as part:
        part.write_text(text, encoding="utf-8")
    reread = penode_gen.load(job.output / TRAINED)
    final = checked(model, reread, measured, held, job.channels)
    found = replace(found, figures=final.figures, simulated=final.simulated, notes=(*found.notes, *final.notes))
    if final.worse:
        (job.output / TRAINED).unlink()
        with whole(job.output / REJECTED) as part:
            part.write_text(rejected(text, TRAINED), encoding="utf-8")
        note = f"{REJECTED} predicts {', '.join(final.worse)} worse than the nominal model: keep that one"
        found = replace(found, model_file=REJECTED, notes=(note, *found.notes))
    else:
        with whole(job.output / f"{model.name}.set") as part:
            part.write_bytes(penode_gen.serial(reread, "default"))
    with whole(job.output / "training.json") as part:
        part.write_text(json.dumps(found.as_json(), indent=2) + "\n", encoding="utf-8")
    report.write(job.output / "report.html", found)
    return found


def _model_file(job: Job, model: Model, found: Trained) -> str:
    """A model file that extends the one that was trained: its set `default` is the trained one, `before` what it was."""
    way = Path(os.path.relpath(model.path.resolve(), job.output.resolve())).as_posix()
    lines = [
        f"# {model.name} with networks trained by penode {found.versions['penode']}; report.html says on what and how well.",
        "",
        "[model]",
        f'extends = "{way}"',
        "",
    ]
    if found.parameters:
        lines.append("[parameters]")
        for name, (value, sigma, _, unit) in found.parameters.items():
            tolerance = min(max(2.0 * sigma / abs(value), 1e-6), 1.0)
            tunable = ", tunable = true" if model.parameters[name].tunable else ""
            lines.append(f'{name} = {{ value = {value:.9g}, unit = "{unit}", tolerance = {tolerance:.3g}{tunable} }}')
        lines.append("")
    lines.append("[sets.default]")
    tunable_set = model.sets["default"].parameters
    for name, (value, _, _, unit) in found.parameters.items():
        lines += [f'{name} = "{value:.9g} {unit}"'] if name in tunable_set else []
    lines += [f'{f.name} = "{f.name}.onnx"' for f in found.forces]
    before = _before(job, model)
    if before:
        lines += ["", "[sets.before]", *before]
    return "\n".join(lines) + "\n"


def _before(job: Job, model: Model) -> list[str]:
    """Entries of the set `default` of the model file, for use from the output folder; none where it inherits them."""
    entries: dict[str, Any] = tomllib.loads(model.path.read_text(encoding="utf-8")).get("sets", {})
    if "before" in entries or "default" not in entries:
        return []
    lines = []
    for name, entry in entries["default"].items():
        if name in model.networks:
            entry = {"file": entry} if isinstance(entry, str) else dict(entry)
            if "file" in entry:
                entry["file"] = Path(os.path.relpath((model.path.parent / entry["file"]).resolve(), job.output.resolve())).as_posix()
        text = (
            json.dumps(entry)
            if not isinstance(entry, dict)
            else "{ " + ", ".join(f"{k} = {json.dumps(v)}" for k, v in entry.items()) + " }"
        )
        lines.append(f"{name} = {text}")
    return lines
