# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What no answer may say, as one table of rules: each with a condition on an end and the table of its figures, and a consequence."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.signal import butter, lfilter

from penode_gen.model import Model

from ...compared import REJECTED, rejected, worsened
from ...predicted import Predicted
from .. import catalogue
from ..catalogue import drives, values as of_values
from ..catalogue.friction import turns
from ..reliability import trusted
from ..report.figure import number
from ..result import EXTENDED, MAY_BE_NOTHING, NOT_NAMED, OUTSIDE, UNKNOWN, Cause, place
from ..search.worth import RATIO
from ..study.noise import UNSEEN
from ..study.restoring import rms
from . import values
from .case import Case, End
from .figures import ROLES, Row, Table, misses, tabled
from .written import heading, write_extended

NOMINAL = ("nominal", "refitted")


@dataclass(frozen=True)
class Rule:
    """`broken` says what breaks it: names of sensors, or causes with why; nothing if it holds. `consequence` is the end after that."""

    name: str
    broken: Callable[[Case, End, Table], Sequence[Any]]
    consequence: Callable[[Case, End, Table, Sequence[Any]], End]


# -- names ------------------------------------------------------------------------------------------------------------


def neutral(case: Case, end: End, table: Table) -> list[tuple[Cause, str]]:
    """Causes whose interval includes the value without effect: 0, 1 of a scale, the nominal value of a parameter."""
    nominal = {p.name: p.value for p in case.model.parameters.values()}
    return [(c, MAY_BE_NOTHING) for c in _named(end) if c.neutral(nominal)]


def larger(case: Case, end: End, table: Table) -> list[tuple[Cause, str]]:
    """Causes with a force larger than everything measured at their place."""
    found = []
    for c in _named(end):
        own = next((s for s in table.surfaces if c.where in (*s.elements, s.place)), None)
        forces = {k: v.value for k, v in c.parameters.items() if own is not None and v.unit == own.unit("N")}
        if own is not None and (too := [x for x in forces.values() if abs(x) > own.largest]):
            most = number(float(f"{own.largest:.3g}"))
            found.append((c, f"would have {too[0]:.3g} {own.unit('N')}, but no more than {most} is measured there; {NOT_NAMED}"))
    return found


def unturned(case: Case, end: End, table: Table) -> list[tuple[Cause, str]]:
    """Causes that are about reversals, where the rate keeps its sign."""
    found = []
    for c in _named(end):
        at = [k for k, p in enumerate(end.study.places) if c.where in (p.name, *(n for n, _ in p.elements))]
        if c.kind in catalogue.REVERSING and at and end.study.seen:
            rates = np.concatenate([seen.motions[at[0]].v for seen in end.study.seen])
            if not turns(rates):
                found.append((c, f"acts at reversals, but the rate there does not change its sign; {NOT_NAMED}"))
    return found


def nameless(case: Case, end: End, table: Table, broken: Sequence[tuple[Cause, str]]) -> End:
    """The end without names. Without any left nothing is explained, if there is anything to explain."""
    gone = [c for c, _ in broken]
    d = end.answer
    causes = tuple(c for c in d.causes if all(c is not x for x in gone))
    names = [{"kind": c.kind, "where": c.where} for c in gone]
    sets = [{**s, "causes": [c for c in s["causes"] if c not in names]} for s in d.explanations]
    notes = (*d.notes, *(f"{place(c.kind, c.where)} {why}" for c, why in broken))
    d = replace(d, causes=causes, explanations=tuple(s for s in sets if s["causes"]), notes=notes)
    if not causes:
        off = misses(table.rows, "refitted", table.noise)
        d = replace(d, causes=(UNKNOWN,) * bool(off), verdict="unexplained" if off else "no_discrepancy", explained=0.0)
    return replace(end, answer=d)


def _named(end: End) -> list[Cause]:
    return [c for c in end.answer.causes if c.kind != OUTSIDE]


# -- what the written model predicts ----------------------------------------------------------------------------------


def burdens(case: Case, end: End, table: Table) -> list[tuple[str, str]]:
    """Offsets, scales and delays of sensors that make what the written model predicts in training worse than it is without them."""
    found = []
    for r in table.of(ROLES[0]) if end.without is not None else ():
        predicted = table.predicted[r.figure.recording][1]
        lighter = drives.plain(end.extended, r.figure.signal, predicted.time, predicted.z[:, r.sensor])
        found += [(k, r.figure.signal) for k, z in lighter.items() if worsened(r.rms_of(predicted.time, z), r.rms("extended"))]
    return list(dict.fromkeys(found))


