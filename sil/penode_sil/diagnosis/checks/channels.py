# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Before a search: is the sign of a channel the other one, or are two alike exchanged? A finding is corrected in the model, for the search
to go on with, and is the first cause of its answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

import penode_gen
from penode_gen import units
from penode_gen.model import Model

from ...errors import RecordingError
from ..catalogue import channels
from ..extend import applied
from ..extend.entries import extends, table
from ..reliability import trust
from ..result import OUTSIDE, Cause, Diagnosis
from ..study.fit import Free, Problem
from ..study.noise import Experiment, Metric, metric
from ..study.study import guessed, uncertain
from .plausible import LITTLE, UNLIKE

Array = NDArray[np.float64]
Samples = TypeVar("Samples", Array, NDArray[np.bool_])


@dataclass(frozen=True)
class Mix:
    """What may be wrong with inputs or sensors (`numbers`): the sign of one, or two are exchanged."""

    driving: bool
    numbers: tuple[int, ...]

    @property
    def kind(self) -> str:
        """What the catalogue calls it."""
        return channels.kind(self.driving, len(self.numbers))

    def names(self, model: Model) -> list[str]:
        """The channels that are wrong."""
        return [(model.inputs if self.driving else model.sensors)[k].name for k in self.numbers]

    def mended(self, e: Experiment) -> Experiment:
        """The recording as it should be."""
        own, order = list(self.numbers), list(self.numbers[::-1])
        sign = -1.0 if len(own) == 1 else 1.0

        def put(x: Samples) -> Samples:
            x = x.copy()
            x[:, own] = sign * x[:, order] if x.dtype != bool else x[:, order]
            return x

        if self.driving:
            held = None if e.held is None else put(e.held[None, :])[0]
            return replace(e, u=put(e.u), drive=put(e.drive), rate=put(e.rate), held=held)
        return replace(e, y=put(e.y), good=put(e.good))


def mixed(model: Model, experiments: Sequence[Experiment], set_name: str) -> list[Mix]:
    """What is wrong with channels, nothing where the model follows all of them as they are: each explains most of the misfit, and no
    values of parameters explain as much."""
    metrics = [_metric(model, e) for e in experiments]
    found: list[Mix] = []
    for _ in (*model.inputs, *model.sensors):  # one after the other
        missed, worth = _missed(model, experiments, metrics, set_name, False)
        if not np.nanmax(missed, initial=0.0) > LITTLE * LITTLE:
            break
        tried = [m for m in _all(model, experiments) if m not in found]
        looks = [_missed(model, [m.mended(e) for e in experiments], metrics, set_name, False) for m in tried]
        good = [k for k, (left, w) in enumerate(looks) if w < worth and _explains(tried[k], missed, left)]
        if not good:
            break
        best = tried[min(good, key=lambda k: looks[k][1])]
        mended = [best.mended(e) for e in experiments]
        if not _missed(model, mended, metrics, set_name, True)[1] < _missed(model, experiments, metrics, set_name, True)[1]:
            break
        found, experiments = [*found, best], mended
    return found


def _all(model: Model, experiments: Sequence[Experiment]) -> list[Mix]:
    """Signs of inputs and sensors, and alike pairs; a single sensor has the sign of its input."""
    shown = [j for j in range(len(model.sensors)) if all(e.good[:, j].any() for e in experiments)]
    found = [Mix(True, (k,)) for k in range(len(model.inputs))]
    if len(shown) > 1 or not model.inputs:
        found += [Mix(False, (j,)) for j in shown]
    for driving, signals, own in ((True, model.inputs, range(len(model.inputs))), (False, model.sensors, shown)):
        alike = [p for p in combinations(own, 2) if units.same_dimension(signals[p[0]].unit, signals[p[1]].unit)]
        found += [Mix(driving, p) for p in alike]
    return found


def _explains(m: Mix, before: Array, after: Array) -> bool:
    """Does it leave less than half of the power of each sensor that it is about, and a quarter of the misfit there? An input is about
    all sensors: a quarter of the misfit of the sensor that shows it most, and no larger misfit of any."""
    own = np.isfinite(before) if m.driving else np.isin(np.arange(len(before)), m.numbers)
    before, after = before[own] + LITTLE * LITTLE, after[own] + LITTLE * LITTLE
    most = [np.argmax(before)] if m.driving else slice(None)
    enough = np.all(after[most] < UNLIKE * UNLIKE * before[most])
    return bool(enough and np.all(after < UNLIKE) and np.all(after <= before))


def _metric(model: Model, e: Experiment) -> Metric:
    """Equal weight of all samples, relative to the signal of each sensor."""
    power = np.array([max(LITTLE * LITTLE * _power(e, j), 1e-300) for j in range(len(model.sensors))])
    return metric(e, np.tile(power, (e.band, 1)), np.zeros((e.band, len(power), len(model.inputs))))


def _power(e: Experiment, j: int) -> float:
    """Power of a sensor about its mean; 1 if it is constant."""
    y = e.y[e.good[:, j], j]
    return float(np.var(y)) or 1.0 if y.size else 1.0


