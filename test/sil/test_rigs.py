# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Real rigs in their own units: a pendulum without any input and a robot joint; models of guessed parameters; states and equations only."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_gen.model import Parameter
from penode_sil.diagnosis.plant.plant import placeless
from penode_sil.diagnosis.study.driven import experiment
from penode_sil.diagnosis.study.study import null_study, uncertain
from penode_sil.recordings.measured import load

HERE = Path(__file__).resolve().parent
MEASURED = Path(os.environ.get("PENODE_SHARED", HERE.parents[1].parent / "shared")) / "measured"
FILES = {"pendulum": ("swing_5.csv", "swing_6.csv"), "robot_joint": ("train.csv",)}


@pytest.mark.skipif(not MEASURED.exists(), reason="the measured data are not beside the checkout")
@pytest.mark.parametrize("name", FILES)
def test_rigs(name, show):
    """Null fit of the model as it is, start states free. Quick fits by the ones who measured, held out: up to 10 mrad (pendulum, small
    swings; half more is allowed to a model whose parameters were not fitted to this rig), 33.5 mrad (joint, linear)."""
    model = penode_gen.load(HERE / "models" / f"{name}.toml")
    recordings = load([MEASURED / name / f for f in FILES[name]], model)
    study = null_study(model, [experiment(m, model) for m in recordings])
    assert {p.name for p in study.places} == {"gravity"}
    limit = {"pendulum": 0.015, "robot_joint": 0.0335}[name]
    for e, z in zip(study.experiments, study.null.simulated, strict=True):
        left = float(np.sqrt(np.mean((e.y - z)[e.good] ** 2)))
        show(f"{name}: {left * 1e3:.2f} mrad")
        assert left < limit


def test_unknown_and_guessed_parameters():
    """Within its tolerance a parameter moves by differences, where it is only guessed or unknown by ratios: never through zero."""
    for tolerance, value in ((0.1, 5.0), (2.5, 5.0), (2.5, -5.0), (float("inf"), 5.0), (float("inf"), -5.0)):
        free = uncertain(Parameter("p", value, "1", tolerance))
        assert free.low < free.value < free.high
        assert free.log == (tolerance > 1.0)
        if free.log:
            near, far = sorted((abs(free.low), abs(free.high)))
            assert free.low * free.high > 0.0 and far / near > 10.0
        assert np.isinf(free.sigma) == np.isinf(tolerance)


PLAIN = """
[model]
name = "cooling"
sample_time = "10 ms"
[parameters]
tau = {{ value = {tau}, unit = "s", tolerance = "unknown" }}
[states]
T = {{ unit = "K", start = 1 }}
[equations]
cool = "der(T)*tau = -T"
[outputs]
T = {{ value = "T", unit = "K" }}
[sensors]
T = {{ value = "T", unit = "K", noise = 0.01 }}
"""


def test_states_and_equations_only(tmp_path):
    """A cooling with tau = 2 s, whose file guesses 20 s: the fit finds it. With T = A exp(-t/tau), both free, noise s and n samples a
    second, its information matrix is n/s^2 (tau/2, 1/4; 1/4, 1/(4 tau)): tau deviates by 4 ms, of which five are allowed."""
    path = tmp_path / "cooling.toml"
    path.write_text(PLAIN.format(tau=20))
    model = penode_gen.load(path)
    t = np.arange(1000) * 0.01
    T = np.exp(-t / 2.0) + 0.01 * np.random.default_rng(1).standard_normal(1000)
    record = tmp_path / "cooling.csv"
    record.write_text("time [s],T [K]\n" + "".join(f"{a:.3f},{b:.6f}\n" for a, b in zip(t, T, strict=True)))
    study = null_study(model, [experiment(m, model) for m in load([record], model)])
    assert study.places == () and abs(study.null.value("tau") - 2.0) < 0.02
    assert placeless(study.places) == "the model has no elements and no bodies: causes are looked for in its parameters and sensors"
