# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How much a term matters: its force beside the force at its place already, or the change of its input or sensor beside their motion."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from penode_gen.model import GROUND, Model

from ..catalogue.actuators import ACTUATORS
from ..catalogue.form import Motion
from ..evidence.bench import UPDATES, Bench
from ..evidence.fit import Fit
from . import clipping
from .terms import Term, drive, moves

Array = NDArray[np.float64]
WORTH = 0.07  # of the force there: less is a small deviation. Any model is 2 to 5 % wrong, a name is worth it from 10 % on; the middle
BENT = 0.6  # of a friction or a cube along a Gaussian motion is beside a straight line, in rms: sqrt(1 - 2/pi), sqrt(1 - 9/15)
Z_95 = 1.96  # standard deviations that hold 95 %
MIN_GAIN = 10.0  # log density by which a cause predicts left-out blocks better, at least
RATIO = 3.0  # times the unmodelled force that remains beside all causes: where that is little, a name is worth it from less on
KNOWN = 1.2  # times the noise that is known, about what it may be: it is another one at another time
SYSTEMATIC = 0.007  # of the force there: what mis-modelling of 3.5 % does to a form's size, like it to 0.2 in rms, one direction of 25
FINEST = 1e-3  # of a signal: no channel is calibrated better
LINEAR = {"linear_spring": "s", "linear_damper": "v"}  # laws that a refit of their parameter makes as large as they have to be
ABOUT_LINEAR = LINEAR | {"expression": "s"}  # and those that are about so


def least(level: float, taken: float) -> float:
    """Smallest share of the force there that has a name: RATIO times the unmodelled force beside all that was found (`level`), and not more
    than WORTH. Of a term that took nearly all (`alone`) it is where its interval would include zero."""
    return min(WORTH, Z_95 * systematic(level) if alone(taken) else RATIO * level)


def systematic(level: float) -> float:
    """What unmodelled forces of this share of all do to the size of a form, in its share of the force there."""
    return SYSTEMATIC * wrong(level)


def wrong(level: float) -> float:
    """How wrong a world is with an unmodelled force of this share of all: 1 from half of WORTH on, which SYSTEMATIC is of."""
    return min(2.0 * level / WORTH, 1.0)


def remaining(bench: Bench, run: Fit, stated: Array) -> float:
    """The unmodelled level beside all that was found, for `least` and `systematic`: none where a free `run` misses no sensor by more than
    noise; else that of the bench, or the largest share of a sensor's rms by which it does, if that is more. In a free run a small force
    that lasts shows, which an observer follows. Of white noise the means between updates have the less; of coloured noise [n_z], no more
    than is `stated`; noise of the inputs counts as it reaches the sensors at a sample, for its colour is not stated."""
    coloured = (bench.colour is not None and len(bench.colour.taps) > 0) | (stated > KNOWN * bench.noise)
    floor = np.where(coloured, np.maximum(stated, bench.noise) ** 2, bench.noise**2 / bench.update)
    floor = floor + bench.gains().driven(max(map(len, bench.records)))
    predictor = bench.problem().predictor
    nu = np.concatenate(predictor.predict(run.free, np.zeros((1, len(run.free))), run.by)[0].nu, axis=1)[0]
    signals = [np.concatenate([r.y[:, j] for r in bench.records]) for j in range(len(floor))]
    shares = [0.0]
    for x, y, noise in zip(nu.T, signals, floor, strict=True):
        x, power = x[np.isfinite(x)], float(np.nanvar(y)) if np.isfinite(y).any() else 0.0
        if len(x) and power > 0.0:
            beyond = float(np.mean(x**2)) - noise * (KNOWN**2 + 3.0 * np.sqrt(2.0 / len(x)))
            shares.append(float(np.sqrt(max(beyond, 0.0) / power)))
    return max(bench.level.size, *shares) if any(shares) else 0.0


def mostly(taken: float) -> bool:
    """Does a term that takes this share of the power take more than it leaves?"""
    return taken > 0.5


def alone(taken: float) -> bool:
    """Has a term that took this share of the power RATIO times the rms of the remaining residual?"""
    return taken > RATIO**2 / (1.0 + RATIO**2)


