# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""One diagnosis from files to files."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import penode_gen

from ..errors import WrongUse, hint
from ..recordings.excerpt import excerpted
from ..recordings.measured import load
from . import report
from .engine import diagnose
from .extend import monitored
from .result import Diagnosis
from .study.still import with_noise_at_rest


@dataclass(frozen=True)
class Job:
    """What is diagnosed, and the folder where the answer goes. `channels` are texts like `x=pos_mm`; `still`: recordings at standstill."""

    model: Path
    data: tuple[Path, ...]
    holdout: tuple[Path, ...]
    output: Path
    set_name: str = "default"
    channels: tuple[str, ...] = ()
    still: tuple[Path, ...] = ()


def load_model(job: Job) -> penode_gen.Model:
    """The model of a job, which has the set that is asked for; UserError or ModelError if not."""
    model = penode_gen.load(job.model)
    if job.set_name not in model.sets and model.networks:
        raise WrongUse(f'--set: the model has no set "{job.set_name}"; {hint(job.set_name, model.sets)}')
    return model


def run(
    job: Job, log: Callable[[str], None] = lambda text: None, tell: Callable[[float, str], None] = lambda share, doing: None
) -> tuple[penode_gen.Model, Diagnosis]:
    """Diagnose and write diagnosis.json, the model file with what was learnt and report.html; all or none. UserError for bad input."""
    compiled = compilers()
    model = load_model(job)
    train, held = excerpted(load(job.data, model, job.channels), load(job.holdout, model, job.channels))
    model = with_noise_at_rest(model, job.still, job.channels, train)
    with all_or_none(job.output):
        found = diagnose(model, train, held, job.output, job.set_name, log, tell, job.channels)
        note = monitored.write(job.output, model, found.model_file)
        found = replace(found, notes=(*found.notes, *[note] * bool(note)))
        report.write(job.output / "report.html", model, found, job.output / found.model_file)
        found = replace(found, compile_seconds=compilers() - compiled)
        (job.output / "diagnosis.json").write_text(json.dumps(found.as_json(), indent=2) + "\n", encoding="utf-8")
    return model, found


def compilers() -> float:
    """Processor time [s] of all programs that this one has run so far: compilers."""
    used = os.times()
    return used.children_user + used.children_system


def check_folder(folder: Path) -> None:
    """UserError now rather than after long work, if results cannot go into `folder`."""
    if folder.exists() and not folder.is_dir():
        raise WrongUse(f"{folder}: this is a file; name a directory")
    if not folder.exists() and not folder.absolute().parent.is_dir():
        raise WrongUse(f"{folder}: there is no directory {folder.parent}; create it")


@contextmanager
def all_or_none(folder: Path) -> Iterator[None]:
    """What is written into `folder` meanwhile goes away again on an error, the folder too if it is new."""
    old = set(folder.iterdir()) if folder.exists() else None
    try:
        yield
    except BaseException:
        for path in set(folder.iterdir()) - (old or set()) if folder.exists() else ():
            path.unlink()
        if old is None and folder.exists():
            folder.rmdir()
        raise
