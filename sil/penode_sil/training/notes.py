# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Notes on a fit for the user."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..recordings.measured import Measured
from . import kinks
from .left import Left
from .port import Port
from .problem import Problem
from .result import Error
from .settings import SETTINGS
from .solve import Fit
from .tries import Try


def of(problem: Problem, fit: Fit, ports: Sequence[Port], train_: Sequence[Measured], left: Sequence[Measured]) -> list[str]:
    """Notes on a fit and its recordings; `left` are the held-out ones, if the trained model leaves all bounds there."""
    notes = list(dict.fromkeys(p for m in train_ for p in m.quality.problems))  # parts of a file have them in common
    notes += [
        f"{a.parameter} stands beside {a.network}: it is the least-squares one of their sum over the visited range, "
        "the network takes the rest"
        for a in problem.apart
        if ports[a.shape].knots
    ]
    notes += kinks.notes(problem, fit, ports)
    if left:
        titles = ", ".join(m.title for m in left)
        notes.append(
            f"{titles}: the trained model leaves all bounds there, so there is no error on held-out data; "
            "a recording that goes further must be among --data"
        )
    if problem.model.method not in ("euler", "heun", "rk4"):
        notes.append(f"the deployed method is {problem.model.method}; networks were trained through rk4 with the same steps")
    return notes


def noise(remains: Left, tried: Sequence[Try]) -> list[str]:
    """Where residuals are not what the model file states as noise."""
    found, loud = [], remains.above(SETTINGS.story_loud)
    if loud:
        found.append(_not_down(remains, loud, tried))
    for j, name in enumerate(remains.names):
        ratio, alike = remains.ratio[j], remains.alike[j] > 0.0
        if ratio * SETTINGS.story_loud < 1.0:
            found.append(
                f"{name}: residuals are {ratio:.2g} times the noise that the model file states, so a fit that misses by less than that "
                "passes; state the noise that the sensor has"
            )
        elif j in loud and not alike:
            found.append(f"{name}: the residual is white, as noise is: the stated noise may be too small, by a factor of {ratio:.3g}")
        elif SETTINGS.left_more < ratio <= SETTINGS.story_loud and alike:
            found.append(
                f"{name}: residuals are {ratio:.3f} times the stated noise and correlated from row to row: {_starts(tried)} left a "
                "systematic error that is smaller than the noise"
            )
    return found


def _not_down(remains: Left, loud: Sequence[int], tried: Sequence[Try]) -> str:
    """That a fit did not converge, and what was tried; whether the model or the fit is to blame it cannot tell."""
    by = ", ".join(f"{remains.names[j]} {remains.ratio[j]:.3g}" for j in loud)
    ends = [t.ratio for t in tried if np.isfinite(t.ratio)]
    alike = len(ends) > 1 and max(ends) < SETTINGS.left_more * min(ends)
    apart = "they end at different fits, so another one" if len(ends) > 1 else "another one"
    further = (
        "they all end at the same fit, so another start will hardly help: penode diagnose on these recordings names what a model lacks"
        if alike
        else f"{apart} may help: try --seed, --known for what was measured, --from for what is known"
    )
    return f"residuals stayed above the stated noise, {by} times it; tried: {', '.join(_told(t) for t in tried)}; {further}"


def _starts(tried: Sequence[Try]) -> str:
    return "the only start" if len(tried) == 1 else f"{len(tried)} starts"


def _told(t: Try) -> str:
    return f"{t.start} ({t.ratio:.3g})" if np.isfinite(t.ratio) else f"{t.start} (left all bounds)"


def deployed(training: Sequence[Error], smooth: Sequence[Error]) -> list[str]:
    """Where the generated C errs more than the trainer because it joins rows of its inputs otherwise; `smooth`: the same with
    `input = "cubic"`."""
    found = []
    for error, other in zip(training, smooth, strict=True):
        if error.deployed > SETTINGS.left_more * error.after and other.deployed - error.after < error.deployed - other.deployed:
            more, rest = (100.0 * (e.deployed / error.after - 1.0) for e in (error, other))
            found.append(
                f"{error.signal}: the generated C errs {more:.1f} % more than the trainer, because it interpolates its inputs "
                f'linearly; with input = "cubic" in [model] it errs {rest:.1f} % more'
            )
    return found
