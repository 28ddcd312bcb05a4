# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What the deployed step gets wrong by itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from penode_gen import units

from ...batch import Batch
from ..catalogue import others
from ..plant.plant import anonymous
from ..plant.stepped import run
from ..result import Cause, Value
from ..study.fit import Problem
from ..study.study import Study

COARSE = 0.02  # of a signal: what the deployed step may err by


def numerics(study: Study) -> tuple[dict[str, object], Cause | None]:
    """Error of the deployed step on the first training recording, against the exact solution of the same model with the same
    start and input; and the cause `integration_error` if that is more than COARSE of a signal and more than its noise."""
    model, e = study.model, replace(study.experiments[0], lead=0.0)
    fixed = tuple(f for f in study.null.free if f.target[0] == "start")
    start = np.array([next((f.value for f in fixed if f.target == ("start", 0, i)), x) for i, x in enumerate(model.start)])
    problem = Problem(model, [e], study.metrics[:1], study.set_name, study.linear.fastest)
    exact = problem.simulate(0, fixed, np.zeros((1, len(fixed))))[0][0]
    stepped = run(model, e, lambda m: Batch(anonymous(m)).run(e.drive, x0=start, set_name=study.set_name).z[0])
    found: dict[str, object] = {}
    parameters: dict[str, Value] = {}
    for j, s in enumerate(model.sensors):
        error, signal = float(np.sqrt(np.mean((stepped[:, j] - exact[:, j]) ** 2))), float(np.std(exact[:, j]))
        found[s.name] = {"rms_error": error, "unit": units.si(s.unit), "share_of_signal": error / signal if signal else 0.0}
        if error > COARSE * signal and error**2 > float(np.mean(study.levels[0][:, j])):
            parameters[f"rms_error_{s.name}"] = Value(error, units.si(s.unit), (error, error))
    return found, others.coarse(model.name, parameters) if parameters else None
