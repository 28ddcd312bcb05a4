# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The diagnosis of recordings in which sensor noise is what limits the fit: causes named by the search, weighed against numerics, tones
and changes with time, written into the extended model and measured on the hold-out."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import penode_gen

from . import (
    absorb,
    echo,
    explaining,
    extension,
    measuring,
    nameless,
    noise,
    numerics,
    plant,
    plausible,
    refining,
    residual,
    small,
    steady,
    straight,
    tones,
)
from .broken import still_broken
from .checks.case import Case, End
from .checks.written import write_extended
from .explanation import Explanation
from .hypotheses import CLOCK
from .judging import cause, damped, judge, pitching, resized, worth
from .noise import UNSEEN
from .result import MAY_BE_NOTHING, OUTSIDE, UNKNOWN, Cause, Diagnosis, Gain, Named, place
from .study import Study, look

CHANGING = 1e-9  # chance that noise makes as much of a change with time; 2e-6 where it is 1.4 times louder than its law says
FARTHER = 0.02  # share of samples outside of the training, above which a hold-out is no evidence for a name
SEARCH = 0.15, 0.8  # where in the whole work the search begins and ends, about


@dataclass(frozen=True, eq=False)
class Judged:
    """What explanations amount to. `named`: the explanation that goes into the extended model, None if nothing does; `unnamed`: the same
    where it is a network without a name; `faults`: of sensors, seen in the samples, not fitted; `doubt`: why all of it may be
    something else, empty if not."""

    causes: tuple[Cause, ...]
    verdict: str
    explained: float
    evidence: float
    alike: float
    doubt: str
    drift: float
    numbers: object
    notes: tuple[str, ...]
    faults: tuple[Cause, ...]
    named: Explanation | None = None
    unnamed: Explanation | None = None

    def nothing(self, note: str) -> Judged:
        """Unexplained after all, for what the note says."""
        return replace(self, causes=(UNKNOWN,), verdict="unexplained", explained=0.0, named=None, unnamed=None, notes=(*self.notes, note))


def judge_explanations(
    case: Case, study: Study, explanations: Sequence[Explanation], faults: list[Cause], bursts: Sequence[np.ndarray]
) -> tuple[Study, Judged]:
    """Judges explanations; returns the study with the smoothed motion of the best one, and the judgement."""
    best = explanations[0] if explanations else None
    if best is not None:  # bursts and spikes that a cause explains were none
        faults = still_broken(case.train, study, best.fit, faults, bursts)
    case.tell(SEARCH[1], "weighing them against numerics")
    study = replace(study, seen=look(study, best.fit if best else study.null))
    return study, _weighed(case, study, explanations, faults)


def by_noise(case: Case, study: Study, best: Explanation | None, judged: Judged) -> End:
    """The diagnosis with sizes, extended model and gain; without pictures, recordings and time."""
    judged = _sized(case, study, best, judged)
    study = replace(study, model=case.model)  # what the file does not state is not written down
    judged, text, gain, held = _measured(case, study, judged)
    extended = write_extended(text, case)
    absorbed: dict[str, object] = {}
    if learnt := absorb.taught(study, judged.named) if judged.named is not None and judged.named.terms else []:
        absorbed, more = absorbing(case, study, judged.named, learnt)
        judged = replace(judged, notes=(*judged.notes, *more))
    whole = judged.named is not None and (judged.named is judged.unnamed or (best is not None and bool(judged.causes)))
    answer = Diagnosis(
        judged.verdict,
        judged.causes,
        gain,
        judged.numbers,
        judged.explained,
        judged.evidence,
        judged.alike,
        tuple([judged.doubt] * bool(judged.doubt)) + judged.notes,
        absorbed=absorbed,
        explanations=_alternatives(judged.causes),
    )
    return End(answer, study, extended, judged.named.fit if whole else None, held)


def _alternatives(causes: Sequence[Cause]) -> tuple[dict[str, object], ...]:
    """Explanations as sets of causes: the one named, and it with one cause exchanged for an alternative."""
    own = [{"kind": c.kind, "where": c.where} for c in causes if c.kind != OUTSIDE]
    if not own:
        return ()
    sure = float(np.prod([c.confidence for c in causes]))
    sets = [{"causes": own, "posterior": sure}]
    for k, c in enumerate(causes):
        others = float(np.prod([x.confidence for x in causes if x is not c]))
        for a in c.alternatives:
            other = [*own[:k], {"kind": a.kind, "where": a.where}, *own[k + 1 :]]
            sets.append({"causes": other, "posterior": others * (1.0 - c.confidence) / len(c.alternatives)})
    return tuple(sets)


