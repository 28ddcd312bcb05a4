# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A diagnosis on one screen: is the model wrong, how, with what confidence, the gain, what to do next."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import Any

from .advice import doubts
from .reliability import line
from .result import OUTSIDE, VERDICTS, Cause, Diagnosis, place, plain, sigmas

WIDTH, HEIGHT = 80, 24


def sentences(model: Any, d: Diagnosis, output: Path) -> str:
    """One screen: at most HEIGHT lines of WIDTH columns; files that are named may stand out. What has no room there is in the report."""
    head = [f"{model.name}: {'keep the nominal model; ' * d.rejected}{plain(d.verdict)}", f"  {VERDICTS[d.verdict]}"]
    steps = [f"  next: {text}" for text in d.advice]
    rest = [*steps[1:], *(f"  note: {n}" for n in d.notes), *(f"  {r.name}: {p}" for r in d.data for p in r.problems)]
    room = HEIGHT - len(head) - 2
    first = _fitted(steps[:1], room)  # is there, however much there is to tell
    answer = _fitted([*_causes(d), *_gain(d)], room - len(first) - bool(rest))
    body = [*answer, *first, *_fitted(rest, room - len(first) - len(answer))]
    explained = f"{d.explained:.1%} of the avoidable residual explained, " if _named(d) else ""
    return "\n".join([*head, *body, f"  {explained}{d.seconds:.1f} s", f"  -> {output / 'report.html'}"])


def _causes(d: Diagnosis) -> list[str]:
    """Why, and how sure that is."""
    open_to = {id(x.cause): x for x in doubts(d)}
    body = []
    for c in _named(d):
        body.append(f"  {place(c.kind, c.where)}, confidence {c.confidence:.0%}")
        body += [f"    {k:<18} {v.value:>11.5g} {v.unit:<10} [{v.ci95[0]:.5g}, {v.ci95[1]:.5g}]" for k, v in c.parameters.items()]
        if id(c) in open_to:
            body.append(f"    or {open_to[id(c)]}: the recordings do not tell which")
    return [*body, *_sure(d)]


def _sure(d: Diagnosis) -> list[str]:
    """The evidence that something is wrong, and the reliability of the names."""
    if d.verdict == "no_discrepancy":
        return []
    reasons = [f"the residual exceeds noise by {sigmas(d.evidence)} standard deviations"] if d.evidence > 3.0 else []
    reasons += [line(d.reliability, min(c.confidence for c in _named(d)))] if _named(d) else []
    return [f"  how sure: {'; '.join(reasons)}"] if reasons else []


def _named(d: Diagnosis) -> list[Cause]:
    return [c for c in d.causes if c.kind != OUTSIDE]


def _gain(d: Diagnosis) -> list[str]:
    """What the error costs: a table, if there is a hold-out."""
    if not d.gain:
        return []
    body = [f"  {'RMS error on held-out data':<28}{'before':>10}{'after':>11}{'noise':>11}  gained"]
    for name, g in d.gain.items():
        gained = "" if g.share_of_achievable is None else f"{g.share_of_achievable:.0%}"
        body.append(f"    {name:<26}{g.before_rmse:>10.4g}{g.after_rmse:>11.4g}{g.noise_floor:>11.4g}  {gained:<6} {g.unit}")
    return body


def _fitted(items: list[str], room: int) -> list[str]:
    """Items on so many lines of WIDTH columns, each of them whole; how many have no room there is the last line."""
    lines: list[str] = []
    for k, item in enumerate(items):
        more = (
            textwrap.wrap(item, WIDTH, subsequent_indent="    ", break_long_words=False, break_on_hyphens=False)
            if len(item) > WIDTH
            else [item]
        )
        last = k + 1 == len(items)
        if len(lines) + len(more) > room - (not last):
            return [*lines, f"  {len(items) - k} more in the report"]
        lines += more
    return lines
