# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Real rigs in their own units: a pendulum without any input and a robot joint; models of guessed parameters; states and equations only."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import penode_gen
from penode_gen import expressions
from penode_gen.model import Parameter
from penode_sil.diagnosis.engine import experiment
from penode_sil.diagnosis.plant import placeless
from penode_sil.diagnosis.study import null_study, uncertain
from penode_sil.measured import load

HERE = Path(__file__).resolve().parent
MEASURED = Path(os.environ.get("PENODE_SHARED", HERE.parents[1].parent / "shared")) / "measured"
FILES = {"pendulum": ("swing_5.csv", "swing_6.csv"), "robot_joint": ("train.csv",)}


def rig(name: str, tmp_path: Path) -> penode_gen.Model:
    """The model of a rig; where the language has no sine yet, a linear one that is right for small angles."""
    text = (HERE / "models" / f"{name}.toml").read_text()
    path = tmp_path / f"{name}.toml"
    path.write_text(text if "sin" in expressions.FUNCTIONS else text.replace("sin(s)", "s"))
    return penode_gen.load(path)


@pytest.mark.parametrize("name", FILES)
def test_rigs(name, tmp_path):
    """Null fit of the model as it is, start states free. Held-out errors of quick fits by the ones who measured: some 10 mrad (small
    swings of the pendulum), 33.5 mrad (joint, linear): training is no worse, 15 and 40 mrad are allowed."""
    folder = MEASURED / name
    if not folder.is_dir():
        pytest.skip(f"no {folder}")
    model = rig(name, tmp_path)
    recordings = load([folder / f for f in FILES[name]], model)
    study = null_study(model, [experiment(m, model) for m in recordings])
    assert {p.name for p in study.places} == {"gravity"}
    limit = {"pendulum": 0.015, "robot_joint": 0.04}[name]
    for e, z in zip(study.experiments, study.null.simulated):
        assert np.sqrt(np.mean((e.y - z)[e.good] ** 2)) < limit


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
    """A cooling with tau = 2 s, whose file guesses 20 s: the fit finds it. Deviation of tau: noise/sqrt(sum of squares of dT/dtau) =
    0.01/sqrt(100*tau/4)/tau*tau^2... = 0.01*2/sqrt(50) s = 3 ms for a start that is known; 30 ms are allowed with a free one."""
    path = tmp_path / "cooling.toml"
    path.write_text(PLAIN.format(tau=20))
    model = penode_gen.load(path)
    t = np.arange(1000) * 0.01
    T = np.exp(-t / 2.0) + 0.01 * np.random.default_rng(1).standard_normal(1000)
    record = tmp_path / "cooling.csv"
    record.write_text("time [s],T [K]\n" + "".join(f"{a:.3f},{b:.6f}\n" for a, b in zip(t, T)))
    study = null_study(model, [experiment(m, model) for m in load([record], model)])
    assert study.places == () and abs(study.null.value("tau") - 2.0) < 0.03
    assert placeless(study.places) == "the model has no elements and no bodies: causes are looked for in its parameters and sensors"
