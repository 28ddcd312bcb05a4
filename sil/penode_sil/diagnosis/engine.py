# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The whole way from recordings to a named, measured improvement."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen.model import Model

from ..errors import UserError
from ..measured import Measured, with_shared_rails
from . import absorb, dropouts, echo, extension, nameless, naming, noise, numerics, plant, plausible, residual, search, steady, tones, weighed
from .answers import alternatives, by_innovations, recorded, write_extended
from .broken import broken_sensors, still_wild
from .driven import settled
from .hypotheses import CLOCK, Basis
from .noise import Experiment
from .result import OUTSIDE, Cause, Diagnosis, Gain, Named, separating
from .search import Explanation
from .evidence.bench import with_tolerances
from .study import MOVING, VAGUE, Study, begin, look

Array = NDArray[np.float64]
CHANGING = 1e-9  # chance that noise makes as much of a change with time; 2e-6 where it is 1.4 times louder than its law says
PATCHED = 0.985  # share that several causes must take away if sensors still share a residual, and any cause if something changes too
WHOLE = 0.94  # share of several causes from which on a residual beyond chance may be of their form
ENOUGH = 0.85  # share of the avoidable residual that named causes must take away to be an explanation at all
IDLE = 3.0  # chi2 that a free start state gains though nothing moves: 1, and twice its deviation
DOUBT = 6.0  # standard deviations of chi2 that count as a discrepancy
DAMPED = 0.2  # a hidden mass with more damping is no part on rubber, whose loss factor is 0.4 at most: it stands for some other dynamics
MAIN = 0.5  # of the gain: causes that do less without a drift of the clocks only stand in for it
LATE = 0.008  # of a sample: less delay than that is no fault of a sensor
UNSEEN = 1.5  # times the noise: a hold-out that is that far off, where training showed nothing, is of another vehicle
FARTHER = 0.02  # share of samples outside of what was trained, from which a hold-out says little about a name
# What is positive by its nature: a cause of which that is not sure stands for something else. Others are unsure for a bent curve.
SIZES = {"tyre_damping": "damping", "coulomb_friction": "force", "bouc_wen": "force", "maxwell_bushing": "stiffness", "hidden_resonance": "frequency"}
SURE = 8.0  # chi2 for each gain, by which several together are sure
AGAIN = 3  # times that bursts are looked for in what is left without them
SEARCH = 0.15, 0.8  # where in the whole work the search begins and ends, about


