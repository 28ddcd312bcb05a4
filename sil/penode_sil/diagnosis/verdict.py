# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The end of the search: a verdict on what it found, the extended model file, and what that gains."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict, dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import Model

from .catalogue import others, values as of_values
from .checks import leftover, numerics, plausible, tones
from .checks.case import Case, End
from .checks.written import write_extended
from .extend import absorb, applied, measuring, nameless
from .extend.resolving import resolved
from .plant import plant
from .reliability import is_likely, trust, trusted
from .result import EXTENDED, UNKNOWN, Cause, Diagnosis, Gain, Named, place
from .search import naming
from .search.worth import WORTH
from .study import residual
from .study.fit import Fit
from .study.residual import Channel
from .study.study import Study, fitted, guessed, look

Array = NDArray[np.float64]
Broken = Callable[[Fit], Sequence[Cause]]
ENOUGH = 0.85  # share of the avoidable residual that named causes must take away to be an explanation at all


def searched(case: Case, study: Study) -> naming.Answer:
    """What the search finds."""
    case.tell(0.3, "searching with an observer that follows unmodelled forces")
    return naming.answer(case.model, study.places, study.experiments, study.linear.fastest, study.set_name, case.log, study.levels)


@dataclass(frozen=True, eq=False)
class Judged:
    """What a search amounts to: `verdict` and `causes`, the share that these explain, errors of the step by sensor, notes, sets of causes
    with their posterior; `doubt`: why the recordings may be of another plant; causes that are `unlikely` to be right."""

    verdict: str
    causes: tuple[Cause, ...]
    share: float
    numbers: dict[str, object]
    notes: tuple[str, ...]
    explanations: tuple[dict[str, object], ...]
    doubt: str = ""
    unlikely: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Written:
    """An extended model, its text, what it gains, with notes on that, and the hold-out sample by sample."""

    text: str
    extended: Model
    gain: dict[str, Gain]
    notes: Sequence[str]
    held: Sequence[Channel]

    @staticmethod
    def of(case: Case, study: Study, text: str, extended: Model, lost: Collection[str] = ()) -> Written:
        """`lost`: sensors that lost samples."""
        gain, notes, held = measuring.measure(study, extended, case.unused, lost=lost) if case.unused else ({}, [], [])
        return Written(text, extended, gain, notes, held)


def conclude(case: Case, study: Study, found: naming.Answer, broken: Broken) -> End:
    """The end of a search; without pictures, recordings and time. `broken`: sensors at fault beside a fit."""
    study = replace(study, model=case.model)
    study = replace(study, seen=look(study, study.null))
    made = applied.apply(study.model, found.found.bench, found.run, found.terms, found.offsets)
    text, extended = resolved(study, made.text)
    after = tuple(measuring.started(extended, e, study)[1] for e in study.experiments)
    fit = replace(study.null, simulated=after)
    noisy = not found.terms and _quiet(study, after, found.found.bench.noise)  # then the noise of the null fit is that of the sensors
    measured = study if noisy else _measured(study, _most(study, found.found.bench.noise))
    faults = tuple(broken(fit))
    judged = _judged(study, measured, found, after, faults)
    written, withheld = Written.of(case, measured, text, extended, others.lost(judged.causes)), found.withheld
    if judged.causes == (UNKNOWN,) and not judged.doubt and (unnamed := _unnamed(case, measured, found)):
        (written, share, note), withheld = unnamed, ()
        judged = replace(judged, share=share, notes=(*judged.notes, note))
    elif judged.causes == (UNKNOWN,) and not judged.doubt and not found.terms and _better(written):
        note = f"no cause is named; {EXTENDED} has the parameters that fit best within their tolerances: it predicts better"
        judged = replace(judged, notes=(*judged.notes, note))
    absorbed: dict[str, object] = {}
    extended = write_extended(written.text, case)
    if judged.verdict != "unexplained":
        absorbed, more = absorb.absorbed(case, measured, found.terms, found.run.values)
        judged = replace(judged, notes=(*judged.notes, *more))
    rows = leftover.rows(study)
    answer = Diagnosis(
        judged.verdict,
        judged.causes,
        written.gain,
        judged.numbers,
        judged.share,
        (study.null.cost - rows) / np.sqrt(2.0 * rows),
        0.0,
        (*[judged.doubt] * bool(judged.doubt), *case.remarks, *judged.notes, *made.left, *written.notes),
        absorbed=absorbed,
        explanations=judged.explanations,
        unlikely=judged.unlikely,
    )
    return End(
        answer,
        measured,
        extended,
        fit,
        written.held,
        withheld,
        lambda gone: conclude(case, study, found.without(gone), broken),
        faults=faults,
    )


