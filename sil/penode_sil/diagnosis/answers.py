# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What both ways to a diagnosis end with: the extended model's file, sets of explanations, and the answer by innovations."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..recordings.measured import Measured
from . import explanation, plausible, weighed
from .checks.case import Case, End
from .checks.written import write_extended
from .explanation import Explanation
from .fit import Fit
from .result import OUTSIDE, Cause, Diagnosis, Recorded


def recorded(train: Sequence[Measured], holdout: Sequence[Measured]) -> tuple[Recorded, ...]:
    """All recordings, each with its role."""
    return tuple(Recorded.of(m, role) for role, ms in (("training", train), ("hold-out", holdout)) for m in ms)


def alternatives(causes: Sequence[Cause]) -> tuple[dict[str, object], ...]:
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


def by_innovations(case: Case, w: weighed.Weighed, best: Explanation | None, broken: Callable[[Fit], Sequence[Cause]]) -> End:
    """The diagnosis of recordings that sensor noise alone cannot judge, from what was weighed, and of which `best` is what sensor noise
    would say; without pictures, recordings and time. `broken`: sensors at fault beside a fit."""
    study = w.study
    rows = explanation.rows(study)
    evidence = (study.null.cost - rows) / np.sqrt(2.0 * rows)
    doubt = plausible.doubt(study, best, w.verdict) if w.verdict == "unexplained" else ""
    causes = w.causes or ((Cause(OUTSIDE, "", {}, 0.5),) if w.verdict == "unexplained" else ())
    own = {(c.kind, c.where) for c in causes}
    causes = (*causes, *(f for f in (broken(w.fit) if w.verdict != "unexplained" else ()) if (f.kind, f.where) not in own))
    answer = Diagnosis(
        "explained" if causes and w.verdict == "no_discrepancy" else w.verdict,
        causes,
        w.gain,
        w.numerics,
        w.explained,
        evidence,
        0.0,
        (*[doubt] * bool(doubt), *case.remarks, *w.notes),
        explanations=w.explanations,
    )
    again = None if w.without is None else lambda gone: by_innovations(case, w.without(gone), best, broken)
    return End(answer, study, write_extended(w.text, case), w.fit, w.held, w.withheld, again)