def diagnose(
    model: Model, train: Sequence[Measured], holdout: Sequence[Measured] = (), output: Path | None = None,
    set_name: str = "default", log: Callable[[str], None] = lambda text: None,
    tell: Callable[[float, str], None] = lambda share, doing: None,
) -> Diagnosis:  # fmt: skip
    """Name what the model gets wrong in `train`, and measure on `holdout` what knowing it gains; with `output`, write
    model_extended.toml there. `log` hears what is tried, `tell` which share of the work is done and what comes next."""
    started = time.perf_counter()
    log = advancing(log, tell)
    tell(0.0, "fitting the model as it is")
    plain, model = model, with_tolerances(model)
    both = with_shared_rails([*train, *holdout])
    train, holdout = both[: len(train)], both[len(train) :]
    experiments, unused, remarks = settled(model, train, holdout, set_name)
    if problems := plausible.misfits(model, [*experiments, *unused], set_name):
        raise UserError(*problems)
    study, other, bursts = unburst(model, experiments, set_name)
    faults = broken_sensors(model, train, study, study.null.simulated, bursts)
    if weighed.supports(model) and any(p.tolerance > VAGUE for p in model.parameters.values()):
        answer = by_innovations(replace(study, model=plain), None, unused, output, remarks, log, tell)
        return replace(answer, data=recorded(train, holdout), seconds=time.perf_counter() - started)
    tell(SEARCH[0], "looking for causes")
    study, explanations = search.search(study, log)
    study, explanations = resting(study, other, explanations, log)
    best = explanations[0] if explanations else None
    if weighed.misfit(study, best.fit if best else study.null, log):
        answer = by_innovations(replace(study, model=plain), best, unused, output, remarks, log, tell)
        if answer.verdict != "partly_explained" or best and share(study, best) > ENOUGH:  # less, and it may have no name at all
            return replace(answer, data=recorded(train, holdout), seconds=time.perf_counter() - started)
    if best is not None:  # bursts and spikes that a cause explains were none
        kept = [b & wild for b, wild in zip(bursts, still_wild(study, best, bursts))]
        rails = {f.where for f in faults if f.kind == "sensor_clipping"} - {f.where for f in faults if f.kind == "sensor_dropout"}
        again = broken_sensors(model, train, study, best.fit.simulated, kept)  # a cause may clip as well: then a rail looks like a drop-out
        faults = [f for f in again if f.kind != "sensor_dropout" or f.where not in rails]
    tell(SEARCH[1], "weighing them against numerics")
    study = replace(study, seen=look(study, best.fit if best else study.null))
    numbers, step = numerics.numerics(study)
    left = best.fit if best else study.null
    alike, shared = noise.correlation(study.experiments, study.metrics, left.simulated)
    log(f"correlation {alike:.1f}, shared {shared:.0f}")
    tone = tones.tone(study.experiments, study.metrics, left.simulated)
    log(str(tone))
    change = steady.change(study, left, study.seen)
    log(str(change))
    fades = best is not None and any(kind == "damper_fading" for kind, _ in best.groups)  # which changes by its nature
    changed = change.gain if change.surprise > -np.log(CHANGING) and not fades else 0.0
    causes, verdict, explained, evidence = judge(study, explanations, faults, alike, shared, tone.detected, changed)
    doubt = plausible.doubt(study, best, verdict)
    behind = not doubt and verdict != "unexplained" and best is not None and pitching(best) and echo.echo(study, best.fit).detected
    if doubt or behind:
        causes, verdict = (Cause(OUTSIDE, "", {}, 0.5),), "unexplained"
    if step is not None and not any(c.kind == OUTSIDE for c in causes):
        causes, verdict = (*causes, step), "explained"
    drift = sum(t.gain for t in best.terms if t.candidate.kind == CLOCK) if best else 0.0
    notes = [*remarks, *filter(None, [plant.placeless(study.places)])]
    notes += hints(study, explanations, verdict, bool(behind), change if changed else None, tone, drift)
    gain: dict[str, Gain] = {}
    named = None  # what has no name does not go into a model
    if not any(c.kind == OUTSIDE for c in causes):
        idle = search.explain(study, []) if best is None or not causes else None
        sized, named = search.mended(study, best, log) if idle is None else (idle, idle)
        causes = tuple(resized(study, sized, c) for c in causes)
    unnamed = nameless.fitted(study, best) if verdict == "unexplained" and not doubt and not drift else None
    if unnamed is not None and unused:
        tell(0.83, "fitting what has no name")
        worse = extension.measure(study, extension.extend_file(study, unnamed, causes)[1], unused)[0].values()
        unnamed = None if any(g.after_rmse > 1.01 * g.before_rmse for g in worse) else unnamed
    named = named or unnamed
    if unnamed is not None:
        explained = nameless.share(study, unnamed.fit)
        notes.append(f"a small network beside {nameless.beside(study, unnamed)} takes a part of it, and has no name")
    elif verdict == "unexplained":
        explained = 0.0
    study = replace(study, model=plain)  # what the file does not state is not written down
    text, extended = extension.extend_file(study, named, causes)
    held: list[residual.Channel] = []
    if holdout:
        tell(0.85, "measuring the gain")
        lost = {c.where for c in causes if c.kind == "sensor_dropout"}
        gain, more, held = extension.measure(study, extended, unused, lost)
        worse = [s for s, g in gain.items() if g.after_rmse > 1.05 * g.before_rmse]
        fitted = [c for c in causes if c not in faults]  # the others are seen in the samples, not by a simulation
        if fitted and any(gain[s].after_rmse > UNSEEN * gain[s].noise_floor and gain[s].outside < FARTHER for s in worse):
            told = " and ".join(f"{c.kind} at {c.where}" for c in fitted)
            notes.append(f"{told} would explain the training, but makes {', '.join(worse)} of the hold-out worse: train with more excitations")
            causes, verdict, explained, named, unnamed = (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", 0.0, None, None
        elif worse and not causes:
            told = f"make {', '.join(worse)} of the hold-out worse: left as they were"
            notes.append(f"parameters that fit the training within their tolerances {told}")
            named = unnamed = None
        else:
            notes += [f"{s} gets worse by the extended model: do not use it" for s in worse]
        if worse and named is None:
            text, extended = extension.extend_file(study, named, causes)
            gain, more, held = extension.measure(study, extended, unused)
        notes += more
        unseen = [s for s, g in gain.items() if g.after_rmse > UNSEEN * g.noise_floor] if not causes else []
        if unseen:
            causes, verdict, explained = (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", 0.0
            notes.append(f"{', '.join(unseen)}: the hold-out shows what the training does not: train with recordings like it")
    if output is not None:
        extended = write_extended(text, model, output)
    absorbed: dict[str, object] = {}
    if learnt := absorb.taught(study, named) if named is not None and named.terms else []:
        absorbed, more = absorbing(study, named, learnt, unused, output)
        notes += more
    tell(0.9, "showing what is wrong")
    whole = named is not None and (named is unnamed or best is not None and bool(causes))
    shown = residual.show(study, named.fit if whole else None, extended if whole else None, held, verdict == "unexplained")
    causes = tuple(replace(c, separate=separating(c)) for c in causes)
    return Diagnosis(
        verdict, causes, gain, numbers, explained, evidence, alike, tuple([doubt] * bool(doubt) + notes), recorded(train, holdout),
        shown.numbers(), absorbed, alternatives(causes), time.perf_counter() - started, shown=shown,
    )  # fmt: skip


def unburst(
    model: Model, experiments: Sequence[Experiment], set_name: str
) -> tuple[Study, Study, list[NDArray[np.bool_]]]:
    """The two studies of `begin` without bursts of samples that are far out, and these bursts: a fit that they have misled does not show
    all of them."""
    study, other = begin(model, experiments, set_name)
    bursts = more = dropouts.bursts(study.experiments, study.null.simulated)
    for _ in range(AGAIN):
        if not any(b.any() for b in more):
            break
        study, other = begin(model, [replace(e, good=e.good & ~b) for e, b in zip(study.experiments, more)], set_name)
        more = dropouts.bursts(study.experiments, study.null.simulated)
        bursts = [b | m for b, m in zip(bursts, more)]
    return study, other, bursts


def resting(
    study: Study, other: Study, explanations: list[Explanation], log: Callable[[str], None]
) -> tuple[Study, list[Explanation]]:
    """Study and explanations at rest, where recordings that seem to start in motion are likelier to start at rest with other causes."""
    if not study.moving:
        return study, explanations
    equals = [e for e in explanations if e.score > explanations[0].score - search.NEW]
    other, found = search.at_rest(other, study, equals, log)
    if not found:
        return study, explanations
    costs = [s.nothing - (e[0].score if e else 0.0) for s, e in ((study, explanations), (other, found))]
    log(f"at rest {costs[1]:.0f}, moving {costs[0]:.0f}")
    losses = [s.nothing - max((x.gain for x in e), default=0.0) for s, e in ((study, equals), (other, found[:1]))]
    same = set(found[0].groups) in (set(e.groups) for e in equals)
    starts = len(study.model.states) * len(study.experiments)
    return (other, found) if rested(losses, costs, same, starts, search.numbers(found[0])) else (study, explanations)


def hints(
    study: Study, explanations: Sequence[Explanation], verdict: str, behind: bool, change: steady.Change | None, tone: tones.Tone,
    drift: float,
) -> list[str]:  # fmt: skip
    """Notes on what is left: motion that comes late (`behind`), what changes with time, masses, a tone, a drift of clocks."""
    notes = []
    if behind:
        notes.append("what is left follows the motion late, as the rear axle of a vehicle that pitches does")
    if change is not None and verdict == "unexplained":
        notes.append(f"{change.what} of {change.place} changes while it is measured: a controller, a leak?")
    if verdict == "unexplained" and explanations:
        masses = [cause(study, explanations, g) for g in explanations[0].groups if g[0] == "hidden_resonance"]
        notes += damped([c for c in masses if worth(study, c)])
    if tone.detected:
        own = study.model.sensors[tone.sensor].name
        notes.append(f"{own} has a tone of its own at {tone.frequency:.0f} Hz, or around it: an engine, a wheel, the mains?")
    if drift:
        notes.append(f"clocks of sensors and inputs drift apart by {1e6 * abs(drift):.3g} ppm: put both on one clock")
    return notes


def rested(losses: Sequence[float], costs: Sequence[float], told: bool, starts: int, loads: int) -> bool:
    """Did recordings start at rest? Losses, and what they cost with the causes, [in motion, at rest], whether the causes are the same,
    how many start states are free in motion, and how many numbers are of loads that take their place at rest, two of which any load has.
    Where the start states gain no more than noise gives them nothing moved, though it costs a load."""
    return losses[1] < losses[0] + IDLE * (starts - max(loads - 2, 0)) or not told and costs[1] < costs[0] + MOVING * starts


def absorbing(
    study: Study, e: Explanation, learnt: list[absorb.Taught], unused: Sequence[Experiment], output: Path | None
) -> tuple[dict[str, object], list[str]]:
    """The same effect as a parameter set: what goes into diagnosis.json, and a note."""
    with tempfile.TemporaryDirectory() as folder:
        place = output or Path(folder)
        beside = Path(os.path.relpath(study.model.path.resolve(), place.resolve()))
        model = penode_gen.load(absorb.write(study, e, learnt, beside, place))
        gain = extension.measure(study, model, unused, (), absorb.SET)[0] if unused else {}
    names = ", ".join(t.element for t in learnt)
    said = {"file": absorb.FILE, "set": absorb.SET, "networks": {t.port: {"missing": t.missing} for t in learnt}, "gain": gain}
    after = ", ".join(f"{k} {g.after_rmse:.3g} {g.unit}" for k, g in gain.items())
    note = f"{names} can learn it: {absorb.FILE} has a set for the code that runs already"
    return said, [note + f"; hold-out after: {after}" * bool(after)]


def advancing(log: Callable[[str], None], tell: Callable[[float, str], None]) -> Callable[[str], None]:
    """A log of the search that tells progress too. How many fits are to come is not known: each takes a share of the rest."""
    done = SEARCH[0]

    def both(text: str) -> None:
        nonlocal done
        done += 0.12 * (SEARCH[1] - done)
        tell(done, "looking for causes")
        log(text)

    return both


def judge(
    study: Study, explanations: Sequence[Explanation], faults: list[Cause], alike: float, shared: float, pure: bool, changed: float = 0.0
) -> tuple[tuple[Cause, ...], str, float, float]:
    """Causes, verdict, share explained, and the evidence that there is anything at all; `alike`, `shared`: see
    noise.correlation; `pure`: a tone is left; `changed`: chi2 of what changes with time, if that is beyond chance."""
    rows = search.rows(study)
    excess = study.null.cost - rows
    evidence = excess / np.sqrt(2.0 * rows)
    if not explanations:
        if evidence > DOUBT and excess > 0.15 * rows or alike > noise.ALIKE or pure or changed:
            return (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", 0.0, evidence
        verdict = "explained" if faults else "not_identifiable" if evidence > DOUBT else "no_discrepancy"
        return tuple(faults), verdict, 1.0, evidence
    best = explanations[0]
    left = max(best.fit.chi2 - rows, shared if alike > noise.ALIKE else 0.0, 0.0)  # in the noise that the best explanation leaves
    gained, part = study.null.cost - best.fit.cost, share(study, best, left)
    if part < ENOUGH and (left > max(DOUBT * np.sqrt(2.0 * rows), 0.15 * rows) or alike > noise.ALIKE):
        return (Cause(OUTSIDE, "", {}, 1.0 - part),), "unexplained", part, evidence
    shown = alike > noise.ALIKE or part < WHOLE and left > DOUBT * np.sqrt(2.0 * rows)
    patched = len(best.groups) > 1 and part < PATCHED and shown  # several causes, and still no whole
    twice = changed and alike > noise.ALIKE and part < PATCHED  # by two proofs something is left
    if patched or twice or changed > (1.0 - PATCHED) * gained:
        return (Cause(OUTSIDE, "", {}, 1.0 - part),), "unexplained", part, evidence
    masses = [t for t in best.terms if t.candidate.kind == "hidden_resonance"]
    if len(masses) > 1 and len(best.groups) == 1 and search.explain(study, masses[:1]).gain < search.FILTER * best.gain:
        return (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", part, evidence
    others = [t for t in best.terms if t.candidate.kind != CLOCK]
    if not others or len(others) < len(best.terms) and search.explain(study, others).gain < MAIN * best.gain:
        return (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", part, evidence
    causes = [cause(study, explanations, group) for group in best.groups if group[0] != CLOCK]
    causes = [c for c in causes if worth(study, c)]
    if any(unsized(best, c) for c in causes):
        return (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", part, evidence
    kinds = [c.kind for c in causes]  # several wrong parameters are another vehicle, several delays another clock
    several = max(kinds.count("wrong_parameter"), kinds.count("sensor_delay")) > 1
    if several or damped(causes):
        return (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", part, evidence
    faulty = {(c.kind, c.where) for c in causes}
    causes += [f for f in faults if (f.kind, f.where) not in faulty]
    whole = (part > search.WHOLE or left < 0.15 * rows) and not pure
    return tuple(causes), ("explained" if whole else "partly_explained") if causes else "no_discrepancy", part, evidence


def share(study: Study, e: Explanation, left: float = 0.0) -> float:
    """Of the avoidable residual that an explanation takes away, 0 to 1; `left`: chi2 at least of what it leaves."""
    left, gained = max(e.fit.chi2 - search.rows(study), left), study.null.cost - e.fit.cost
    return gained / (gained + left) if gained + left > 0.0 else 1.0


def pitching(e: Explanation) -> bool:
    """Might pitch pass for it? Several causes that lag."""
    return len(e.groups) > 1 and {kind for kind, _ in e.groups} <= echo.LAGGING


def damped(causes: Sequence[Cause]) -> list[str]:
    """A line on each hidden mass whose damping is more than that of a part on rubber."""
    said = []
    for c in (c for c in causes if c.kind == "hidden_resonance"):
        v = {k: p.value for k, p in c.parameters.items()}
        if v["damping_ratio"] > DAMPED:
            like = f"a mass of {v['mass']:.3g} kg at {v['frequency']:.3g} Hz with a damping ratio of {v['damping_ratio']:.2f}"
            said.append(f"what {c.where} lacks is like {like}, too much for a part on rubber: pitch, roll, an occupant, a load that moves?")
    return said


def resized(study: Study, e: Explanation, c: Cause) -> Cause:
    """A cause with its parameters in another explanation, if it is in there: where more of the rest is explained, it need not
    make up for that."""
    group = (c.kind, c.where)
    own = [t for t in e.terms if t.group == group]
    if not own or c.kind == "hidden_resonance" and len(own) > 1:  # which share what one was
        return c
    return replace(c, parameters=naming.values(study, e, group))


def unsized(e: Explanation, c: Cause) -> bool:
    """May the size of a cause be nothing? Not where that is a stiffness in series with a damper: it follows from a time that may be too
    short to be known, though the laws together are sure."""
    if c.kind not in SIZES or c.parameters[SIZES[c.kind]].ci95[0] > 0.0:
        return False
    laws = {n: t.candidate.what for t, n in zip(e.terms, e.built.names) if t.group == (c.kind, c.where)}
    if not any(isinstance(what, Basis) and what.law == "loose_damper" for what in laws.values()):
        return True
    gains = {f"{name}_{what.gain[0]}" for name, what in laws.items()}
    at = [i for i, f in enumerate(e.fit.free) if f.target in gains]
    size = np.array([e.fit.free[i].value / e.fit.free[i].unit for i in at])
    return float(size @ np.linalg.pinv(e.fit.covariance()[np.ix_(at, at)]) @ size) < SURE * len(at)


def worth(study: Study, c: Cause) -> bool:
    """Is a cause large enough to be one? Significance is not size."""
    p = {k: v.value for k, v in c.parameters.items()}
    match c.kind:
        case "sensor_scale":
            return abs(p["scale"] - 1.0) > 0.005
        case "constant_force":
            low, high = c.parameters["force"].ci95
            return low * high > 0.0
        case "sensor_delay":
            return p["delay"] > LATE * study.model.sample_time
        case "wrong_parameter":
            return all(abs(v / study.model.parameters[k].value - 1.0) > study.model.parameters[k].tolerance for k, v in p.items())
        case "hidden_resonance":
            mass = next(study.model.parameters[b.mass].value for b in study.model.bodies if b.name == c.where)
            return p["mass"] > 0.002 * mass
    return True


def cause(study: Study, explanations: Sequence[Explanation], group: tuple[str, str]) -> Cause:
    """One group of the best explanation with parameters and alternatives."""
    best = explanations[0]
    others = []
    margin = np.inf
    for e in explanations[1:]:
        if group in e.groups:
            continue
        swapped = [g for g in e.groups if g not in best.groups and g[0] != CLOCK]
        behind = best.score - e.score
        margin = min(margin, behind)
        if len(swapped) == 1 and behind < max(50.0, 0.01 * best.gain) and swapped[0] not in others:
            others.append(swapped[0])
    scale = 2.0 + 0.002 * best.gain
    confidence = float(1.0 / (1.0 + np.exp(-min(margin, 50.0 * scale) / scale)))
    return Cause(*group, naming.values(study, best, group), confidence, tuple(Named(*o) for o in others[:3]))
