# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From recordings to a named, measured improvement."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from ..errors import RecordingError
from ..recordings.measured import Measured, with_shared_rails
from . import verdict
from .advice import advised
from .checks import channels as mix_ups, differing, dropouts, final, plausible
from .checks.broken import broken_sensors, still_broken
from .checks.case import Case, End
from .evidence.bench import with_tolerances
from .result import Cause, Diagnosis, Recorded
from .search.worth import WORTH
from .study.driven import settled
from .study.fit import Fit
from .study.input_noise import with_noise_of_inputs
from .study.noise import Experiment
from .study.study import Study, begin, guessed

SEARCH = 0.15, 0.8  # where in the whole work the search begins and ends, about
AGAIN = 3  # times that bursts are looked for in what is left without them


def diagnose(
    model: Model,
    train: Sequence[Measured],
    holdout: Sequence[Measured] = (),
    output: Path | None = None,
    set_name: str = "default",
    log: Callable[[str], None] = lambda text: None,
    tell: Callable[[float, str], None] = lambda share, doing: None,
    channels: Sequence[str] = (),
) -> Diagnosis:
    """Name what the model gets wrong in `train`, and measure on `holdout` what knowing it gains; with `output`, write the model file with
    it there. `log` gets what is tried, `tell` which share of the work is done and what comes next; `channels`: what the recordings' files
    call signals, as `load` was given it."""
    started = time.perf_counter()
    log = advancing(log, tell)
    tell(0.0, "fitting the model as it is")
    both = with_shared_rails([*train, *holdout])
    train, holdout = both[: len(train)], both[len(train) :]
    nominal, noisy = with_noise_of_inputs(model, train, set_name)
    experiments, unused, remarks = settled(with_tolerances(nominal), train, holdout, set_name)
    mixes = mix_ups.mixed(with_tolerances(nominal), experiments, set_name)
    with nullcontext(output) if output else tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as aside:
        model = mix_ups.mending(nominal, mixes, Path(aside)) if mixes else nominal
        if problems := plausible.misfits(with_tolerances(model), [*experiments, *unused], set_name):
            raise RecordingError(*problems)
        case = Case(model, nominal, train, holdout, unused, [*noisy, *remarks], Path(folder), log, tell, channels)
        study, bursts = unburst(with_tolerances(model), experiments, set_name)
        searched = cache(lambda: _searched(case, study, bursts))
        end = differing.different(case, study, searched) or searched()
        answer = final.checked(case, end, mixes)
    return advised(replace(answer, data=_recorded(train, holdout), seconds=time.perf_counter() - started), nominal)


def _searched(case: Case, study: Study, bursts: list[NDArray[np.bool_]]) -> End:
    """The end of the search, with sensors that clip or drop out by their samples; where no motion is about right, these show no faults."""
    faults = broken_sensors(study.model, case.train, study, study.null.simulated, bursts)
    case.tell(SEARCH[0], "looking for causes")
    found = verdict.searched(case, study)
    free = not study.model.inputs and found.found.bench.level.size > 0.0
    wrong = bool(guessed(study.model)) or free or found.found.level > WORTH

    def broken(fit: Fit) -> Sequence[Cause]:
        return () if wrong else still_broken(case.train, study, fit, faults, bursts)

    return verdict.conclude(case, study, found, broken)


def _recorded(train: Sequence[Measured], holdout: Sequence[Measured]) -> tuple[Recorded, ...]:
    """All recordings, each with its role."""
    return tuple(Recorded.of(m, role) for role, ms in (("training", train), ("hold-out", holdout)) for m in ms)


def unburst(model: Model, experiments: Sequence[Experiment], set_name: str) -> tuple[Study, list[NDArray[np.bool_]]]:
    """The study without bursts of samples that are far out, and these bursts: a fit that they have misled does not show all of them."""
    study = begin(model, experiments, set_name)
    bursts = more = dropouts.bursts(study.experiments, study.null.simulated)
    for _ in range(AGAIN):
        if not any(b.any() for b in more):
            break
        study = begin(model, [replace(e, good=e.good & ~b) for e, b in zip(study.experiments, more, strict=True)], set_name)
        more = dropouts.bursts(study.experiments, study.null.simulated)
        bursts = [b | m for b, m in zip(bursts, more, strict=True)]
    return study, bursts


def advancing(log: Callable[[str], None], tell: Callable[[float, str], None]) -> Callable[[str], None]:
    """A log of the search that reports progress too. How many fits are to come is not known: each takes a share of the rest."""
    done = SEARCH[0]

    def both(text: str) -> None:
        nonlocal done
        done += 0.12 * (SEARCH[1] - done)
        tell(done, "looking for causes")
        log(text)

    return both
