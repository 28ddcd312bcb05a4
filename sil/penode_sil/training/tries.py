# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Several starts of one fit: another one where what is left looks as if it led further, and of all the one that predicts best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from . import heldout, left
from .curves import Tell
from .problem import Problem
from .settings import SETTINGS
from .solve import Fit


@dataclass(frozen=True)
class Try:
    """A start and where it ended: the largest residual over the stated noise (NaN: it left all bounds), and what blocks of the recordings
    leave as predicted from the others, in chi2 a sample (NaN: it was the only one)."""

    start: str
    ratio: float
    heldout: float = float("nan")


def several(
    train: Callable[[int, Tell], tuple[str, tuple[Problem, Fit] | None]], doubt: Callable[[], None], tell: Tell
) -> tuple[Problem, Fit, tuple[Try, ...]]:
    """The best of the starts that are needed; `train` takes the number of a start, and gives it in words and where it ended, None if it
    left all bounds. `doubt` is called once where the first start explains little: it may raise. FloatingPointError where all of them leave
    all bounds."""
    ended: list[tuple[str, Problem, Fit, left.Left]] = []
    lost: list[Try] = []
    for k in range(SETTINGS.tries_most):
        what, found = train(k, _of_try(k, tell))
        remains = left.of(found[0], found[1].point) if found else None
        if k == 0 and (remains is None or remains.doubtful):
            doubt()
        if found is None or remains is None:
            lost.append(Try(what, float("nan")))
            continue
        ended.append((what, *found, remains))
        if not remains.unfinished:
            break
    if not ended:
        raise FloatingPointError(f"the simulation left all bounds from each of {len(lost)} starts ({', '.join(t.start for t in lost)})")
    if len(ended) == 1:
        what, problem, fit, remains = ended[0]
        return problem, fit, (Try(what, remains.most), *lost)
    noise = min(ended, key=lambda e: e[3].most)[1].noise  # one for all: that of the one that leaves least
    scores = [_predicted(problem.with_(noise=noise), fit) for _, problem, fit, _ in ended]
    best = int(np.argmin(scores))
    tried = tuple(Try(what, remains.most, score) for (what, _, _, remains), score in zip(ended, scores, strict=True))
    return ended[best][1], ended[best][2], (tried[best], *tried[:best], *tried[best + 1 :], *lost)


def _predicted(problem: Problem, fit: Fit) -> float:
    """chi2 a sample of blocks of the recordings as predicted from the others."""
    precision, origin = problem.prior(fit.point)
    scores = heldout.predicted(heldout.parts(problem, fit.point), precision, -precision @ (fit.point.vector - origin))
    found = float(scores.sum()) / max(problem.samples, 1)
    return found if np.isfinite(found) else np.inf


def _of_try(k: int, tell: Tell) -> Tell:
    """Tells the progress of one start; another one begins anew."""
    return tell if k == 0 else lambda share, doing: tell(share, f"{doing}, start {k + 1}")