def _weighed(case: Case, study: Study, explanations: Sequence[Explanation], faults: list[Cause]) -> Judged:
    """Causes and verdict, against numerics, what sensors share, tones, and what changes with time."""
    best = explanations[0] if explanations else None
    left = best.fit if best else study.null
    numbers, step = numerics.numerics(study)
    alike, shared = noise.correlation(study.experiments, study.metrics, left.simulated)
    case.log(f"correlation {alike:.1f}, shared {shared:.0f}")
    tone = tones.tone(study.experiments, study.metrics, left.simulated)
    case.log(str(tone))
    change = steady.change(study, left, study.seen)
    case.log(str(change))
    fades = best is not None and any(kind == "damper_fading" for kind, _ in best.groups)  # which changes by its nature
    changed = change.gain if change.surprise > -np.log(CHANGING) and not fades else 0.0
    causes, verdict, explained, evidence = judge(study, explanations, faults, alike, shared, tone.detected, changed)
    doubt = plausible.doubt(study, best, verdict)
    behind = not doubt and verdict != "unexplained" and best is not None and pitching(best) and echo.echo(study, best.fit).detected
    if doubt or behind:
        causes, verdict = (UNKNOWN,), "unexplained"
    if step is not None and not any(c.kind == OUTSIDE for c in causes):
        causes, verdict = (*causes, step), "explained"
    drift = sum(t.gain for t in best.terms if t.candidate.kind == CLOCK) if best else 0.0
    notes = [*case.remarks, *filter(None, [plant.placeless(study.places)])]
    notes += hints(study, explanations, verdict, bool(behind), change if changed else None, tone, drift)
    return Judged(causes, verdict, explained, evidence, alike, doubt, drift, numbers, tuple(notes), tuple(faults))


def _sized(case: Case, study: Study, best: Explanation | None, judged: Judged) -> Judged:
    """With the sizes of named causes in an explanation of all there is, or with a network beside an element for what has no name."""
    named = unnamed = None  # what has no name does not go into a model
    causes, notes, explained = judged.causes, list(judged.notes), judged.explained
    if not any(c.kind == OUTSIDE for c in causes):
        idle = explaining.explain(study, []) if best is None or not causes else None
        sized, named = refining.mended(study, best, case.log) if idle is None else (idle, idle)
        causes = tuple(resized(study, sized, c) for c in causes)
        causes, nothing = _with_a_size(study, best, causes)
        notes += small.notes(study, sized, causes)
        missed = straight.missed(study, sized, causes)
        first = {Named(c.kind, c.where) for c in missed}  # which are no alternatives to the others then
        causes = (*missed, *(replace(c, alternatives=tuple(a for a in c.alternatives if a not in first)) for c in causes))
        notes += [f"{place(c.kind, c.where)} {MAY_BE_NOTHING}" for c in nothing]
    if judged.verdict == "unexplained" and not judged.doubt and not judged.drift:
        unnamed = nameless.fitted(study, best)
    if unnamed is not None and case.unused:
        case.tell(0.83, "fitting what has no name")
        worse = measuring.measure(study, extension.extend_file(study, unnamed, causes)[1], case.unused)[0].values()
        unnamed = None if any(g.after_rmse > 1.01 * g.before_rmse for g in worse) else unnamed
    if unnamed is not None:
        explained = nameless.share(study, unnamed.fit)
        notes.append(f"a small network beside {nameless.beside(study, unnamed)} explains a part of it, without a name")
    elif judged.verdict == "unexplained":
        explained = 0.0
    return replace(judged, causes=causes, explained=explained, notes=tuple(notes), named=named or unnamed, unnamed=unnamed)


def _with_a_size(study: Study, best: Explanation | None, causes: tuple[Cause, ...]) -> tuple[tuple[Cause, ...], list[Cause]]:
    """Causes, and those left out because their size may be nothing; all of them, if nothing else were named. What was counted, not fitted,
    and values of the file's own parameters have no such size."""
    fitted = set(best.groups) if best else set()
    nothing = [
        c for c in causes if (c.kind, c.where) in fitted and c.may_be_nothing and not c.parameters.keys() & study.model.parameters.keys()
    ]
    kept = tuple(c for c in causes if c not in nothing)
    return (kept, nothing) if kept else (causes, [])


