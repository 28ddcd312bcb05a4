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
from . import dropouts, plausible, search, verdict
from .advice import advised
from .broken import broken_sensors, still_broken
from .by_noise import SEARCH, by_noise, judge_explanations
from .checks import channels as mix_ups, differing, final
from .checks.case import Case, End
from .driven import settled
from .evidence.bench import with_tolerances
from .input_noise import with_noise_of_inputs
from .noise import Experiment
from .resting import resting
from .result import Diagnosis, Recorded
from .study import Study, begin, guessed
from .unmodelled import UNMODELLED, unmodelled
from .worth import WORTH

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
        study, other, bursts = unburst(with_tolerances(model), experiments, set_name)
        end = differing.different(case, study) or _searched(case, study, other, bursts)
        answer = final.checked(case, end, mixes)
    return advised(replace(answer, data=_recorded(train, holdout), seconds=time.perf_counter() - started), nominal)


def _searched(case: Case, study: Study, other: Study, bursts: list[NDArray[np.bool_]]) -> End:
    """The end of the search in samples, beside sensor noise, if what it finds leaves no unmodelled force; else that of the search by
    innovations, which is also the answer where a rule of the final check withdraws all names. If the best single cause leaves a large
    unmodelled force, innovations are asked first, and answer if one remains beside all that they find; if not, samples are searched for as
    long as more causes leave less. Where neither explains what is left, and that is little, a network without a name may (by_noise)."""
    faults = broken_sensors(study.model, case.train, study, study.null.simulated, bursts)
    followed = verdict.supports(study.model)
    ask = cache(lambda: verdict.searched(case, study))

    def by_innovations(known: bool = True) -> End:
        return verdict.conclude(case, study, ask(), lambda fit: still_broken(case.train, study, fit, faults, bursts) if known else ())

    if followed and (guessed(study.model) or (not study.model.inputs and unmodelled(study, study.null, case.log) > 0.0)):
        return by_innovations(False)  # no motion is about right: samples show neither causes nor faults
    case.tell(SEARCH[0], "looking for causes")
    found, beam = search.first(study, case.log)
    wrong = followed and bool(beam) and unmodelled(found, beam[0].fit, case.log) > UNMODELLED
    if wrong:
        end = by_innovations()
        if end.answer.verdict == "explained" and UNMODELLED < ask().found.bench.level.size < 2.0 * WORTH:
            return end
    found, explanations = search.grow(
        found, beam, case.log, hopeless=lambda study, e: wrong and unmodelled(study, e.fit, case.log) > UNMODELLED
    )
    found, explanations = resting(other, found, explanations, case.log)
    best = explanations[0] if explanations else None
    beside = unmodelled(found, best.fit if best else found.null, case.log) if followed else 0.0
    if beside > 0.0 and ((end := by_innovations()).answer.verdict != "unexplained" or beside > UNMODELLED):
        return end
    found, judged = judge_explanations(case, found, explanations, faults, bursts)
    nothing = judged.verdict == "unexplained" and not (judged.doubt or judged.drift)  # of another plant, or of clocks, samples tell more
    if followed and not beside and nothing and (end := by_innovations()).answer.verdict != "unexplained":
        return end
    end = by_noise(case, found, best, judged)
    return replace(end, other=by_innovations) if followed and end.answer.verdict != "unexplained" else end


def _recorded(train: Sequence[Measured], holdout: Sequence[Measured]) -> tuple[Recorded, ...]:
    """All recordings, each with its role."""
    return tuple(Recorded.of(m, role) for role, ms in (("training", train), ("hold-out", holdout)) for m in ms)


def unburst(model: Model, experiments: Sequence[Experiment], set_name: str) -> tuple[Study, Study, list[NDArray[np.bool_]]]:
    """The two studies of `begin` without bursts of samples that are far out, and these bursts: a fit that they have misled does not show
    all of them."""
    study, other = begin(model, experiments, set_name)
    bursts = more = dropouts.bursts(study.experiments, study.null.simulated)
    for _ in range(AGAIN):
        if not any(b.any() for b in more):
            break
        study, other = begin(model, [replace(e, good=e.good & ~b) for e, b in zip(study.experiments, more, strict=True)], set_name)
        more = dropouts.bursts(study.experiments, study.null.simulated)
        bursts = [b | m for b, m in zip(bursts, more, strict=True)]
    return study, other, bursts


def advancing(log: Callable[[str], None], tell: Callable[[float, str], None]) -> Callable[[str], None]:
    """A log of the search that reports progress too. How many fits are to come is not known: each takes a share of the rest."""
    done = SEARCH[0]

    def both(text: str) -> None:
        nonlocal done
        done += 0.12 * (SEARCH[1] - done)
        tell(done, "looking for causes")
        log(text)

    return both
