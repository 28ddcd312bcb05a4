# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Advice on the next step after a diagnosis: separate rivals, adopt the model or not, record missing data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from penode_gen.model import Model

from ..catalogue import channels, separating
from ..catalogue.drives import alike
from ..catalogue.experiments import proposed
from ..reliability import reliability
from ..result import OUTSIDE, Cause, Diagnosis, Named, place
from ..study.noise import UNSEEN

FARTHER = 0.02  # share of samples outside of the training, above which a hold-out is no evidence for a name


def likely(d: Diagnosis) -> list[Mapping[str, Any]]:
    """The sets of causes that hold 95 % of the posterior together, the likeliest first: more than one, and the data do not say which."""
    sets = sorted(d.explanations, key=lambda x: -x["posterior"])
    found: list[Mapping[str, Any]] = []
    total, held = sum(x["posterior"] for x in sets), 0.0
    for x in sets:
        if not found or held < 0.95 * total:
            found.append(x)
            held += x["posterior"]
    return found


@dataclass(frozen=True)
class Doubt:
    """A cause that the data do not separate from others, each with its posterior if known, and an experiment that would."""

    cause: Cause
    others: tuple[tuple[Named, float | None], ...]
    how: str

    def __str__(self) -> str:
        return ", ".join(place(n.kind, n.where) + (f" ({p:.0%})" if p is not None else "") for n, p in self.others)


def doubts(d: Diagnosis, model: Model | None = None) -> list[Doubt]:
    """Named causes with alternatives that the recordings do not rule out; explanations with little posterior are ignored. `model`: the
    plant that the experiments are for."""
    found = []
    for c in d.causes:
        others = tuple((a, p) for a in c.alternatives if (p := _posterior(d, a)) != 0.0)
        if others:
            found.append(Doubt(c, others, separating(c.kind, [n.kind for n, _ in others], model)))
    return found


def _posterior(d: Diagnosis, a: Named) -> float | None:
    """Posterior of the likeliest set that contains it; 0 if the other sets hold 95 %; None if no set contains it, because no data here can
    tell."""
    own = [x for x in d.explanations if any((c["kind"], c["where"]) == (a.kind, a.where) for c in x["causes"])]
    if not own:
        return None
    return max((float(x["posterior"]) for x in own if x in likely(d)), default=0.0)


def advised(d: Diagnosis, model: Model) -> Diagnosis:
    """A diagnosis of a model with what follows from it: what would tell its causes from others, how often such causes are right, what to do
    next."""
    causes = tuple(_with_alike(model, c) for c in d.causes)
    causes = tuple(replace(c, separate=separating(c.kind, [a.kind for a in c.alternatives], model)) for c in causes)
    d = replace(d, causes=causes)
    return replace(d, reliability=reliability(causes, d.explained), advice=advice(d, model))


def _with_alike(model: Model, c: Cause) -> Cause:
    """A cause with the alternative that nothing in these recordings could tell from it."""
    other = alike(model, c.kind, c.where)
    if other is None or Named(*other) in c.alternatives:
        return c
    return replace(c, alternatives=(Named(*other), *c.alternatives)[:3])


def advice(d: Diagnosis, model: Model | None = None) -> tuple[str, ...]:
    """What to do next with a plant, the most useful first."""
    first = [
        f"tell {place(x.cause.kind, x.cause.where)} from {' and '.join(place(n.kind, n.where) for n, _ in x.others)}: {x.how}"
        for x in doubts(d, model)
    ]
    return (*first, *_of_verdict(d), *_experiment(d, model), *_of_holdout(d))


def _of_verdict(d: Diagnosis) -> list[str]:
    if d.rejected:
        return [f"keep the nominal model: {d.model_file} predicts worse"] + (_where_to_look(d) if d.verdict == "unexplained" else [])
    if d.verdict == "no_discrepancy" and any(
        g.before_rmse > UNSEEN * g.noise_floor and g.after_rmse < g.before_rmse for g in d.gain.values()
    ):
        return ["use model_extended.toml: it is the model as fitted to the recordings"]
    if d.verdict == "no_discrepancy":
        return ["keep the model; record what it has to predict beyond these recordings before you use it there"]
    if d.verdict == "not_identifiable":
        return ["record again with more excitation: larger signals, more frequencies, all sensors of the model file"]
    if d.verdict == "unexplained":
        return _where_to_look(d)
    found = _take_over(d)
    if d.verdict == "partly_explained":
        found.append(
            f"look for the rest: {1.0 - d.explained:.0%} of the avoidable residual is unexplained; "
            "the report shows where and when it occurs"
        )
    return found


def _experiment(d: Diagnosis, model: Model | None) -> list[str]:
    """What to record where something is left to explain."""
    if model is None or d.verdict not in ("partly_explained", "unexplained", "not_identifiable"):
        return []
    return [f"record for the next diagnosis: {proposed(model, [c.kind for c in d.causes if c.kind != OUTSIDE])}"]


def _take_over(d: Diagnosis) -> list[str]:
    """Advice to correct channels and sensors, and to adopt the changes of the model."""
    mixes = [c for c in d.causes if c.kind in channels.KINDS]
    faults = [c for c in d.causes if c.kind.startswith("sensor_") and c not in mixes]
    doubtful = [(c, a.where) for c in faults for a in c.alternatives if a.kind.startswith("input_")]
    sure = [c for c in faults if all(c is not x for x, _ in doubtful)]
    driving = [c for c in d.causes if c.kind.startswith("input_") and c not in mixes]
    found = [f"{_corrected(c)} in the recordings; if the plant is wired so, model_extended.toml follows it" for c in mixes]
    found += [f"check {', '.join(dict.fromkeys(c.where for c in sure))}: the sensor is at fault, not the model"] if sure else []
    found += [f"check {c.where} and the channel of {where}: the recordings do not tell which of them is at fault" for c, where in doubtful]
    found += [f"check actuator and channel of {', '.join(dict.fromkeys(c.where for c in driving))}"] if driving else []
    if len(faults) + len(mixes) < len([c for c in d.causes if c.kind != OUTSIDE]):
        found.append("use model_extended.toml; penode generate makes its C")
    return found


def _corrected(c: Cause) -> str:
    """What to do about a channel of the other sign, or two that are exchanged."""
    a, _, b = c.where.partition(",")
    return f"exchange {a} and {b} (--channel {a}={b} --channel {b}={a})" if b else f"correct the sign of {a}"


def _where_to_look(d: Diagnosis) -> list[str]:
    places = d.residual.get("places") or []
    if not places:
        return ["compare signals and times of the largest residual in the report with what the plant did then"]
    shares = ", ".join(f"{p['place']} {p['share']:.0%}" for p in places[:3])
    return [
        f"look at {places[0]['place']} first: give it a law in the model file, "
        "or train a network there (penode train), and diagnose again; "
        f"share of the residual that a missing force could make up for: {shares}"
    ]


def _of_holdout(d: Diagnosis) -> list[str]:
    if not d.gain:
        return ["hold out a recording with --holdout: without one, nothing shows how far the model errs on new data"]
    beyond = max(g.outside for g in d.gain.values())
    return (
        [f"train on motion as large and fast as that of the hold-out: {beyond:.0%} of its samples go beyond the training"]
        if beyond > FARTHER
        else []
    )
