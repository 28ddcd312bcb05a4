# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The whole way from recordings to a named, measured improvement."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen import units
from penode_gen.model import Model

from ..measured import Measured
from . import extension, naming, noise, search
from .noise import Experiment
from .result import Cause, Diagnosis, Gain, Named, Value
from .search import Explanation
from .study import MOVING, SKEW, Study, begin, look

Array = NDArray[np.float64]
FEW = 5  # bad samples of a sensor that make a fault of it
ENOUGH = 0.85  # share of the avoidable residual that named causes must take away to be a whole explanation
DOUBT = 6.0  # standard deviations of chi2 that count as a discrepancy
DAMPED = 0.45  # a hidden mass with more damping than that has no resonance: it stands for some other dynamics
OUTSIDE = "outside_taxonomy"


def experiment(m: Measured, model: Model) -> Experiment:
    """A recording as the diagnosis sees it; sensors that it does not have count as not good."""
    n, names = len(m.time), [s.name for s in model.sensors]
    y = np.column_stack([m.z.get(k, np.zeros(n)) for k in names])
    good = np.column_stack([m.mask.get(k, np.zeros(n, bool)) for k in names])
    laws = [m.quality.channels[k].noise if k in m.quality.channels else None for k in names]
    declared = np.array([i.noise for i in model.inputs])
    return noise.prepare(m.title, m.time, m.u, np.where(good, y, 0.0), good, declared, laws)


def diagnose(
    model: Model, train: Sequence[Measured], holdout: Sequence[Measured] = (), output: Path | None = None,
    set_name: str = "default", log: Callable[[str], None] = lambda text: None,
) -> Diagnosis:  # fmt: skip
    """Name what the model gets wrong in `train`, and measure on `holdout` what knowing it gains; with `output`, write
    model_extended.toml there."""
    started = time.perf_counter()
    experiments = [experiment(m, model) for m in train]
    study, other = begin(model, experiments, set_name)
    bursts = noise.bursts(study.experiments, study.null.simulated)
    if any(b.any() for b in bursts):
        study, other = begin(model, [replace(e, good=e.good & ~b) for e, b in zip(study.experiments, bursts)], set_name)
    faults = broken_sensors(model, train, study, bursts)
    study, explanations = search.search(study, log)
    if study.moving and search.at_rest(other, study):
        other, found = search.search(other, log)
        costs = [e[0].fit.cost - e[0].score + e[0].gain if e else s.null.cost for s, e in ((study, explanations), (other, found))]
        log(f"at rest {costs[1]:.0f}, moving {costs[0]:.0f}")
        if costs[1] < costs[0] + MOVING * len(model.states) * len(experiments):
            study, explanations = other, found
    best = explanations[0] if explanations else None
    if best is not None:  # bursts that a cause explains were none
        kept = [b & wild for b, wild in zip(bursts, still_wild(study, best, bursts))]
        faults = broken_sensors(model, train, study, kept)
    study = replace(study, seen=look(study, best.fit if best else study.null))
    numbers, step = extension.numerics(study)
    causes, verdict, explained, evidence = judge(study, explanations, faults)
    if step is not None and not any(c.kind == OUTSIDE for c in causes):
        causes, verdict = (*causes, step), "explained"
    notes: list[str] = []
    gain: dict[str, Gain] = {}
    named = best if best is not None and any(c.kind not in (OUTSIDE, "sensor_clipping", "sensor_dropout") for c in causes) else None
    text, extended = extension.extend_file(study, named, causes)
    if output is not None:
        output.mkdir(parents=True, exist_ok=True)
        nominal = model.path.resolve()
        beside = Path(os.path.relpath(nominal, output.resolve()))  # so that both can be moved together
        (output / "model_extended.toml").write_text(text.replace(extension.extends(nominal), extension.extends(beside), 1))
        extended = penode_gen.load(output / "model_extended.toml")
    if holdout:
        gain, notes = extension.measure(study, extended, [experiment(m, model) for m in holdout])
    return Diagnosis(
        verdict, causes, gain, numbers, explained, evidence, tuple(notes), time.perf_counter() - started
    )


def still_wild(study: Study, e: Explanation, bursts: Sequence[NDArray[np.bool_]]) -> list[NDArray[np.bool_]]:
    """Per recording, whether the bursts of each sensor [1, n_z] are as wild beside an explanation as they were without."""
    found = []
    for k, b in enumerate(bursts):
        b = b[: len(study.experiments[k].time)]
        sums = [np.sum(np.where(b, (study.experiments[k].y - f.simulated[k]) ** 2, 0.0), axis=0) for f in (e.fit, study.null)]
        found.append((sums[0] > 0.5 * sums[1])[None, :])
    return found


