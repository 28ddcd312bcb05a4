# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Parameters that differ from the model file in a fit to innovations: which are causes, and which only compensate for laws that are
missing."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from penode_gen import units
from penode_gen.model import Model, Parameter

from .. import catalogue
from ..catalogue import drives, values as of_values
from ..catalogue.form import Motion
from ..evidence.bench import UNSTATED
from ..evidence.fit import Fit
from ..result import EXTENDED, Cause, Value
from ..study.study import guessed
from . import straight
from .innovate import Found
from .rounds import MIN_FORM, terms_of
from .terms import Term
from .worth import MIN_GAIN, WORTH, Z_95, least, shift, systematic, undetermined, wrong

COMMON = f"masses, stiffnesses and dampings that are off by a common factor have the same effect; {EXTENDED} has that form"


@dataclass(frozen=True)
class Judged:
    """What the parameters of a fit amount to: `causes`, those that are wrong; `notes` on others that are off; and names of the `absorbed`,
    which are off beside the named forms alone, but within their limits once the small forms are in the model too."""

    causes: tuple[Cause, ...]
    notes: tuple[str, ...]
    absorbed: tuple[str, ...]


def judge(model: Model, found: Found, moved: Sequence[Motion], confidence: float, log: Callable[[str], None]) -> Judged:
    """Judges each parameter by its value beside the named forms alone, in a bench that has moved along `moved`, and by its value beside all
    forms that were found. Causes have this `confidence`. All by one factor, they are the gain of an input that the file lacks."""
    plain, whole = found.plain.fit, found.bench.fit.values
    shared = straight.beside(model, found.plain, _straight(terms_of(found.named)), moved)
    judged = [p for p in model.parameters.values() if p.name in whole and not np.isinf(p.tolerance)]
    known = {p.name: _known(model, found, moved, p) for p in judged}
    sizes = {p.name: _size(p, plain.value(p.name), known[p.name][1], shared) for p in judged}
    gain = drives.common_gain(model, sizes, {p.name: _limit(p) for p in judged})
    if gain and abs(gain.parameters["gain"].value - 1.0) >= least(found.possible, 0.0):
        return Judged((replace(gain, confidence=confidence),), (COMMON,), ())
    shared_by_all = straight.beside(model, found.bench, _straight(found.terms), moved)
    laws = laws_beside(model, found)
    causes, notes, absorbed = [], [], []
    for p in judged:
        value, beside, unit = plain.value(p.name), whole[p.name], units.si(p.unit)
        size, sd = known[p.name]
        log(f"{p.name}: {value / p.value - 1.0:+.2%}, deviation {sd / abs(p.value):.2%}, {size:.1%} of the force there")
        limit = _limit(p, found.possible)
        if abs(value - p.value) <= _slack(p, limit, sd):
            continue
        much = f"{p.name} is {value:.4g} {unit}, which changes {size:.1%} of the force there"
        if p.name in shared and not straight.off(p.value, value, shared[p.name], limit):
            notes.append(f"{p.name} is {value:.4g} {unit} together with the cause found at its place, which has a linear part too")
        elif size < MIN_FORM * laws.get(p.name, 0.0):
            notes.append(f"{much}: no more than the curve of the cause there may be off")
        elif size < least(found.possible, 0.0):
            notes.append(f"{much}: no more than unmodelled effects can")
        elif not straight.off(p.value, beside, shared_by_all.get(p.name, (0.0, 0.0)), limit):
            absorbed.append(p.name)
            notes.append(
                f"{p.name} is {value:.4g} {unit} without the small deviations that were found, "
                f"and {beside:.4g} with them: within its tolerance, with the slopes of laws at its place"
            )
        else:
            causes.append(of_values.cause(p.name, sizes[p.name], confidence))
    return Judged(tuple(causes), tuple(notes), tuple(absorbed))


def laws_beside(model: Model, found: Found) -> dict[str, float]:
    """For each parameter of a linear law, the largest share of the force at its place that a named form there has; none where no small form
    was found, which shows that curves are not quite their textbook forms."""
    shares: dict[str, float] = {}
    for a in found.named if found.small else ():
        place = found.plain.places[a.trial.form.index] if a.trial.form.how == "force" else None
        for parameter, _ in straight.lines(model, place) if place else ():
            shares[parameter] = max(shares.get(parameter, 0.0), a.trial.share)
    return shares


def _known(model: Model, found: Found, moved: Sequence[Motion], p: Parameter) -> tuple[float, float]:
    """The share of the force there that changes with a parameter as fitted beside the named forms, and the deviation of its value."""
    fit, size, bent = found.plain.fit, shift(model, found.plain, moved, p.name), systematic(found.possible)
    return size, float(np.hypot(fit.deviation(p.name), bent / max(size, bent, 1e-300) * abs(fit.value(p.name) - p.value)))


def _straight(terms: Sequence[Term]) -> list[Term]:
    """Those with a straight part, which a place shares with its linear element."""
    return [t for t in terms if t.form.how == "force" and t.form.kind in getattr(catalogue.OF[t.form.kind], "STRAIGHT", ())]


def notes_on_guessed(model: Model, fit: Fit) -> list[str]:
    """Notes, one or none, on parameters that the file only guesses, at their fitted values."""
    found, ratios = [], undetermined(model, fit)
    for name in guessed(model):
        if name in fit.values:
            sure = "" if name in ratios else f" +- {Z_95 * fit.deviation(name, ratios):.2g}"
            found.append(f"{name} = {fit.value(name):.4g} {units.si(model.parameters[name].unit)}{sure}")
    only = f"; the recordings show forces as ratios to {', '.join(sorted(ratios))} only" if ratios else ""
    return [f"fitted, because the file gives only a guess: {', '.join(found)}{only}"] if found else []


def _limit(p: Parameter, level: float = WORTH) -> float:
    """Largest relative deviation that is no cause: the tolerance, or, if the file states none, UNSTATED in a world that is `wrong` by
    the `level` beside all that was found, and less in one that is nearly right: there is nothing else for a value to make up for; values
    are ROUNDED at least."""
    return p.tolerance if p.tolerance > 0.0 else max(UNSTATED * wrong(level), of_values.ROUNDED)


def _slack(p: Parameter, limit: float, sd: float) -> float:
    """By how much a value that is known to `sd` may be off and no cause: by its relative `limit`; where the file states no tolerance, at
    least by as many deviations as gain MIN_GAIN, which any cause has to."""
    needed = 0.0 if p.tolerance else float(np.sqrt(2.0 * MIN_GAIN))
    return max(limit * abs(p.value) + Z_95 * sd, needed * sd)


def _size(p: Parameter, value: float, sd: float, shared: Mapping[str, straight.Slopes]) -> Value:
    """A parameter with its interval, with the slopes that laws at its place share with it."""
    least, most = shared.get(p.name, (0.0, 0.0))
    return Value(value + 0.5 * (least + most), units.si(p.unit), (value - Z_95 * sd + least, value + Z_95 * sd + most))
