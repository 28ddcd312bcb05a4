# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The end of the search by innovations: a verdict on what it found, the extended model file, and what that gains."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from . import applied, explanation, leftover, measuring, numerics, plausible, real, tones
from .catalogue import drives, values as of_values
from .checks.case import Case, End
from .checks.written import write_extended
from .evidence.bench import UNSTATED
from .fit import Fit
from .judging import ENOUGH
from .resolving import resolved
from .result import UNKNOWN, Cause, Diagnosis, Named
from .study import Study, fitted, guessed, look
from .unmodelled import within

Array = NDArray[np.float64]
Broken = Callable[[Fit], Sequence[Cause]]


def supports(model: Model) -> bool:
    """Can innovations judge a model? Not yet where motion is prescribed, for nothing moves, nor laws of networks."""
    return bool(model.bodies or (model.states and not model.elements)) and not model.networks


def searched(case: Case, study: Study) -> real.Answer:
    """What the search by innovations finds."""
    case.tell(0.3, "searching with an observer that follows unmodelled forces")
    return real.answer(case.model, study.places, study.experiments, study.linear.fastest, study.set_name, case.log, study.levels)


def conclude(case: Case, study: Study, found: real.Answer, broken: Broken) -> End:
    """The end of a search by innovations; without pictures, recordings and time. `broken`: sensors at fault beside a fit."""
    study = replace(study, model=case.model)
    study = replace(study, seen=look(study, study.null))
    model, bench = study.model, found.found.bench
    made = applied.apply(model, bench, found.run, found.terms, found.offsets)
    text, extended = resolved(study, made.text)
    measured = _measured(study, bench.noise)
    gain, more, held = measuring.measure(measured, extended, case.unused) if case.unused else ({}, [], [])
    after = tuple(measuring.started(extended, e, study)[1] for e in study.experiments)
    fit = replace(study.null, simulated=after)
    causes, notes = _plausible(model, found.causes)
    known = replace(
        found.run, free=tuple(f for f in found.run.free if f.target in guessed(model))
    )  # the others may compensate for laws that were added
    numbers, coarse = numerics.numerics(replace(measured, model=fitted(model, known)))
    share = max(_taken(study, after), found.taken, 0.0)  # the first without what sensors and inputs are off by
    verdict = _verdict(found, causes, share, not causes and _quiet(study, after, bench.noise))
    if coarse and verdict != "unexplained":
        causes, verdict = (*causes, coarse), "explained" if verdict == "no_discrepancy" else verdict
    explanations = _explanations(causes, found.explanations)
    tone = tones.tone(study.experiments, study.metrics, after)
    notes += [*found.notes, *made.left, *more, *([tones.note(model, tone)] if tone.detected else [])]
    doubt = plausible.doubt(measured, None, verdict) if verdict == "unexplained" else ""
    verdict, causes = beside_faults(verdict, causes, broken(fit), tone.detected)
    rows = explanation.rows(study)
    answer = Diagnosis(
        verdict,
        causes,
        gain,
        numbers,
        share,
        (study.null.cost - rows) / np.sqrt(2.0 * rows),
        0.0,
        (*[doubt] * bool(doubt), *case.remarks, *notes),
        explanations=explanations,
    )
    written = write_extended(text, case)
    return End(answer, measured, written, fit, held, found.withheld, lambda gone: conclude(case, study, found.without(gone), broken))


def beside_faults(verdict: str, causes: tuple[Cause, ...], faults: Sequence[Cause], tone: bool) -> tuple[str, tuple[Cause, ...]]:
    """Verdict and causes with the `faults` of sensors that their samples show, whatever else is wrong; and with a `tone`, which no cause of
    the catalogue makes. Where nothing follows the recordings, what is far from the model is no fault of a sensor."""
    if verdict == "unexplained" or (tone and not causes):
        return "unexplained", causes or (UNKNOWN,)
    own = {(c.kind, c.where) for c in causes}
    causes = (*causes, *(f for f in faults if (f.kind, f.where) not in own))
    verdict = "explained" if causes and verdict == "no_discrepancy" else verdict
    return "partly_explained" if tone else verdict, causes


def _taken(study: Study, after: Sequence[Array]) -> float:
    """Share of the residual's power that a simulation takes away, each sensor in units of its noise."""
    scale = np.array([s.noise or 1.0 for s in study.model.sensors])
    powers = [
        sum(float(np.sum(((e.y - z) * e.good / scale) ** 2)) for e, z in zip(study.experiments, zs, strict=True))
        for zs in (study.null.simulated, after)
    ]
    return 1.0 - powers[1] / powers[0]


def _quiet(study: Study, after: Sequence[Array], noise: Array) -> bool:
    """Does a simulation leave nothing but noise, tones aside: what the file states of a sensor, or else that of its samples [n_z]?"""
    stated = np.array([s.noise for s in study.model.sensors])
    return within(study, after, np.where(stated > 0.0, stated, noise)) and not leftover.left_over(study, after)


def _measured(study: Study, noise: Array) -> Study:
    """The study with no more noise than samples have [n_z]: that of its null fit has in it what the model misses."""
    levels = tuple(np.tile(noise**2, (len(x), 1)) for x in study.levels)
    experiments = tuple(replace(e, quiet=np.full_like(e.quiet, np.nan)) for e in study.experiments)
    return replace(study, levels=levels, experiments=experiments)


def _explanations(causes: Sequence[Cause], sets: Sequence[tuple[tuple[Named, ...], float]]) -> tuple[dict[str, object], ...]:
    """Sets of causes with their posterior, each with all causes that are named beside those that the sets exchange."""
    first = sets[0][0] if sets else ()
    named = [Named(c.kind, c.where) for c in causes]
    always = [n for n in named if n not in first]
    if not named:
        return ()
    found = []
    for names, posterior in sets or [((), min(c.confidence for c in causes))]:
        whole = [*always, *(n for n in names if n in named or n not in first)]
        found.append({"causes": [{"kind": n.kind, "where": n.where} for n in whole], "posterior": posterior})
    return tuple(found)


def _verdict(found: real.Answer, causes: tuple[Cause, ...], share: float, quiet: bool) -> str:
    """From what is named, the share of the residual that it takes in a free run, and whether noise is all that is left (`quiet`)."""
    if causes:
        return "explained" if share > ENOUGH else "partly_explained"
    return "no_discrepancy" if not found.causes and quiet else "unexplained"


def _plausible(model: Model, causes: tuple[Cause, ...]) -> tuple[tuple[Cause, ...], list[str]]:
    """Causes, none where several parameters have left tolerances that the file states: that is another plant, and what else was found is
    of that; and a note on it. All by one factor, they are the gain of an input that the file does not have."""
    off = [c for c in causes if of_values.is_one(c) and model.parameters[c.where].tolerance <= 1.0]
    if len(off) < 2:
        return causes, []
    if gain := drives.common_gain(model, off, UNSTATED):
        names = ", ".join(c.where for c in off)
        return (gain, *(c for c in causes if c not in off)), [
            f"{names} changed by a common factor have the same effect; model_extended.toml has that form"
        ]
    stated = [c.where for c in off if model.parameters[c.where].tolerance > 0.0]
    if len(stated) < 2:
        return causes, []
    return (), [f"{', '.join(stated)} would all have to be outside of their tolerances: another plant, or dynamics that the model lacks"]
