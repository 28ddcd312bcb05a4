# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""From recordings to a named, measured improvement."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from ..errors import RecordingError
from ..recordings.measured import Measured, with_shared_rails
from . import dropouts, plausible, search, weighed
from .advice import advised
from .answers import by_innovations, recorded
from .broken import broken_sensors, still_broken
from .by_noise import SEARCH, by_noise, judge_explanations
from .checks import channels as mix_ups, differing, final
from .checks.case import Case, End
from .driven import settled
from .evidence.bench import with_tolerances
from .explanation import Explanation
from .input_noise import with_noise_of_inputs
from .judging import ENOUGH, share
from .noise import Experiment
from .resting import resting
from .result import Diagnosis
from .study import Study, begin, guessed
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
    return advised(replace(answer, data=recorded(train, holdout), seconds=time.perf_counter() - started), nominal)


def _searched(case: Case, study: Study, other: Study, bursts: list[NDArray[np.bool_]]) -> End:
    """The end of the search that decides. Innovations answer where the file only guesses a parameter, where the model misses a free motion,
    or where `_decides`. If the best single cause leaves an unmodelled force above UNMODELLED, they are asked first, and answer at once if
    they explain the recordings and leave little; else the search by sensor noise goes on as long as it gets below UNMODELLED. If that
    search explains nothing, innovations answer where they explain the recordings, or have causes and leave more than UNMODELLED. If they
    were not asked before, they answer where they follow the recordings better, name the same, or find an input at fault; where neither has
    a name, parameters that predict the hold-out better stay."""
    unknown = weighed.supports(study.model) and bool(guessed(study.model))
    if unknown or (not study.model.inputs and weighed.misfit(study, study.null, case.log).size):
        return by_innovations(case, _weighed(case, study), None, lambda fit: ())  # without a motion that is about right, samples show none
    faults = broken_sensors(study.model, case.train, study, study.null.simulated, bursts)
    broken = partial(still_broken, case.train, study, faults=faults, bursts=bursts)
    case.tell(SEARCH[0], "looking for causes")
    study, beam = search.first(study, case.log)
    w = None
    if beam and weighed.misfit(study, beam[0].fit, case.log).size > weighed.UNMODELLED:
        w = _weighed(case, study)
        if w.verdict == "explained" and weighed.UNMODELLED < w.level < 2.0 * WORTH:
            return by_innovations(case, w, beam[0], broken)

    def hopeless(study: Study, e: Explanation) -> bool:
        return w is not None and weighed.misfit(study, e.fit, case.log).size > weighed.UNMODELLED

    study, explanations = search.grow(study, beam, case.log, hopeless=hopeless)
    if not explanations or not hopeless(study, explanations[0]):
        study, explanations = resting(other, study, explanations, case.log)
    beside = weighed.misfit(study, explanations[0].fit if explanations else study.null, case.log)
    best = explanations[0] if explanations else None
    if beside.size:
        w = w or _weighed(case, study)
        if _decides(w, beside, study, best, bool(faults)):
            return by_innovations(case, w, best, broken)
    study, judged = judge_explanations(case, study, explanations, faults, bursts)
    sure = w if w and (w.verdict == "explained" or (w.causes and w.level > weighed.UNMODELLED)) else None
    if sure and judged.verdict == "unexplained":  # before an extended model is made that nobody would see
        return by_innovations(case, sure, best, broken)
    end = by_noise(case, study, best, judged)
    answer = end.answer
    if answer.verdict in ("unexplained", "partly_explained") and w is None and weighed.supports(study.model):
        w = _weighed(case, study)
        same = {(c.kind, c.where) for c in w.causes} == set(best.groups if best else ()) != set()
        if (same or w.follows_better(beside) or w.of_inputs) and not w.worsens():
            return by_innovations(case, w, best, broken)
        if answer.verdict == "unexplained" and not answer.explained and w.mends():  # nothing has a name, but parameters are nearer
            return by_innovations(case, replace(w, verdict="unexplained", causes=(), explanations=(), explained=0.0), best, broken)
        return end
    if w is None and weighed.supports(study.model):
        return replace(end, other=lambda: by_innovations(case, _weighed(case, study), best, broken))
    return by_innovations(case, sure, best, broken) if sure and answer.verdict == "unexplained" else end


def _decides(w: weighed.Weighed, beside: weighed.Misfit, study: Study, best: Explanation | None, faulty: bool) -> bool:
    """Do innovations decide, where the `best` explanation leaves the misfit `beside`? Not where they explain only a part, unless `best`
    explains enough: it may still be taken. Nor where a sensor is `faulty` and neither search has a cause: they would judge samples that are
    no measurements. Where the unmodelled force is small, they decide only if they leave less of it and follow better, or with fewer causes,
    or as many with fewer laws: many laws together fit any single swing."""
    if w.verdict == "partly_explained" and not (best and share(study, best) > ENOUGH):
        return False
    if w.verdict == "unexplained":
        return beside.size > weighed.UNMODELLED and (best is not None or not faulty)
    closer = w.level < beside.size and w.follows_better(beside)
    return beside.size > weighed.UNMODELLED or closer or (best is not None and _simpler(w, best))


def _simpler(w: weighed.Weighed, best: Explanation) -> bool:
    """Do innovations explain the same by fewer causes, or by as many and fewer laws?"""
    causes = max(len(w.causes), 1)
    return causes < len(best.groups) or (bool(w.causes) and causes == len(best.groups) and w.laws < len(best.terms))


def _weighed(case: Case, study: Study) -> weighed.Weighed:
    case.tell(0.3, "searching with an observer that follows unmodelled forces")
    return weighed.weigh(replace(study, model=case.model), case.unused, case.log)


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
