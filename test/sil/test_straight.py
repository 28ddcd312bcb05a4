# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A stiffness that is off behind an asymmetric spring: which slopes its parameter may be, and what a diagnosis names. Data come from an
integrator of this file."""

from __future__ import annotations

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest
from one_mass import STEP, model
from samples import sample

import penode_gen
from penode_sil.diagnosis.catalogue.form import Form, Motion, Moved, Part
from penode_sil.diagnosis.plant.plant import places
from penode_sil.diagnosis.search import parameters, straight

MASS, STIFFNESS, DAMPING = 2.0, 1800.0, 12.0
SENSORS = 'x = { value = "x", unit = "m", noise = 1e-5 }'


@pytest.mark.parametrize(
    "own, slopes, off",
    [
        (60.0, (0.0, 0.0), False),
        (63.5, (0.0, 0.0), True),  # 6 % where 5 % is allowed
        (63.5, (-2.0, 2.0), False),  # one side is within
        (75.0, (-2.0, 2.0), True),
        (45.0, (0.0, 20.0), False),  # the nominal value is that of some deflection
        (60.0, (14.0, 16.0), True),
    ],
)
def test_a_parameter_is_off_where_no_slope_is_that_of_the_file(own, slopes, off):
    assert straight.off(60.0, own, slopes, 0.05) is off


@pytest.mark.parametrize(
    "law, shapes, quantity, share", [("maxwell_bushing", {}, "s", 1.0), ("loose_damper", {"gap": (0.0, "m")}, "v", -1.0)]
)
@pytest.mark.parametrize("turn", (0.1, 0.5, 2.0))
def test_a_law_with_memory_has_the_slope_of_its_motion(law, shapes, quantity, share, turn):
    """In a sine of w tau = `turn`, (w tau)^2/(1 + (w tau)^2) of that in fast motion: more where it acts in parallel, less where it takes
    from an element. Of 100 periods, the start, which decays with tau, changes 1/(100 pi) of that at most."""
    tau = 0.05
    rate = turn / tau
    t = np.linspace(0.0, 200.0 * np.pi / rate, 200_001)
    gain = ("damping", "N*s/m") if quantity == "v" else ("stiffness", "N/m")
    motion = Motion.of([Moved(0.01 * np.sin(rate * t), 0.01 * rate * np.cos(rate * t), t)])
    slope = straight.slope_along(Part(law, gain, {**shapes, "relaxation": (tau, "s")}), motion, quantity)
    assert slope == pytest.approx(share * turn**2 / (1.0 + turn**2), abs=0.004)


@pytest.mark.parametrize("small, shares", [((), {}), (("a small form",), {"k": 0.4, "d": 0.4})])
def test_a_parameter_is_compared_with_the_laws_at_its_place(tmp_path, small, shares):
    """With the largest, where small forms show that curves are not the textbook's; forms of inputs are at no place."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.03, SENSORS))
    rig = penode_gen.load(tmp_path / "rig.toml")
    forms = (("coulomb_friction", "force", 0.4), ("cubic_spring", "force", 0.1), ("input_gain", "input_gain", 0.9))
    named = [SimpleNamespace(trial=SimpleNamespace(form=Form(kind, "there", how, 0), share=share)) for kind, how, share in forms]
    found = SimpleNamespace(named=named, small=small, plain=SimpleNamespace(places=places(rig)))
    assert parameters.laws_beside(rig, found) == shares


def recording(path, stiffness: float, difference: float, waves: float, quadratic: float = 0.0) -> None:
    """A mass on a spring that is softer in rebound by `difference`, with a sine of `waves` of its force, and a force `quadratic` x^2, under
    random tones up to 8 Hz: Heun in twentieths of a sample, whose error is (30/s 1e-4 s)^2/12, below 1e-6."""
    rng, n, fine = np.random.default_rng(3), 4000, 20
    tones, phases = rng.uniform(0.3, 8.0, 30), rng.uniform(0.0, 7.0, 30)
    t = np.arange(n * fine + 1) * STEP / fine
    u = (4.0 * np.sum(np.sin(2.0 * np.pi * tones[:, None] * t + phases[:, None]), axis=0)).tolist()
    h, x, v, seen = STEP / fine, 0.0, 0.0, []

    def rate(x, v, force):
        spring = (
            stiffness * x
            + 0.5 * difference * (x - abs(x))
            - 0.5 * difference * x
            + waves * stiffness * 0.01 * math.sin(x / 0.004)
            + quadratic * x * x
        )
        return (force - DAMPING * v - spring) / MASS

    for i in range(n * fine):
        if i % fine == 0:
            seen.append(x)
        a = rate(x, v, u[i])
        w = v + h * a
        x, v = x + 0.5 * h * (v + w), v + 0.5 * h * (a + rate(x + h * v, w, u[i + 1]))
    rows = np.column_stack([t[::fine][:n], u[::fine][:n], np.array(seen) + 1e-5 * rng.standard_normal(n)])
    np.savetxt(path, rows, delimiter=",", header="time [s],push [N],x [m]", comments="", fmt="%.9g")


