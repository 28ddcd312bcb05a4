# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Do recordings belong to a model at all? Wrong units and signs are errors; another plant's data get no names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from penode_gen import units
from penode_gen.model import Model

from ..study.fit import Free, Problem
from ..study.noise import Experiment
from ..study.study import Study, guessed

Array = NDArray[np.float64]
MIXED = (  # factor that a wrong unit makes, what is mixed up, units of signals that it happens to
    (1000.0, "mm and m", ("m", "m/s", "m/s^2", "N")),
    (100.0, "cm and m", ("m", "m/s", "m/s^2")),
    (39.3701, "inch and m", ("m",)),
    (9.80665, "g and m/s^2", ("m/s^2",)),
)
NEAR = 0.14  # of a factor, in its logarithm: what else is wrong with a model changes the ratio by less
ALIKE = 0.9  # correlation of measured and simulated signals that differ by a factor only
POOR = 0.1  # share of a signal's power that the model must miss before another plant is thought of
FAR = 0.1  # a parameter that is so much off, and 3 tolerances, is another one
LITTLE = 0.05  # of the residual of the nominal plant: an explanation that leaves more is none
UNLIKE = 0.5  # share of a signal's power that the model misses, beyond which the signal may not be of its plant


def misfits(model: Model, experiments: Sequence[Experiment], set_name: str) -> list[str]:
    """A line for each signal whose unit or sign contradicts the model, which is simulated as the file has it."""
    if guessed(model):
        return []
    problem = Problem(model, experiments, [], set_name)
    found = []
    for k, e in enumerate(experiments):
        z = problem.simulate(k, (), np.zeros((1, 0)))[0][0]
        ratios = [off_by(e.y[:, j], z[:, j], e.good[:, j]) for j in range(len(model.sensors))]
        pairs = [(s, r) for s, r in zip(model.sensors, ratios, strict=True) if r is not None]
        lines = [_line(e.name, s.name, known) for s, r in pairs if (known := mixed(r, s.unit))]
        alike = len(pairs) > 1 and all(r / pairs[0][1] > 0.0 and abs(np.log(r / pairs[0][1])) < NEAR for _, r in pairs)
        if lines and alike and len(model.inputs) == 1 and (known := mixed(1.0 / pairs[0][1], model.inputs[0].unit)):
            lines = [_line(e.name, model.inputs[0].name, known)]  # rather the input than all sensors
        found += lines
    return found


def off_by(y: Array, z: Array, good: NDArray[np.bool_]) -> float | None:
    """How many times its simulation z a signal y is, without their means; None if they are not alike."""
    y, z = (x[good] - np.mean(x[good]) if good.any() else x[good] for x in (y, z))
    size = float(np.linalg.norm(y) * np.linalg.norm(z))
    alike = float(y @ z) / size if np.isfinite(size) and size > 0.0 else 0.0
    return float(np.sign(alike) * np.linalg.norm(y) / np.linalg.norm(z)) if abs(alike) > ALIKE else None


def mixed(ratio: float, unit: str) -> tuple[float, str] | None:
    """The ratio of a wrong unit and the two units, if one is near; -1 for a sign; or None."""
    for factor, what, kinds in MIXED:
        for exact in (factor, 1.0 / factor):
            if abs(np.log(abs(ratio) / exact)) < NEAR and any(units.same_dimension(unit, kind) for kind in kinds):
                return exact, what
    return (-1.0, "") if ratio < 0.0 and abs(np.log(-ratio)) < NEAR else None


def _line(recording: str, name: str, known: tuple[float, str]) -> str:
    """What is wrong with a signal, where, and the remedy."""
    ratio, what = known
    if ratio < 0.0:
        return f"{recording}: {name} has the opposite sign of the model; correct its sign in the recording"
    times = f"{ratio:.4g} times" if ratio > 1.0 else f"1/{1.0 / ratio:.4g} of"
    wrong = f"{recording}: {name} is {times} what fits the model, like {what}"
    return f"{wrong}; correct its unit, or say --channel {name}=NAME [UNIT]"


def missed(study: Study, simulated: Sequence[Array]) -> dict[str, float]:
    """Share of each measured signal's power that a simulation misses, beyond noise."""
    found = {}
    for j, sensor in enumerate(study.model.sensors):
        left = whole = 0.0
        for e, z, levels in zip(study.experiments, simulated, study.levels, strict=True):
            y, good = e.y[:, j], e.good[:, j]
            left += float(np.sum((y - z[:, j])[good] ** 2 - np.mean(levels[:, j])))
            whole += float(np.sum((y[good] - np.mean(y[good])) ** 2)) if good.any() else 0.0
        if whole > 0.0:
            found[sensor.name] = max(left / whole, 0.0)
    return found


def doubt(study: Study, after: Sequence[Array]) -> str:
    """What to say of unexplained recordings if they are of another plant, or not of this model at all, even as it was extended to give the
    simulation `after`; empty if they may well be."""
    misses = missed(study, study.null.simulated)
    if max(misses.values(), default=0.0) < POOR:
        return ""
    problem = other_plant(study)
    if not problem and max(misses.values()) > UNLIKE and max(missed(study, after).values()) > UNLIKE:
        shares = ", ".join(f"{max(0.0, 1.0 - share):.0%} of {name}" for name, share in misses.items())
        problem = f"the model explains {shares}; check that the signals were recorded together, and with this plant"
    return problem


def other_plant(study: Study) -> str:
    """What to say if other parameters all over the model leave little."""
    parameters = {p.name: p for p in study.model.parameters.values() if p.tolerance > 0.0 and p.value > 0.0}
    free = [f for f in study.null.free if f.target not in parameters]
    free += [
        Free(p.name, p.value, p.value, log=True, sigma=p.value, origin=p.value, low=p.value / 30.0, high=30.0 * p.value)
        for p in parameters.values()
    ]
    fastest = 4.0 * study.linear.fastest
    fit = Problem(study.model, study.experiments, study.metrics, study.set_name, fastest).solve(free, 15)
    ratios = {f.target: f.value / f.origin for f in fit.free if f.target in parameters}
    far = {k: r for k, r in ratios.items() if abs(np.log(r)) > max(FAR, 3.0 * parameters[k].tolerance)}
    rows = len(fit.residual)
    if len(far) < 2 or fit.chi2 > rows + LITTLE * (study.null.chi2 - rows):
        return ""
    texts = ", ".join(f"{r:.2f} times its {k}" for k, r in far.items())
    return f"the data seem to be of another plant, with {texts}; name the model file of that plant"