def share(bench: Bench, terms: Sequence[Term], fit: Fit, moved: Sequence[Motion]) -> float:
    """Rms of terms of one name as a share of the force at their place, of their input, or of their sensor: as much of it as nothing else
    that is free could do as well, a parameter, an offset, a start: in forces, and in what sensors show. How much of a line is whose is a
    matter of writing it down, so a force counts by what is left of it beside lines, and by how much of that is its own, for a resonance may
    show more of a line than of the rest; that of a bent curve over BENT."""
    form, targets = terms[0].form, [f.target for t in terms for f in t.free]
    if form.how == "clip":
        limit, *sharp = (next(f for f in fit.free if f.target == t) for t in targets)
        return clipping.share(bench, form, limit, *(f.value for f in sharp))
    if form.how == "force":
        motion = moved[form.index]
        force = np.sum([np.concatenate(_force(t, fit, motion)) for t in terms], axis=0)
        beside = _beside(bench, form.index, motion, force)
        bent = 1.0 if all(_linear(t, fit, motion) for t in terms) else BENT
        return _rms(beside) * own(bench.model, fit, targets, _lines(bench, form.index)) / (bent * motion.force) if motion.force else 0.0
    return max(_of_signal(bench, t, fit) for t in terms) * own(bench.model, fit, targets)


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))


def undetermined(model: Model, fit: Fit) -> set[str]:
    """Masses that deviate by more than they are: the recordings show forces as ratios to them only."""
    masses = {b.mass for b in model.bodies} & {f.target for f in fit.free if isinstance(f.target, str)}
    return {m for m in masses if fit.deviation(m) > abs(fit.value(m))}


def own(model: Model, fit: Fit, targets: Collection[object], lines: Collection[object] = ()) -> float:
    """Share of what free values off their origins do to the innovations that no other one can do, 0 to 1: of what is left of that beside
    `lines`, which are free too. Masses stay as they are, for all forces together with them are a scale that a sensor of motion does not
    show."""
    return float(own_of_sensors(model, fit, targets, lines)[-1])


def own_of_sensors(model: Model, fit: Fit, targets: Collection[object], lines: Collection[object] = ()) -> Array:
    """The same [n_z + 1] in what each sensor shows, then in all."""
    columns, others = _columns(model, fit, targets)
    done = columns @ np.array([(f.value - f.origin) / f.unit for f in fit.free if f.target in targets])
    if lines:
        straight = (fit.slopes[:, :, [f.target in lines for f in fit.free]] / np.sqrt(fit.variance)[None, :, None])[fit.used]
        straight = straight / np.maximum(np.linalg.norm(straight, axis=0), 1e-300)
        done = done - straight @ np.linalg.lstsq(straight, done, rcond=1e-9)[0]
    left = done - others @ np.linalg.lstsq(others, done, rcond=1e-9)[0]
    sensor = np.nonzero(fit.used)[1]
    masks = [*(sensor == j for j in range(fit.used.shape[1])), np.ones(len(done), bool)]
    return np.array([np.linalg.norm(left[m]) / max(float(np.linalg.norm(done[m])), 1e-300) for m in masks])


def confounded(model: Model, fit: Fit, targets: Collection[object]) -> dict[object, float]:
    """Those of `targets` whose effect others of them share in part, because the other free values reproduce what they do together; with the
    least values that have the rest of the effect. Without a spring to ground, an equal offset of all angle sensors is only another
    start."""
    columns, others = _columns(model, fit, targets)
    free = [f for f in fit.free if f.target in targets]
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left = columns / size
    left = left - others @ np.linalg.lstsq(others, left, rcond=1e-9)[0]
    _, seen, ways = np.linalg.svd(left, full_matrices=False)
    resolution = (
        ways[seen > SYSTEMATIC].T @ ways[seen > SYSTEMATIC]
    )  # of the fit: identity for what is seen by itself, 0 for what is not seen
    values = resolution @ (size * np.array([(f.value - f.origin) / f.unit for f in free])) / size
    return {
        f.target: float(f.origin + f.unit * x)
        for f, x, sole in zip(free, values, np.diag(resolution), strict=True)
        if SYSTEMATIC < sole < 1.0 - SYSTEMATIC
    }