def _missed(model: Model, experiments: Sequence[Experiment], metrics: Sequence[Metric], set_name: str, free: bool) -> tuple[Array, float]:
    """Share of each sensor's power [n_z] that the model misses with starts as they fit best, NaN where none was measured, and the sum of
    their logarithms, in which less than LITTLE does not count. `free`: parameters may have any value of their sign."""
    values = [p for p in model.parameters.values() if p.value and not p.exact and (free or p.name in guessed(model))]
    wide = [Free(p.name, p.value, abs(p.value), log=True, sigma=abs(p.value), origin=p.value) for p in values]
    starts = [Free(("start", e, i), x, 1e-3) for e in range(len(experiments)) for i, x in enumerate(model.start)]
    problem = Problem(model, experiments, metrics, set_name)
    z = problem.solve([*(wide if free else map(uncertain, values)), *starts], 6).simulated if wide or starts else problem.at(()).simulated
    left = np.full(len(model.sensors), np.nan)
    for j in range(len(left)):
        pairs = [((e.y - s)[e.good[:, j], j], _power(e, j)) for e, s in zip(experiments, z, strict=True) if e.good[:, j].any()]
        if pairs:
            left[j] = sum(float(np.sum(np.minimum(r * r / p, 1e12))) for r, p in pairs) / sum(r.size for r, _ in pairs)
    return left, float(np.nansum(np.log(left + LITTLE * LITTLE)))


# -- in the model and the answer --------------------------------------------------------------------------------------


def mending(model: Model, found: Sequence[Mix], folder: Path) -> Model:
    """The model that measures and drives as the recordings do, in `folder`. RecordingError where its file cannot be written so."""
    text = "\n".join(
        [
            "[model]",
            extends(model.path.resolve()),
            "",
            *(line for title, entries in _sections(model, found).items() if entries for line in (f"[{title}]", *entries, "")),
        ]
    )
    path = folder / "model_mended.toml"
    path.write_text(text)
    try:
        mended = penode_gen.load(path)
    except penode_gen.ModelError:
        raise RecordingError(*(_refused(m, model) for m in found)) from None
    order = list(range(len(model.sensors)))
    for m in found:
        for k, other in zip(m.numbers, m.numbers[::-1], strict=True) if not m.driving else ():
            order[k] = other
    sensors = tuple(replace(s, noise=model.sensors[k].noise) for s, k in zip(mended.sensors, order, strict=True))
    return replace(mended, inputs=model.inputs, sensors=sensors)


def _refused(m: Mix, model: Model) -> str:
    names = m.names(model)
    if len(names) > 1:
        return f"{' and '.join(names)} are exchanged; say --channel {names[0]}={names[1]} --channel {names[1]}={names[0]}"
    return f"{names[0]} has the opposite sign of the model; correct its sign in the recording"


def _sections(model: Model, found: Sequence[Mix]) -> dict[str, list[str]]:
    """Entries of a model file that extends the model's."""
    driven = applied.Driven(applied.names(model))
    shown = {s.name: (s.expression, s.noise) for s in model.sensors}
    for m in found:
        names = m.names(model)
        if m.driving and any(applied.bound(model, name) for name in names):
            raise RecordingError(_refused(m, model))
        alone = len(names) == 1
        if m.driving and alone:
            acts, sign = driven.name(f"{names[0]}_acts"), driven.name(f"{names[0]}_sign")
            driven.parameters.append(f"{sign} = {table({'value': -1, 'unit': '1', 'exact': True})}")
            driven.actuators.append(f"{acts} = {table({'input': names[0], 'law': 'gain', 'gain': sign})}")
            driven.acts[names[0]] = acts
        elif m.driving:
            driven.acts |= {names[0]: names[1], names[1]: names[0]}
        elif alone:
            shown[names[0]] = (f"-({shown[names[0]][0]})", shown[names[0]][1])
        else:
            shown[names[0]], shown[names[1]] = shown[names[1]], shown[names[0]]
    moved = applied.redirected(model, driven, {})
    sensors, outputs = [], {o.split(" = ")[0]: o for o in moved["outputs"]}
    for s in model.sensors:
        expression, noise = shown[s.name]
        if (text := driven.through(expression)) != s.expression:
            sensors.append(f"{s.name} = {table({'value': text, 'unit': s.unit, 'noise': noise / units.factor(s.unit)})}")
            outputs |= {o.name: f"{o.name} = {table({'value': text, 'unit': o.unit})}" for o in model.outputs if o.name == s.name}
    return {
        "parameters": [*driven.parameters, *moved["parameters"]],
        "actuators": driven.actuators,
        "elements": moved["elements"],
        "equations": moved["equations"],
        "outputs": list(outputs.values()),
        "sensors": sensors,
    }


def with_mixes(model: Model, found: Sequence[Mix], d: Diagnosis) -> Diagnosis:
    """The answer of a search with corrected channels; the faults of the channels are its first causes."""
    own = tuple(Cause(m.kind, ",".join(m.names(model)), {}, trust(d.explained)) for m in found)
    if not own:
        return d
    names = [{"kind": c.kind, "where": c.where} for c in own]
    sets = tuple({**s, "causes": [*names, *s["causes"]]} for s in d.explanations) or ({"causes": names, "posterior": own[0].confidence},)
    causes = (*own, *(c for c in d.causes if c.kind != OUTSIDE))
    verdict = "explained" if d.verdict in ("explained", "no_discrepancy") else "partly_explained"
    return replace(d, causes=causes, explanations=sets, verdict=verdict)
