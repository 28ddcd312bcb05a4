# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which causes: a search that scores all hypotheses at once (score), fits the best few by simulation, and looks again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from .exchange import MAX_LOSS, exchanged, lightened, ranked
from .explaining import explain, heavy, settled
from .explanation import COST, NEW, Explanation, curve, distinct, exact, law_of, level, only_noise, rows, spared, unloaded
from .noise import ALIKE, correlation
from .pursuit import further, strongest, terms_of
from .refining import filtered, refine
from .score import Regression
from .singles import singles
from .study import Study, loss, regression, with_noise_of
from .textbook import owned, plain, softened

WHOLE = 0.97  # share that is a whole explanation
NEAR = 0.1  # of the avoidable residual: two explanations that differ less may change their order with more laws


def first(study: Study, log=lambda text: None) -> tuple[Study, list[Explanation]]:
    """Explanations by one kind, from best to worst, empty if there is nothing to explain; and the study with the noise that the best of
    them leaves. The first look is taken twice: the null fit may take a cause for slow noise."""
    parameters = [f.target for f in study.null.free if isinstance(f.target, str)]
    study = replace(study, nothing=loss(study, study.null))
    bare = with_noise_of(study, study.null, coloured=False)
    bare = replace(bare, nothing=min(study.nothing, loss(bare, bare.null)))
    found = singles(bare, regression(bare, bare.null, parameters), 2)
    white = bool(found) and found[0].score > 0.0 and with_noise_of(bare, found[0].fit) is bare
    if bare.metrics is not study.metrics and not white and not any(only_noise(bare, e.fit) for e in found):
        slow = replace(study, nothing=bare.nothing)
        found = sorted([*found, *singles(slow, regression(slow, slow.null, parameters), 1)], key=lambda e: -e.score)
    for e in found:
        log(f"first {e.groups} {e.gain:.0f}")
    if not found or found[0].score <= 0.0:
        return study, []
    quiet = with_noise_of(bare, found[0].fit)
    if quiet is bare:
        return quiet, found
    again = [*singles(quiet, regression(quiet, quiet.null, parameters)), explain(quiet, found[0].terms, start=found[0].fit)]
    return quiet, distinct(again)


def _refined(study: Study, e: Explanation, parameters: Sequence[str], log) -> tuple[Study, Explanation, Regression]:
    """The explanation in the noise that it leaves, with as many laws of its kinds as earn their cost; the study with that noise, and the
    regression about it."""
    akin, _ = correlation(study.experiments, study.metrics, e.fit.simulated)
    here = with_noise_of(study, e.fit, coloured=akin < ALIKE)  # what sensors share is no noise
    if here is not study:
        e = explain(here, e.terms, 4, e.fit, e.formulas)
    e = e.whole()
    e, r = refine(here, e, regression(here, e.fit, parameters), parameters)
    if any(kind == "backlash" for kind, _ in e.groups):  # else another cause may come in for what two halves of a play do
        tied = owned(here, e, log)
        if tied is not e:
            e = tied.whole()
            r = regression(here, e.fit, parameters)
    if any(kind == "sensor_clipping" for kind, _ in e.groups):
        soft = softened(here, e, log)
        if soft is not e:
            soft = soft.whole()
            e, r = refine(here, soft, regression(here, soft.fit, parameters), parameters)
    return here, e, r


def grow(
    study: Study, beam: Sequence[Explanation], log, width: int = 2, hopeless: Callable[[Study, Explanation], bool] = lambda study, e: False
) -> tuple[Study, list[Explanation]]:
    """Explanations by one kind, those of the `beam`, by two and by three, from best to worst; `width`: how many of each are given a
    further one. After each round the search ends if the best explanation so far is `hopeless`."""
    if not beam:
        return study, []
    parameters = [f.target for f in study.null.free if isinstance(f.target, str)]
    for e in beam:
        log(f"{e.groups} {e.gain:.0f}")
    done = list(beam)
    ended: list[Explanation] = []
    stopped = False
    for _ in (2, 3):
        grown: list[Explanation] = []
        enough = beam[0].gain - MAX_LOSS * abs(beam[0].gain)
        for e in beam[: 1 if heavy(beam[0]) else width]:
            alike = {curve(t.candidate) for t in e.terms} == {curve(t.candidate) for t in beam[0].terms}
            if e.gain < (max(enough, (1.0 - NEAR) * beam[0].gain) if alike else enough):
                break  # of one curve, the worse form of it will not become the better one
            if any(len(e.terms) >= len(o.terms) and e.gain < o.gain - NEW for o in ended):
                continue  # it would need more laws to become as good
            here, e, r = _refined(study, e, parameters, log)
            done.append(e)
            log(f"refined {e.groups} x{len(e.terms)} {e.gain:.0f} {[law_of(t.candidate) for t in e.terms]}")
            if second := filtered(here, e, r):
                done.append(second)
                log(f"  two masses: {second.gain:.0f}")
            choices = further(here, e, r)[:2] + ([strongest(r, e.groups)] if second else [])  # what is taken for a second mass
            ways = [*filter(None, (terms_of(r, chosen) for chosen in choices))]
            if not ways and e.fit.chi2 - rows(here) < (1.0 - WHOLE) * e.gain:
                enough = (1.0 - NEAR) * e.gain  # it is whole: only what is about as good may take its place
                ended = [e] if only_noise(here, e.fit) else []
            for new in ways:
                wider = explain(here, [*e.terms, *new], start=e.fit, formulas=e.gain if exact(e.groups) else e.formulas)
                log(f"  + {wider.groups[-1]} -> {wider.gain:.0f}")
                if wider.score > e.score:
                    grown.append(wider)
        done += grown
        if not grown:
            break
        beam = sorted(grown, key=lambda e: -e.score)
        if stopped := hopeless(study, max(done, key=lambda e: e.score)):
            break
    done = sorted((e for e in spared(done) if e.score > 0.0), key=lambda e: -e.score)
    if done:
        study = with_noise_of(study, done[0].fit)
    if stopped or not done:
        return study, done
    if len(done[0].groups) > 1:
        found = exchanged(study, done[0], parameters, log)
        if found and max(e.score for e in found) > done[0].score:
            found += lightened(study, max(found, key=lambda e: e.score), log)
        done = sorted(done + found, key=lambda e: -e.score)
    others = [e for e in done[1:] if unloaded(e) != unloaded(done[0]) and len(e.groups) <= len(done[0].groups)]  # for loads, see ranked
    equal = [e for e in others if e.gain > done[0].gain - COST]  # and may be the plainer one
    first = level([done[0], *equal[:1]])
    plainer = list(zip(first, level([plain(study, e, parameters, log) for e in first]), strict=True))
    best = settled(study, owned(study, max(plainer, key=lambda both: max(e.score for e in both))[1], log))
    return study, ranked(study, best, done[1:], log)
