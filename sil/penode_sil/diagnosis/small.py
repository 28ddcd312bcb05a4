# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Notes on named laws that are small beside the force at their place. Where sensor noise is all that limits a fit, it shows deviations of
less than a per cent, as any model has somewhere; whether these matter is for the reader to say."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .catalogue import lines
from .explanation import Explanation
from .hypotheses import Basis
from .naming import Curve
from .plant import nominal
from .result import Cause, place
from .study import Study
from .worth import BENT, WORTH


def notes(study: Study, e: Explanation, causes: Sequence[Cause]) -> list[str]:
    """A line on each cause whose law takes less than WORTH of the force there already."""
    shares = [(c, share(study, e, (c.kind, c.where))) for c in causes]
    return [f"{place(c.kind, c.where)} is small: {x:.1%} of the force there" for c, x in shares if 0.0 < x < WORTH]


def share(study: Study, e: Explanation, group: tuple[str, str]) -> float:
    """Rms of a cause's force, of a curve what is beside straight lines, over BENT, as a share of that of the linear elements at its place;
    0 where there is none, and for laws with memory, which have no curve."""
    pairs = [(t, n) for t, n in zip(e.terms, e.built.names, strict=True) if t.group == group and isinstance(t.candidate.what, Basis)]
    if not pairs:
        return 0.0
    k, values = pairs[0][0].candidate.what.place, {f.target: f.value for f in e.fit.free}
    s, v = (np.concatenate([getattr(seen.motions[k], q) for seen in study.seen]) for q in "sv")
    force = Curve(*zip(*pairs, strict=True))(s, v, values)
    columns = np.stack([s, v], axis=1) / np.maximum([np.linalg.norm(s), np.linalg.norm(v)], 1e-300)
    straight = group[0] in lines.KINDS
    left = BENT * force if straight else force - columns @ np.linalg.lstsq(columns, force, rcond=None)[0]
    stiffness, damping = (
        nominal(study.model, study.places[k], law, of, values) for law, of in (("linear_spring", "stiffness"), ("linear_damper", "damping"))
    )
    acts = float(np.std(stiffness * s + damping * v))
    return float(np.sqrt(np.mean(left**2))) / BENT / acts if acts > 0.0 else 0.0