def relieved(case: Case, end: End, table: Table, gone: Sequence[tuple[str, str]]) -> End:
    """The end without them, if it is not worse for any sensor in training."""
    if end.without is None:
        return end
    written = case.output / EXTENDED
    before, lighter = written.read_text(), end.without(gone)
    again = tabled(case, lighter)
    pairs = zip(table.of(ROLES[0]), again.of(ROLES[0]), strict=True)
    if any(worsened(old.rms("extended"), new.rms("extended")) for old, new in pairs):
        written.write_text(before)
        return end
    return lighter


def mended(case: Case, end: End, table: Table) -> list[str]:
    """Sensors that the nominal model misses by more than noise, however its file allows to fit it, and that the written one mends; where
    nothing was explained, only if the written one leaves no sensor more than its noise. Values within their tolerances are what the file
    allows, also where a refit from the nominal ones did not find them."""
    verdict = end.answer.verdict
    if verdict != "no_discrepancy" and (verdict != "unexplained" or misses(table.rows, "extended", table.noise)):
        return []
    if verdict == "no_discrepancy" and allowed(case, end):
        return []
    return list(dict.fromkeys(r.figure.signal for r in _missed(table) if UNSEEN * r.rms("extended") < min(map(r.rms, NOMINAL))))


def allowed(case: Case, end: End) -> bool:
    """Is the written model the nominal one with other values, all within the tolerances that its file states?"""
    known, written = case.model.parameters, end.extended.parameters
    if known.keys() != written.keys() or len(end.extended.elements) != len(case.model.elements):
        return False
    return all(abs(written[n].value - p.value) <= p.tolerance * abs(p.value) for n, p in known.items())


def _missed(table: Table) -> list[Row]:
    """Rows in which the error of the nominal model exceeds the noise, as it is and refitted."""
    return [r for r in table.rows if all(r.sensor in misses([r], model, table.noise) for model in NOMINAL)]


def explained(case: Case, end: End, table: Table, sensors: Sequence[str]) -> End:
    """Explained: by causes that were withheld, for they are small beside the force there, if they leave noise alone or RATIO times less
    than the nominal model; or else by values of parameters."""
    d = end.answer
    taken = min(_beyond_noise(r, table) for r in table.rows if r.figure.signal in sensors)
    whole = not misses(table.rows, "extended", table.noise)
    d = replace(d, verdict="explained" if whole else "partly_explained", explained=max(taken, 0.0))
    clear = all(RATIO * r.rms("extended") < min(map(r.rms, NOMINAL)) for r in _missed(table) if r.figure.signal in sensors)
    if end.withheld and (whole or clear):
        names = [place(c.kind, c.where) for c in end.withheld]
        notes = tuple(n for n in d.notes if not (n.endswith(NOT_NAMED) and n.startswith(tuple(f"{name} " for name in names))))
        causes = tuple(trusted(c, d.explained) for c in end.withheld)
        sets = ({"causes": [{"kind": c.kind, "where": c.where} for c in causes], "posterior": min(c.confidence for c in causes)},)
        return replace(end, answer=replace(d, causes=causes, explanations=sets, notes=notes))
    if found := values.few(case, end, table):
        return by_values(case, replace(end, answer=d), table, found)
    if end.answer.verdict == "unexplained":
        return end
    off = f"the error of the model at {', '.join(sensors)} exceeds the noise, that of {EXTENDED} is smaller"
    note = f"{off}: neither its small causes nor other parameter values explain that"
    unsure = (UNKNOWN,)
    return replace(end, answer=replace(d, verdict="unexplained", causes=unsure, explained=0.0, notes=(*d.notes, note)))


def _beyond_noise(r: Row, table: Table) -> float:
    """Share of the power beyond noise of the refitted nominal model's error that the written one takes away."""
    left, whole = (max(r.rms(what) ** 2 - float(table.noise[r.sensor]) ** 2, 0.0) for what in ("extended", "refitted"))
    return 1.0 - left / max(whole, 1e-300)


def spread(case: Case, end: End, table: Table) -> list[values.Few]:
    """The fewest values that explain as much, where values alone are named and the written model has others too; or that explain what
    nothing else does."""
    if end.answer.verdict == "unexplained":
        return values.few(case, end, table)
    named = {c.where for c in end.answer.causes if of_values.is_one(c)}
    moved = values.moved(case, end.extended)
    if len(named) < len(end.answer.causes) or not named or named == moved:
        return []
    found = values.few(case, end, table)
    return found if found and len(found[0].names) < len(moved) else []


