# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The table that an answer is checked with: of each sensor in each recording the error of the nominal model, of the same refitted as far as
its file allows, of the written extended one, and the noise; and the figures of the answer, taken from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from penode_gen import units

from ...errors import UserError
from ...predicted import Options, Predicted, both, known, read
from ...replay import Replay
from ..extend.beginning import begins_at_rest
from ..extend.measuring import achieved
from ..result import Diagnosis, Figure, Gain
from ..study.fit import Free, Problem, Target
from ..study.noise import UNSEEN, Experiment, metric
from ..study.residual import Channel, channels, noise_floor, noise_rms, stated_noise
from ..study.restoring import Surface, rms, surfaces
from ..study.study import Study, fitted, uncertain
from .case import Case, End

Array = NDArray[np.float64]
ROLES = ("training", "hold-out")


@dataclass(frozen=True, eq=False)
class Row:
    """A sensor in a recording: its number, sound samples [n] of the recording and their times in its file, and errors [n] of the three
    models."""

    figure: Figure
    sensor: int
    time: Array
    measured: Array
    errors: dict[str, Array]

    def rms(self, model: str) -> float:
        """Error of a model over sound samples, in SI."""
        return rms(self.errors[model])

    def rms_of(self, time: Array, z: Array) -> float:
        """Error of another prediction, at its own times."""
        return rms(self.measured - np.interp(self.time, time, z))


@dataclass(frozen=True, eq=False)
class Table:
    """All rows, what was predicted by nominal and extended model (by recording), and by which options of `penode simulate`."""

    rows: tuple[Row, ...]
    predicted: dict[str, tuple[Predicted, Predicted]]
    options: Options
    noise: Array  # [n_z] RMS, as the model file states it
    surfaces: tuple[Surface, ...]  # forces at all places with elements
    notes: tuple[str, ...]  # on recordings that `penode simulate` does not read

    def of(self, role: str) -> list[Row]:
        """Its rows of training or hold-out."""
        return [r for r in self.rows if r.figure.role == role]


def tabled(case: Case, end: End) -> Table:
    """The table of an end. Raises UserError."""
    study = end.study
    held = study.experiments[0].held is not None
    moving = study.moving or not all(begins_at_rest(end.extended, e, study) for e in case.unused)
    options = Options(study.set_name, case.channels, moving and bool(case.model.states), held, end.sets)
    recordings, notes = _read(case, options)
    options, pairs = both((case.nominal, end.extended), list(recordings.values()), options)
    of_path = dict(zip(recordings, pairs, strict=True))
    floor, noise = noise_rms(study), stated_noise(study)
    rows, predicted = [], {}
    refitted = _refitted(case, study)
    for role, ms, es in zip(ROLES, (case.train, case.holdout), (study.experiments, case.unused), strict=True):
        for m, e in zip(ms, es, strict=True):
            predicted[e.name] = of_path.get(str(m.path)) or of_path[m.title]
            rows += _rows(case, end, role, e, predicted[e.name], refitted[e.name], floor, m.part > 0)
    found = surfaces(study, end.extended if end.fit is not None else None, end.fit)
    return Table(tuple(rows), predicted, options, noise, tuple(found), tuple(notes))


def _read(case: Case, options: Options) -> tuple[dict[str, Replay], list[str]]:
    """All recordings, a file once, and notes on those that `penode simulate` does not read as they are: gaps, repeated times."""
    found: dict[str, Replay] = {}
    notes = []
    for m in (*case.train, *case.holdout):
        if str(m.path) in found:
            continue
        try:
            found[str(m.path)] = read(m, case.model, options)
        except UserError as exc:
            found[m.title] = known(m, case.model, options)
            if m.path.is_file():
                notes.append(f"penode simulate does not take {m.path.name}, whose errors are those of the diagnosis: {exc.problems[0]}")
    return found, list(dict.fromkeys(notes))


def _rows(
    case: Case, end: End, role: str, e: Experiment, pair: tuple[Predicted, Predicted], refitted: Array, floor: Array, part: bool
) -> list[Row]:
    """All sensors of a recording; `floor` [n_z]: noise. Of a `part` of a file, figures are errors of the same prediction over its own sound
    samples, for other parts may be learnt from."""
    nominal, extended = (p.at(e.time) for p in pair)
    dropped = {c.sensor: c.good for c in end.held if c.recording == e.name}
    rows, study_set = [], end.study.set_name
    for j, s in enumerate(case.model.sensors):
        good, name = dropped.get(s.name, e.good[:, j]), s.name
        if name not in pair[0].errors or not good.any():
            continue
        errors = {k: (e.y - z)[good, j] for k, z in (("nominal", nominal), ("refitted", refitted), ("extended", extended))}
        per = units.factor(s.unit)
        whole = {k: p.errors[name]["value"] for k, p in zip(("nominal", "extended"), pair, strict=True)}
        shown = {k: rms(errors[k]) / per for k in whole} if part else whole
        figure = Figure(
            e.name,
            role,
            name,
            s.unit,
            int(good.sum()) if part else pair[0].errors[name]["samples"],
            shown["nominal"],
            rms(errors["refitted"]) / per,
            shown["extended"],
            float(floor[j]) / per,
            end.sets.get(e.name, study_set),
        )
        rows.append(Row(figure, j, e.time[good], e.y[good, j], errors))
    return rows