def _judged(study: Study, measured: Study, found: naming.Answer, after: Sequence[Array], faults: Sequence[Cause]) -> Judged:
    """The judgement of a search that leads to a simulation `after`, beside `faults` of sensors."""
    model = study.model
    causes, notes = _plausible(model, found.causes)
    known = [f for f in found.run.free if f.target in guessed(model)]  # the others may compensate for laws that were added
    numbers, coarse = numerics.numerics(replace(measured, model=fitted(model, known)))
    share = max(_taken(study, after), found.taken, 0.0)  # the first without what sensors and inputs are off by
    ways = (after, study.null.simulated)  # the second with values within their tolerances, and weighed by noise of the inputs too
    quiet = [_quiet(study, x, found.found.bench.noise) for x in ways]
    share = 1.0 if causes and quiet[0] else share  # also where the nominal fit, within tolerances, leaves as little
    causes, unlikely, doubts = _likely(causes, share)
    verdict = _verdict(() if unlikely else found.causes, causes, share, any(quiet))
    doubt = plausible.doubt(measured, after) if verdict == "unexplained" or found.found.level > WORTH else ""
    if doubt:
        verdict, causes = "unexplained", ()
    if coarse and verdict != "unexplained":
        causes, verdict = (*causes, coarse), "explained" if verdict == "no_discrepancy" else verdict
    causes = tuple(trusted(c, share) for c in causes)
    likely = [(names, trust(share) * p) for names, p in found.explanations]
    sets, tone = _explanations(causes, likely), tones.tone(study.experiments, study.metrics, after)
    verdict, causes = beside_faults(verdict, causes, faults, tone.detected)
    notes += [*doubts, *found.notes, *filter(None, [plant.placeless(study.places)]), *([tones.note(model, tone)] if tone.detected else [])]
    return Judged(verdict, causes, share, numbers, tuple(notes), sets, doubt, unlikely)


def _likely(causes: tuple[Cause, ...], share: float) -> tuple[tuple[Cause, ...], dict[str, object], list[str]]:
    """Causes that take this share of the avoidable residual, where such answers are more often right than wrong; otherwise none, but what
    `unlikely` in diagnosis.json says of them, and a note: their laws stay in the extended model."""
    if not causes or is_likely(share):
        return causes, {}, []
    names = " and ".join(place(c.kind, c.where) for c in causes)
    note = f"{names} would explain {share:.0%} of the avoidable residual; such answers were wrong at least as often as right"
    return (), {"explained": share, "trust": trust(share), "causes": [asdict(trusted(c, share)) for c in causes]}, [note]


def _better(written: Written) -> bool:
    """Does a written model predict all sensors of the hold-out better than the nominal one?"""
    return bool(written.gain) and all(g.after_rmse < g.before_rmse for g in written.gain.values())


def _unnamed(case: Case, study: Study, found: naming.Answer) -> tuple[Written, float, str] | None:
    """The extended model with a network for what has no name, the share of the residual that it takes, and a note; None where it takes too
    little, or does not predict the hold-out better than the nominal model."""
    case.tell(0.83, "fitting what has no name")
    unnamed = nameless.fitted(study, found.found.bench, found.run, found.terms)
    if unnamed is None:
        return None
    terms = [*found.terms, unnamed.term]
    made = applied.apply(study.model, unnamed.bench, unnamed.run, terms, found.offsets)
    written = Written.of(case, study, *resolved(study, made.text))
    if any(g.after_rmse > 1.01 * g.before_rmse for g in written.gain.values()):
        return None
    return written, unnamed.share, f"a small network beside {unnamed.term.form.where} explains a part of it, without a name"


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
    """Does a simulation leave nothing but noise, tones aside: what the file states of a sensor, or else that of its samples [n_z], and
    noise of the inputs as it reaches the sensor?"""
    most = np.hypot(_most(study, noise), np.sqrt(residual.driven(study)))
    return leftover.within(study, after, most) and not leftover.left_over(study, after)


def _most(study: Study, noise: Array) -> Array:
    """Noise [n_z] of sensors: what the file states, or else that of samples, which show less of coloured noise."""
    stated = np.array([s.noise for s in study.model.sensors])
    return np.where(stated > 0.0, stated, noise)


def _measured(study: Study, noise: Array) -> Study:
    """The study with this noise [n_z] of its sensors: that of its null fit has in it what the model misses."""
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


def _verdict(tried: Sequence[Cause], causes: tuple[Cause, ...], share: float, quiet: bool) -> str:
    """From what was `tried` and what is named, the share of the residual that it takes in a free run, and whether noise is all that is left
    (`quiet`)."""
    if causes:
        return "explained" if share > ENOUGH else "partly_explained"
    return "no_discrepancy" if not tried and quiet else "unexplained"


def _plausible(model: Model, causes: tuple[Cause, ...]) -> tuple[tuple[Cause, ...], list[str]]:
    """Causes, without parameters where several have left tolerances that the file states: alone that is another plant, beside other causes
    these are not quite of their textbook form; and a note on it."""
    off = [c for c in causes if of_values.is_one(c) and model.parameters[c.where].tolerance <= 1.0]
    if len(off) < 2:
        return causes, []
    stated = [c.where for c in off if model.parameters[c.where].tolerance > 0.0]
    if len(stated) < 2:
        return causes, []
    if others_named := tuple(c for c in causes if c not in off):
        return others_named, [f"{', '.join(stated)} are out of tolerance: they make up for curves that are not quite those named"]
    return (), [f"{', '.join(stated)} would all have to be outside of their tolerances: another plant, or dynamics that the model lacks"]