def by_values(case: Case, end: End, table: Table, found: Sequence[values.Few]) -> End:
    """The end that names these values, beside which the written model has others within their tolerances only."""
    best, causes = found[0], values.caused(case, end, found)
    extended = write_extended(values.text(case, causes, best), case)
    fit = replace(end.study.null, simulated=best.fit.simulated)
    d = end.answer
    if d.verdict == "unexplained":
        d = replace(d, verdict="explained", explained=values.taken(end, best), notes=tuple(case.remarks))
    d = replace(d, causes=causes, explanations=values.explanations(end, found))
    return replace(end, answer=d, extended=extended, fit=fit, without=None)


def unseen(case: Case, end: End, table: Table) -> list[str]:
    """Sensors of the hold-out that are off by more than noise where nothing is named."""
    rows = table.of(ROLES[1]) if end.answer.verdict == "no_discrepancy" else []
    return [r.figure.signal for r in rows if all(r.sensor in misses([r], what, table.noise) for what in (*NOMINAL, "extended"))]


def unexplained(case: Case, end: End, table: Table, sensors: Sequence[str]) -> End:
    """Unexplained, with a note on why."""
    names = ", ".join(dict.fromkeys(sensors))
    note = f"{names}: the hold-out shows an effect that the training does not: train with recordings like that one"
    d = end.answer
    return replace(end, answer=replace(d, verdict="unexplained", causes=(UNKNOWN,), explained=0.0, notes=(*d.notes, note)))


def coupled(case: Case, end: End, table: Table) -> list[tuple[str, float]]:
    """Sensors that a model without a name for anything misses by more than noise, as a high-pass explains better than the written one, and
    to the noise where something is unexplained; and its corner [Hz]."""
    found: dict[str, float] = {}
    verdict = end.answer.verdict
    for r in _missed(table) if verdict == "no_discrepancy" or (verdict == "unexplained" and not _named(end)) else ():
        corner, left = _best_corner(r, table.predicted[r.figure.recording][0], case.model.sample_time)
        noise = verdict == "no_discrepancy" or left < UNSEEN * table.noise[r.sensor]
        if noise and UNSEEN * left < min(map(r.rms, (*NOMINAL, "extended"))):
            found[r.figure.signal] = corner
    return list(found.items())


def _best_corner(r: Row, predicted: Predicted, step: float) -> tuple[float, float]:
    """Corner [Hz] of the high-pass behind which a prediction is nearest to a sensor, and its error."""

    def left(log_corner: float) -> float:
        return r.rms_of(predicted.time, _high_pass(predicted.z[:, r.sensor], float(np.exp(log_corner)) * step))

    corners = np.linspace(-np.log(np.ptp(predicted.time)), np.log(0.1 / step), 40)
    k = int(np.clip(np.argmin([left(c) for c in corners]), 1, len(corners) - 2))
    best = minimize_scalar(left, bounds=(corners[k - 1], corners[k + 1]), method="bounded")
    return float(np.exp(best.x)), float(best.fun)


def _high_pass(x: np.ndarray, corner: float) -> np.ndarray:
    """A signal [n] behind a first-order high-pass with this corner [of a sample's rate]."""
    return lfilter(*butter(1, 2.0 * corner, "high"), x)


def unsure(case: Case, end: End, table: Table, sensors: Sequence[tuple[str, float]]) -> End:
    """No agreement: the sensors do not show slow motion."""
    d = end.answer
    corners = ", ".join(f"{name} ({corner:.2g} Hz)" for name, corner in sensors)
    note = f"{corners}: off by more than noise, as behind a high-pass: is the sensor AC-coupled, as piezoelectric ones are?"
    return replace(end, answer=replace(d, verdict="not_identifiable", causes=tuple(end.faults), notes=(note, *d.notes)))


def worse(case: Case, end: End, table: Table) -> list[str]:
    """Sensors that the written model predicts worse than the nominal one: on the hold-out, or else in training."""
    rows = table.of(ROLES[bool(case.holdout)])
    return list(dict.fromkeys(r.figure.signal for r in rows if worsened(r.rms("nominal"), r.rms("extended"))))


