# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What both ways to a diagnosis end with: the extended model's file, sets of explanations, and the answer by innovations."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

import penode_gen
from penode_gen.model import Model

from ..recordings.measured import Measured
from . import explanation, plausible, residual, weighed
from .entries import extends
from .explanation import Explanation
from .result import OUTSIDE, Cause, Diagnosis, Recorded


def write_extended(text: str, model: Model, output: Path) -> Model:
    """Writes model_extended.toml beside the rest, with a path to the nominal one such that both can be moved together; the model of it."""
    output.mkdir(parents=True, exist_ok=True)
    nominal = model.path.resolve()
    beside = Path(os.path.relpath(nominal, output.resolve()))
    (output / "model_extended.toml").write_text(text.replace(extends(nominal), extends(beside), 1))
    return penode_gen.load(output / "model_extended.toml")


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


def by_innovations(
    w: weighed.Weighed, best: Explanation | None, output: Path | None, remarks: Sequence[str], tell: Callable[[float, str], None]
) -> Diagnosis:
    """The diagnosis of recordings that sensor noise alone cannot judge, from what was weighed, and of which `best` is what sensor noise
    would say; without recordings and time, which the caller has."""
    study = w.study
    extended = w.model if output is None else write_extended(w.text, study.model, output)
    tell(0.9, "showing what is wrong")
    shown = residual.show(study, w.fit, extended, w.held, w.verdict == "unexplained")
    rows = explanation.rows(study)
    evidence = (study.null.cost - rows) / np.sqrt(2.0 * rows)
    doubt = plausible.doubt(study, best, w.verdict) if w.verdict == "unexplained" else ""
    causes = w.causes or ((Cause(OUTSIDE, "", {}, 0.5),) if w.verdict == "unexplained" else ())
    return Diagnosis(
        w.verdict,
        causes,
        w.gain,
        w.numerics,
        w.explained,
        evidence,
        0.0,
        (*[doubt] * bool(doubt), *remarks, *w.notes),
        residual=shown.numbers(),
        explanations=w.explanations,
        shown=shown,
    )