def _columns(model: Model, fit: Fit, targets: Collection[object]) -> tuple[Array, Array]:
    """Whitened sensitivities [used, .] of the innovations: columns of `targets` per unit (0 for the logarithm of a parameter), and
    normalised columns of all other free values except masses."""
    masses = {b.mass for b in model.bodies} - set(targets)
    rows = (fit.slopes / np.sqrt(fit.variance)[None, :, None])[fit.used]
    own = [column * (not f.log) for f, column in zip(fit.free, rows.T, strict=True) if f.target in targets]
    rest = [
        column / np.linalg.norm(column)
        for f, column in zip(fit.free, rows.T, strict=True)
        if f.target not in targets and f.target not in masses and column.any()
    ]
    return np.array(own).T.reshape(len(rows), -1), np.array(rest).T.reshape(len(rows), -1)


def shift(model: Model, bench: Bench, moved: Sequence[Motion], name: str) -> float:
    """The share of the force there that changes with a parameter as fitted instead of as in the file, which nothing else explains:
    of a linear law, as a share of the force at its place; of others, of the parameter itself."""
    off = bench.fit.value(name) - model.parameters[name].value
    shares = []
    for e in model.elements:
        if e.law in LINEAR and name in e.arguments.values():
            _place, motion = next((p, m) for p, m in zip(bench.places, moved, strict=True) if any(e.name == n for n, _ in p.elements))
            if motion.force > 0.0:
                shares.append(abs(off) * (motion.s_rms if LINEAR[e.law] == "s" else motion.v_rms) / motion.force)
    log = next(f.log for f in bench.fit.free if f.target == name)
    return max(shares, default=abs(off / model.parameters[name].value)) * (1.0 if log else own(bench.model, bench.fit, [name]))


def _beside(bench: Bench, place: int, motion: Motion, force: Array) -> Array:
    """A force [n] without what the straight laws at its place could take over, or the mass of a body that it ties to ground."""
    names, ends = {n for n, _ in bench.places[place].elements}, bench.places[place].ends
    lines = {ABOUT_LINEAR[e.law] for e in bench.model.elements if e.name in names and e.law in ABOUT_LINEAR}
    columns = [np.concatenate([getattr(p, q) for p in motion.parts]) for q in sorted(lines)]
    driven = any(moves(bench, j) for j in range(len(bench.model.inputs)))  # in a free motion, forces are a line of the acceleration
    if names and driven and GROUND in ends and any(b.name in ends and not bench.model.parameters[b.mass].exact for b in bench.model.bodies):
        columns.append(np.concatenate([np.gradient(p.v, p.step) for p in motion.parts]))
    others = np.array([c / max(float(np.linalg.norm(c)), 1e-300) for c in columns]).T.reshape(len(force), -1)
    left: Array = force - others @ np.linalg.lstsq(others, force, rcond=None)[0]
    return left


def _lines(bench: Bench, place: int) -> list[str]:
    """Parameters of the straight laws at a place."""
    names = {n for n, _ in bench.places[place].elements}
    return [p for e in bench.model.elements if e.name in names and e.law in LINEAR for p in e.arguments.values()]


def _force(term: Term, fit: Fit, motion: Motion) -> list[Array]:
    """Of all parts of a term along every recording."""
    total = [np.zeros(len(m.s)) for m in motion.parts]
    for gain, part in term.laws(fit.values):
        total = [x + gain * part.along(m) for x, m in zip(total, motion.parts, strict=True)]
    return total


def _linear(term: Term, fit: Fit, motion: Motion) -> bool:
    """Is its force twice as large, and of the other sign, along a motion that is: a spring and a damper in series, a hidden mass?"""
    twice = replace(motion, parts=tuple(replace(m, s=-2.0 * m.s, v=-2.0 * m.v) for m in motion.parts))
    once, other = (np.concatenate(_force(term, fit, m)) for m in (motion, twice))
    return bool(_rms(other + 2.0 * once) < SYSTEMATIC * _rms(other))


def _of_signal(bench: Bench, term: Term, fit: Fit) -> float:
    value = fit.value(term.free[0].target)
    turn = 2.0 * np.pi / (UPDATES * bench.update * bench.step)  # of the motion [rad/s]
    own = ACTUATORS.get(term.form.how)
    if own and (own.by_change or not own.small):
        return own.change(drive(bench, term.form.index), value)
    if own and own.size[1] == "1":
        return abs(value)
    match term.form.how:
        case "scale":
            return abs(value - 1.0)
        case "input_added" if term.form.series:
            return abs(value) * _rms(np.concatenate(list(term.form.series.signals))) / drive(bench, term.form.index).spread
    return abs(value) * turn