def misled(case: Case, end: End, table: Table) -> list[str]:
    """Sensors of the hold-out that named causes make worse than the nominal model, and worse than their noise, while the training is
    predicted better, and the hold-out as a whole is not: the force there does not act in the hold-out. Of a plant that drifts, what swings
    counts too: a free run adds up whatever else is wrong with it."""
    found, held = [c for c in _named(end) if c not in end.faults], table.of(ROLES[1])
    if not found or not case.holdout or any(worsened(r.rms("nominal"), r.rms("extended")) for r in table.of(ROLES[0])):
        return []
    corner = end.study.linear.beside_drift * case.model.sample_time
    swinging = {w: [rms(_high_pass(r.errors[w], corner)) for r in held] for w in ("nominal", "extended")} if corner else {}
    whole = {w: [r.rms(w) for r in held] for w in ("nominal", "extended")}
    if any(_is_better(held, table, errors) for errors in (whole, swinging) if errors):
        return []
    off = misses(held, "extended", table.noise)
    return [s for s in worse(case, end, table) if any(r.sensor in off for r in held if r.figure.signal == s)]


def _is_better(rows: Sequence[Row], table: Table, errors: Mapping[str, Sequence[float]]) -> bool:
    """Are these errors of the written model in rows smaller as a whole? One sensor may show more of what else is wrong than before."""
    nominal, extended = (np.maximum(errors[w], [table.noise[r.sensor] for r in rows]) for w in ("nominal", "extended"))
    return bool(np.mean(np.log(extended)) < np.mean(np.log(nominal)))


def withdrawn(case: Case, end: End, table: Table, sensors: Sequence[str]) -> End:
    """The end without the names, and with a written model that is the nominal one."""
    names = [place(c.kind, c.where) for c in _named(end) if c not in end.faults]
    off = f"makes {', '.join(sensors)} of the hold-out worse"
    note = f"{' and '.join(names)} would explain the training, but {off}: train with more excitations"
    extended = _as_it_was(case)
    d, causes = end.answer, tuple(end.faults) or (UNKNOWN,)
    notes = [n for n in d.notes if not n.startswith(tuple(f"{name} " for name in names))]
    d = replace(d, verdict="unexplained", causes=causes, explanations=(), explained=0.0, notes=(*notes, note))
    return replace(end, answer=d, extended=extended, fit=None, withheld=(), without=None)


def _as_it_was(case: Case) -> Model:
    """The nominal model, written in place of an extended one."""
    return write_extended("\n".join([*heading(case.model, "nothing"), ""]), case)


def needless(case: Case, end: End, table: Table) -> list[str]:
    """Sensors that values within their tolerances, with nothing named, make worse."""
    return worse(case, end, table) if end.answer.verdict == "no_discrepancy" and allowed(case, end) else []


def plain(case: Case, end: End, table: Table, sensors: Sequence[str]) -> End:
    """The end with a written model that is the nominal one."""
    extended = _as_it_was(case)
    d = end.answer
    note = f"parameters that fit the training within their tolerances make {', '.join(sensors)} of the hold-out worse: left as they were"
    return replace(end, answer=replace(d, notes=(*d.notes, note)), extended=extended, without=None)


def reject(case: Case, end: End, table: Table, sensors: Sequence[str]) -> End:
    """The written model under another name, and no more than a part explained."""
    written = case.output / EXTENDED
    (case.output / REJECTED).write_text(rejected(written.read_text(), EXTENDED))
    written.unlink()
    d = end.answer
    verdict = "partly_explained" if d.verdict == "explained" else d.verdict
    note = f"{REJECTED} makes the prediction of {', '.join(sensors)} worse"
    notes = (*(n.replace(EXTENDED, REJECTED) for n in d.notes), note)
    return replace(end, answer=replace(d, verdict=verdict, model_file=REJECTED, notes=notes))


RULES = (
    Rule("the interval of a named cause excludes no effect", neutral, nameless),
    Rule("no force larger than everything measured at its place", larger, nameless),
    Rule("a law about reversals only where the rate changes its sign", unturned, nameless),
    Rule("no offset, scale or delay that makes its sensor worse", burdens, relieved),
    Rule("no_discrepancy only if the nominal model misses nothing that the written one predicts", mended, explained),
    Rule("the fewest parameter values that explain as much", spread, by_values),
    Rule("no_discrepancy only if no sensor is off as behind a high-pass", coupled, unsure),
    Rule("no_discrepancy only if the hold-out is within noise", unseen, unexplained),
    Rule("no values within tolerances that predict worse than those of the file", needless, plain),
    Rule("no name for a force that acts in training alone", misled, withdrawn),
    Rule("no model that predicts worse than the nominal one", worse, reject),
)