def _measured(case: Case, study: Study, judged: Judged) -> tuple[Judged, str, dict[str, Gain], list[residual.Channel]]:
    """What the hold-out says: the judgement after it, text of the extended file, gain, and channels of the hold-out."""
    text, extended = extension.extend_file(study, judged.named, judged.causes)
    if not case.holdout:
        return judged, text, {}, []
    case.tell(0.85, "measuring the gain")
    lost = {c.where for c in judged.causes if c.kind == "sensor_dropout"}
    gain, more, held = measuring.measure(study, extended, case.unused, lost)
    worse = [s for s, g in gain.items() if g.worsened]
    fitted = [c for c in judged.causes if c not in judged.faults]
    if fitted and any(gain[s].after_rmse > UNSEEN * gain[s].noise_floor and gain[s].outside < FARTHER for s in worse):
        names = " and ".join(f"{c.kind} at {c.where}" for c in fitted)
        judged = judged.nothing(
            f"{names} would explain the training, but makes {', '.join(worse)} of the hold-out worse: train with more excitations"
        )
    elif worse and not judged.causes:
        note = f"parameters that fit the training within their tolerances make {', '.join(worse)} of the hold-out worse: left as they were"
        judged = replace(judged, named=None, unnamed=None, notes=(*judged.notes, note))
    else:
        judged = replace(judged, notes=(*judged.notes, *(f"{s} is predicted worse by the extended model: do not use it" for s in worse)))
    if worse and judged.named is None:
        text, extended = extension.extend_file(study, None, judged.causes)
        gain, more, held = measuring.measure(study, extended, case.unused)
    judged = replace(judged, notes=(*judged.notes, *more))
    unseen = [s for s, g in gain.items() if g.after_rmse > UNSEEN * g.noise_floor] if not judged.causes else []
    if unseen:
        note = f"{', '.join(unseen)}: the hold-out shows an effect that the training does not: train with recordings like that one"
        judged = replace(judged, causes=(UNKNOWN,), verdict="unexplained", explained=0.0, notes=(*judged.notes, note))
    if judged.verdict == "unexplained" and judged.named is None and not judged.doubt and (better := _refitted(case, study, gain)):
        note = "no cause is named; model_extended.toml has the parameters that fit best within their tolerances: it predicts better"
        return replace(judged, notes=(*judged.notes, note)), *better
    return judged, text, gain, held


def _refitted(case: Case, study: Study, nominal: Mapping[str, Gain]) -> tuple[str, dict[str, Gain], list[residual.Channel]] | None:
    """Text, gain, and channels of the hold-out, of the model with its parameters fitted within their tolerances; None where that is not
    better than the `nominal` one for all sensors."""
    text, extended = extension.extend_file(study, explaining.explain(study, []), ())
    gain, _, held = measuring.measure(study, extended, case.unused)
    return (text, gain, held) if all(g.after_rmse < nominal[s].after_rmse for s, g in gain.items()) else None


def hints(
    study: Study,
    explanations: Sequence[Explanation],
    verdict: str,
    behind: bool,
    change: steady.Change | None,
    tone: tones.Tone,
    drift: float,
) -> list[str]:
    """Notes on what is left: motion that comes late (`behind`), what changes with time, masses, a tone, a drift of clocks."""
    notes = []
    if behind:
        notes.append("the residual follows the motion with a delay, as the rear axle of a vehicle that pitches does")
    if change is not None and verdict == "unexplained":
        notes.append(f"{change.what} of {change.place} changes while it is measured: a controller, a leak?")
    if verdict == "unexplained" and explanations:
        masses = [cause(study, explanations, g) for g in explanations[0].groups if g[0] == "hidden_resonance"]
        notes += damped([c for c in masses if worth(study, c)])
    if tone.detected:
        notes.append(tones.note(study.model, tone))
    if drift:
        notes.append(f"clocks of sensors and inputs drift apart by {1e6 * abs(drift):.3g} ppm: put both on one clock")
    return notes


def absorbing(case: Case, study: Study, e: Explanation, learnt: list[absorb.Taught]) -> tuple[dict[str, object], list[str]]:
    """The same effect as a parameter set: what goes into diagnosis.json, and a note."""
    beside = Path(os.path.relpath(case.nominal.path.resolve(), case.output.resolve()))
    model = penode_gen.load(absorb.write(study, e, learnt, beside, case.output))
    gain = measuring.measure(study, model, case.unused, (), absorb.SET)[0] if case.unused else {}
    names = ", ".join(t.element for t in learnt)
    entry = {"file": absorb.FILE, "set": absorb.SET, "networks": {t.port: {"missing": t.missing} for t in learnt}, "gain": gain}
    after = ", ".join(f"{k} {g.after_rmse:.3g} {g.unit}" for k, g in gain.items())
    note = f"{names} can learn it: {absorb.FILE} has a set for the code that runs already"
    return entry, [note + f"; hold-out after: {after}" * bool(after)]