def broken_sensors(model: Model, train: Sequence[Measured], study: Study, bursts: Sequence[NDArray[np.bool_]]) -> list[Cause]:
    """Sensors that clip or drop out, by what their samples show and the model agrees with: it goes on where they stop."""
    found = []
    for j, sensor in enumerate(model.sensors):
        unit = units.si(sensor.unit)
        clipped, dropped, total, limit = 0, 0, 0, 0.0
        for k, m in enumerate(train):
            channel = m.quality.channels.get(sensor.name)
            if channel is None:
                continue
            n = len(study.experiments[k].time)
            total += n
            sigma = float(np.sqrt(np.mean(study.levels[k][:, j])))
            flagged = ~m.mask[sensor.name][:n]
            off = np.abs(m.z[sensor.name][:n] - study.null.simulated[k][:, j]) > 4.0 * sigma
            if channel.saturated:
                clipped += channel.saturated
                limit = max(limit, *(abs(x) for x in (channel.low, channel.high) if x is not None))
            lost = channel.held + channel.missing + channel.spikes
            if lost and (channel.missing or np.count_nonzero(flagged & off) > 0.2 * lost):
                dropped += lost
            dropped += int(np.count_nonzero(bursts[k][:n, j])) if len(bursts) > k else 0
        if clipped >= FEW:
            found.append(Cause("sensor_clipping", sensor.name, {"limit": Value(limit, unit, (0.998 * limit, 1.002 * limit))}, 0.99))
        if dropped >= FEW:
            share = dropped / total
            found.append(Cause("sensor_dropout", sensor.name, {"share": Value(share, "1", (0.9 * share, 1.1 * share))}, 0.99))
    return found


def judge(study: Study, explanations: Sequence[Explanation], faults: list[Cause]) -> tuple[tuple[Cause, ...], str, float, float]:
    """Causes, verdict, share explained, and the evidence that there is anything at all."""
    rows = len(study.null.residual) * float(np.mean([np.mean(e.good) for e in study.experiments]))
    excess = study.null.cost - rows
    evidence = excess / np.sqrt(2.0 * rows)
    if not explanations:
        if evidence > DOUBT and excess > 0.15 * rows:
            return (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", 0.0, evidence
        return tuple(faults), "explained" if faults else "no_discrepancy", 1.0, evidence
    best = explanations[0]
    left = max(best.fit.chi2 - rows, 0.0)
    share = best.gain / (best.gain + left) if best.gain + left > 0.0 else 1.0
    if share < ENOUGH and left > max(DOUBT * np.sqrt(2.0 * rows), 0.15 * rows):
        return (Cause(OUTSIDE, "", {}, 1.0 - share),), "unexplained", share, evidence
    causes = [cause(study, explanations, group) for group in best.groups]
    causes = [c for c in causes if worth(study, c)]
    if any(c.kind == "hidden_resonance" and c.parameters["damping_ratio"].value > DAMPED for c in causes):
        return (Cause(OUTSIDE, "", {}, 0.5),), "unexplained", share, evidence
    faulty = {(c.kind, c.where) for c in causes}
    causes += [f for f in faults if (f.kind, f.where) not in faulty]
    return tuple(causes), "explained" if causes else "no_discrepancy", share, evidence


def worth(study: Study, c: Cause) -> bool:
    """Is a cause large enough to be one? Significance is not size."""
    p = {k: v.value for k, v in c.parameters.items()}
    match c.kind:
        case "sensor_scale":
            return abs(p["scale"] - 1.0) > 0.005
        case "sensor_delay":
            return p["delay"] > 2.0 * SKEW * study.model.sample_time
        case "wrong_parameter":
            return all(abs(v / study.model.parameters[k].value - 1.0) > study.model.parameters[k].tolerance for k, v in p.items())
        case "hidden_resonance":
            mass = next(study.model.parameters[b.mass].value for b in study.model.bodies if b.name == c.where)
            return p["mass"] > 0.005 * mass
    return True


def cause(study: Study, explanations: Sequence[Explanation], group: tuple[str, str]) -> Cause:
    """One group of the best explanation with parameters and alternatives."""
    best = explanations[0]
    others = []
    margin = np.inf
    for e in explanations[1:]:
        if group in e.groups:
            continue
        swapped = [g for g in e.groups if g not in best.groups]
        behind = best.score - e.score
        margin = min(margin, behind)
        if len(swapped) == 1 and behind < max(50.0, 0.01 * best.gain) and swapped[0] not in others:
            others.append(swapped[0])
    scale = 2.0 + 0.002 * best.gain
    confidence = float(1.0 / (1.0 + np.exp(-min(margin, 50.0 * scale) / scale)))
    return Cause(*group, naming.values(study, best, group), confidence, tuple(Named(*o) for o in others[:3]))