def _refitted(case: Case, study: Study) -> dict[str, Array]:
    """Sensors [n, n_z] of every recording by the nominal model with parameters within the tolerances that its file states, fitted to the
    training, and with starts and offsets of sensors as each recording has them."""
    fitted_to = {f.target: f.value for f in study.null.free}
    stated = [uncertain(p) for p in case.model.parameters.values() if p.tolerance > 0.0 and p.value]
    free = [replace(f, value=float(np.clip(fitted_to.get(f.target, f.value), f.low, f.high))) for f in stated]
    problem = Problem(case.model, study.experiments, study.metrics, study.set_name, study.linear.fastest)
    fit = problem.solve([*free, *_starts(case, study, len(study.experiments), fitted_to)])
    found = dict(zip((e.name for e in study.experiments), fit.simulated, strict=True))
    model = fitted(case.model, fit.free)
    for e in case.unused:
        metrics = [metric(e, study.levels[0][:1].repeat(e.band, 0), np.zeros((e.band, len(model.sensors), len(model.inputs))))]
        one = Problem(model, [e], metrics, study.set_name, study.linear.fastest)
        found[e.name] = one.solve(_starts(case, study, 1, {})).simulated[0]
    return found


def _starts(case: Case, study: Study, count: int, fitted_to: Mapping[Target, float]) -> list[Free]:
    """Free starts of `count` recordings, and offsets of all sensors."""
    model = case.model
    free = [Free(("bias", j), 0.0, float(level)) for j, level in enumerate(noise_rms(study))]
    for e in range(count):
        free += [Free(("start", e, i), fitted_to.get(("start", e, i), x), 1e-3) for i, x in enumerate(model.start)]
    return free


# -- figures of the answer --------------------------------------------------------------------------------------------


def with_figures(case: Case, end: End, table: Table) -> tuple[Diagnosis, list[Channel], list[Channel]]:
    """The answer with figures of the table, and the channels of training and hold-out as nominal and written model predict them."""
    study, model = end.study, case.model
    train: list[Channel] = []
    for k, e in enumerate(study.experiments):
        after = table.predicted[e.name][1].at(e.time) if end.fit is not None else None
        train += channels(e, model, study.null.simulated[k], after, noise_floor(study, k))
    held: list[Channel] = []
    for e in case.unused:
        own = {c.sensor: c for c in end.held if c.recording == e.name}
        good = np.column_stack([own[s.name].good if s.name in own else e.good[:, j] for j, s in enumerate(model.sensors)])
        before, after = (p.at(e.time) for p in table.predicted[e.name])
        beyond = next((c.beyond for c in own.values()), None)
        held += channels(replace(e, good=good), model, before, after, noise_floor(study, 0), beyond)
    gain = {name: _gain(table, name, g) for name, g in end.answer.gain.items()}
    return (
        replace(
            end.answer,
            gain=gain,
            figures=tuple(r.figure for r in table.rows),
            simulated=str(table.options),
            notes=(*end.answer.notes, *table.notes),
        ),
        train,
        held,
    )


def _gain(table: Table, name: str, g: Gain) -> Gain:
    """The gain of a sensor by the errors of `penode simulate` on the hold-out."""
    own = [r for r in table.of("hold-out") if r.figure.signal == name]
    if not own:
        return g
    before, after = (_together(own, what) for what in ("nominal", "extended"))
    nominal, extended = (np.concatenate([r.errors[what] for r in own]) for what in ("nominal", "extended"))
    share, ci95 = achieved(nominal, extended, g.noise_floor)
    return replace(g, before_rmse=before, after_rmse=after, share_of_achievable=share, share_ci95=ci95)


def _together(rows: Sequence[Row], what: str) -> float:
    """RMS error over all samples of several recordings, in SI."""
    per, found = units.factor(rows[0].figure.unit), [(r.figure.samples, getattr(r.figure, what)) for r in rows]
    if len(found) == 1:
        return float(found[0][1] * per)  # to the digit
    return per * float(np.sqrt(sum(n * x**2 for n, x in found) / sum(n for n, _ in found)))


def misses(rows: Sequence[Row], model: str, noise: Array) -> set[int]:
    """Numbers of the sensors of which a model is off by more than their noise."""
    return {r.sensor for r in rows if r.rms(model) > UNSEEN * noise[r.sensor]}