@pytest.mark.parametrize("waves", sample((0.0, 0.03), 0.03))
def test_a_stiffness_behind_an_asymmetric_spring_is_named(tmp_path, penode, waves):
    """25 % more stiffness beside a difference of its sides: both are named, also where nothing else is missed, and innovations do not
    decide."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.03, SENSORS))
    recording(tmp_path / "train.csv", 1.25 * STIFFNESS, 0.3 * STIFFNESS, waves)
    penode("diagnose", tmp_path / "rig.toml", "--data", tmp_path / "train.csv", "-o", tmp_path / "out")
    causes = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["causes"]
    (found,) = (c for c in causes if c["kind"] == "wrong_parameter")
    value = found["parameters"]["k"]
    assert found is causes[0] and value["value"] == pytest.approx(1.25 * STIFFNESS, rel=0.06)
    assert "asymmetric_spring" in [c["kind"] for c in causes]


@pytest.mark.parametrize("difference", (0.02, 0.4))
def test_an_asymmetric_spring_about_the_stiffness_of_the_file(tmp_path, penode, difference):
    """The parameter is not named. Half of the difference is what bends, and abs(x) beside x of a normal motion has 0.6 of its rms: in all
    about half of the difference, and a note where that is small."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.03, SENSORS))
    recording(tmp_path / "train.csv", STIFFNESS, difference * STIFFNESS, 0.0)
    penode("diagnose", tmp_path / "rig.toml", "--data", tmp_path / "train.csv", "-o", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert [c["kind"] for c in found["causes"]] == ["asymmetric_spring"]
    shares = [float(n.split(": ")[1].split("%")[0]) for n in found["notes"] if n.startswith("asymmetric spring at spring is small")]
    assert len(shares) == (difference < 0.1) and all(0.3 * difference < 0.01 * x < 1.2 * difference for x in shares)


UNSEEN, ALONE = (5e-4, 0.0, []), (0.02, 0.0, ["k"])


@pytest.mark.parametrize("off, waves, named", sample((UNSEEN, ALONE, (0.0, 0.0, []), (0.02, 0.03, []), (0.15, 0.03, ["k"])), UNSEEN, ALONE))
def test_a_stiffness_without_a_tolerance(tmp_path, penode, off, waves, named):
    """Where nothing else is wrong it is named if it shows at all, with its value; in a world of waves of 3 % it may have taken these."""
    stated = f'value = {STIFFNESS}, unit = "N/m"'
    text = model(MASS, STIFFNESS, DAMPING, 0.03, SENSORS)
    (tmp_path / "rig.toml").write_text(text.replace(f"{stated}, tolerance = 0.03", stated))
    recording(tmp_path / "train.csv", (1.0 + off) * STIFFNESS, 0.0, waves)
    penode("diagnose", tmp_path / "rig.toml", "--data", tmp_path / "train.csv", "-o", tmp_path / "out")
    causes = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["causes"]
    assert [c["where"] for c in causes if c["kind"] == "wrong_parameter"] == named
    if waves == 0.0:
        assert len(causes) == len(named) and all(c["parameters"]["k"]["value"] == pytest.approx(1.02 * STIFFNESS, rel=1e-3) for c in causes)


def test_a_spring_that_is_stiffer_on_one_side_the_farther_it_goes(tmp_path, penode):
    """A force of k2 x^2: named as an asymmetric spring, with k2 to 3 %; two straight halves would leave a third of it."""
    (tmp_path / "rig.toml").write_text(model(MASS, STIFFNESS, DAMPING, 0.03, SENSORS))
    recording(tmp_path / "train.csv", STIFFNESS, 0.0, 0.0, quadratic=1.5e4)
    penode("diagnose", tmp_path / "rig.toml", "--data", tmp_path / "train.csv", "-o", tmp_path / "out")
    (found,) = json.loads((tmp_path / "out" / "diagnosis.json").read_text())["causes"]
    assert found["kind"] == "asymmetric_spring" and found["where"] == "spring"
    assert found["parameters"]["quadratic"]["value"] == pytest.approx(1.5e4, rel=0.03)
