# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The input of a diagnosis, and the end of a search for causes, for the checks of its answer."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from penode_gen.model import Model

from ...recordings.measured import Measured
from ..result import Cause, Diagnosis
from ..study.fit import Fit
from ..study.noise import Experiment
from ..study.residual import Channel
from ..study.study import Study


@dataclass(frozen=True, eq=False)
class Case:
    """What is diagnosed: the `model` as its file has it, or mended for channels that are mixed up, and the `nominal` one; recordings for
    training and hold-out, these as experiments (`unused`), notes on them, where files go; `log` gets what is tried, `tell` which share of
    the work is done. `channels`: what files call signals."""

    model: Model
    nominal: Model
    train: Sequence[Measured]
    holdout: Sequence[Measured]
    unused: Sequence[Experiment]
    remarks: Sequence[str]
    output: Path
    log: Callable[[str], None]
    tell: Callable[[float, str], None]
    channels: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class End:
    """Where a search has ended: its `answer`, without pictures; the study, with the noise that it found; the `extended` model as its file
    in the case's folder has it; `fit`: the training with the named causes, None without any; `held`: the hold-out sample by sample;
    `withheld`: causes that the extended model has, and that are too small to be named; `without`: the end of the same search without
    laws or offsets, by kind and place, and with the rest fitted again; `sets`: parameter sets of the extended model by names of recordings,
    where these have their own; `faults`: causes that samples of sensors show, whatever else is wrong."""

    answer: Diagnosis
    study: Study
    extended: Model
    fit: Fit | None
    held: Sequence[Channel]
    withheld: Sequence[Cause] = ()
    without: Callable[[Collection[tuple[str, str]]], End] | None = None
    sets: Mapping[str, str] = field(default_factory=dict)
    faults: Sequence[Cause] = ()
