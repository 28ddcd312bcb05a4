# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a fitted curve is called, and the sizes read from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis import naming, sized
from penode_sil.diagnosis.build import Term
from penode_sil.diagnosis.hypotheses import STRIBECK, Basis, Motion
from penode_sil.diagnosis.score import Candidate

REACH, SPEED = 0.02, 0.5  # m, m/s
KNEE = "-k*(max(v - knee, 0) + min(v + knee, 0))"
HUMP = "2.3316439815971242*k*exp(-(v/width)^2)*v/width"


def term(kind: str, law: str, gain: str, shapes: Mapping[str, float] = MappingProxyType({})) -> Term:
    basis = Basis(kind, 0, law, (gain, ""), {k: (x, "") for k, x in shapes.items()}, 1, ())
    return Term(Candidate(kind, "spring", 1, False, basis), 1.0)


def named(rule, *laws: tuple[str, str, str, dict[str, float]]) -> str:
    """What a rule calls the sum of laws: kind, law, gain, and its shapes with the gain."""
    terms = [term(kind, law, gain, {k: x for k, x in shapes.items() if k != gain}) for kind, law, gain, shapes in laws]
    names = [f"x{i}" for i in range(len(laws))]
    values = {f"x{i}_{k}": x for i, (_, _, _, shapes) in enumerate(laws) for k, x in shapes.items()}
    return rule(terms, names, values, REACH, SPEED)


@pytest.mark.parametrize(
    "rise, width, kind",
    [
        (0.5, 0.05, "stribeck_friction"),
        (0.05, 0.05, "coulomb_friction"),  # a twentieth more at rest is what a form of hysteresis leaves
    ],
)
def test_friction_that_falls_is_stribecks(rise, width, kind):
    law = ("stribeck_friction", STRIBECK, "force", {"force": 20.0, "knee": 1e-3, "width": width, "rise": rise})
    assert named(naming._friction, law) == kind


@pytest.mark.parametrize("rise, kind", [(0.0, "coulomb_friction"), (0.5, "stribeck_friction")])
@pytest.mark.parametrize("damping", [-20.0, 0.0, 20.0])
def test_a_damper_beside_friction_does_not_make_it_fall(damping, rise, kind):
    """However much of that damper is in its curve, 10 N at the greatest rate, and though its laws are those of a damper."""
    law = ("stribeck_friction", STRIBECK, "force", {"force": 12.0, "knee": 1e-3, "width": 0.05, "rise": rise})
    beside = ("stribeck_friction", "linear_damper", "damping", {"damping": damping})
    assert named(naming._friction, law, beside) == kind
    knee = ("degressive_damper", KNEE, "k", {"k": 12.0 / 0.015, "knee": 0.015})
    hump = ("degressive_damper", HUMP, "k", {"k": 12.0 * rise, "width": 0.03})
    line = ("degressive_damper", "linear_damper", "damping", {"damping": damping + 12.0 / 0.015})
    assert named(naming._damper, knee, hump, line) == kind


@pytest.mark.parametrize("share, kind", [(0.04, "coulomb_friction"), (0.1, "degressive_damper"), (0.3, "degressive_damper")])
def test_a_knee_at_the_lowest_rates_is_friction(share, kind):
    """By the share of the rates below it, though the force goes on to grow; both rules have the same limit."""
    k = 20.0 / (share * SPEED)
    laws = [("damper", KNEE, "k", {"k": k, "knee": share * SPEED}), ("damper", "linear_damper", "damping", {"damping": k + 10.0})]
    assert named(naming._damper, *laws) == named(naming._friction, *laws) == kind


@pytest.mark.parametrize("damping", [-10.0, 0.0, 30.0])
def test_the_force_of_friction_is_where_its_line_begins(damping):
    """However much of the damper beside it is in its curve."""
    laws = [
        ("coulomb_friction", "coulomb_friction", {"force": 20.0, "transition": 1e-3}),
        ("coulomb_friction", "linear_damper", {"damping": damping}),
    ]
    terms = [
        term("coulomb_friction", law, next(iter(shapes)), {k: x for k, x in shapes.items() if k == "transition"}) for _, law, shapes in laws
    ]
    values = {f"x{i}_{k}": x for i, (_, _, shapes) in enumerate(laws) for k, x in shapes.items()}
    study = SimpleNamespace(model=None, places=[None])
    e = SimpleNamespace(terms=terms, built=SimpleNamespace(names=["x0", "x1"]))
    force = sized.functions(study, e, ("coulomb_friction", "spring"), REACH, SPEED)["force"][1]
    assert force(values) == pytest.approx(20.0, rel=1e-9)


def test_a_little_that_yields_is_no_hysteresis():
    """Where an element yields far with a fifth of its friction it is friction; where all of it does, hysteresis."""
    stiff = ("coulomb_friction", "coulomb_friction", "force", {"force": 20.0, "transition": 1e-3})

    def yielding(force):
        return ("bouc_wen", "bouc_wen", "force", {"force": force, "presliding": 0.003})

    assert named(naming._friction, stiff, yielding(5.0)) == "coulomb_friction"
    assert named(naming._friction, yielding(5.0)) == "bouc_wen"
    hump = ("coulomb_friction", HUMP, "k", {"k": 20.0, "width": 0.5})  # friction of a gain of its own counts as well
    assert named(naming._friction, hump, yielding(5.0)) != "bouc_wen"


@pytest.mark.parametrize("width, kind", [(0.02, "stribeck_friction"), (0.25, "degressive_damper")])
def test_friction_is_there_at_once(width, kind):
    """A force that comes with the rate, as that of a damper, and goes again is no friction: at a twentieth of the rates a width of
    half of them has a quarter of its greatest force."""
    assert named(naming._friction, ("stribeck_friction", HUMP, "k", {"k": 5.0, "width": width})) == kind


@pytest.mark.parametrize(
    "gaps, kind",
    [
        ((0.4, 0.5), "bump_stop"),
        ((0.1, 0.1), "cubic_spring"),  # on both sides, and nearly from the middle: it hardens
        ((0.1,), "asymmetric_spring"),
    ],
)
def test_a_stop_leaves_room(gaps, kind):
    sides = ("bump_stop", "rebound_stop")
    laws = [("bump_stop", law, "stiffness", {"stiffness": 1e4, "gap": g * REACH}) for law, g in zip(sides, gaps, strict=False)]
    assert named(naming._spring, *laws) == kind


@pytest.mark.parametrize("stiffness, gap, kind", [(500.0, 0.33, "cubic_spring"), (3e3, 0.33, "cubic_spring"), (1e5, 0.33, "bump_stop")])
def test_a_law_that_corrects_the_form_of_a_stop_does_not_set_its_gap(stiffness, gap, kind):
    """Squares from a fifteenth of the reach on, 174 N at its end on either side; a stop beside one of them has 7, 40 and 1340 N."""
    square = {"k": 5e5, "gap": REACH / 15.0}
    laws = [("bump_stop", law, "k", square) for law in ("k*max(s - gap, 0)^2", "-k*min(s + gap, 0)^2")]
    assert named(naming._spring, *laws, ("bump_stop", "bump_stop", "stiffness", {"stiffness": stiffness, "gap": gap * REACH})) == kind


@pytest.mark.parametrize("quadratic, law", [(1e-9, "linear_spring"), (2e5, "")])
def test_a_tyres_curve_that_is_a_straight_line_is_a_stiffness(quadratic, law):
    """Beside a line of 2 kN at the reach, nothing of a square is left, or 3 %."""
    laws = [("quadratic_spring", "quadratic", quadratic), ("linear_spring", "stiffness", 1e5)]
    terms = [term("tyre_nonlinear", law, gain) for law, gain, _ in laws]
    s = np.linspace(-REACH, REACH, 401)
    terms = [
        replace(t, candidate=replace(t.candidate, what=replace(t.candidate.what, series=(f,))))
        for t, f in zip(terms, (s * s, s), strict=True)
    ]
    values = {f"x{i}_{gain}": x for i, (_, gain, x) in enumerate(laws)}
    assert naming.straight(terms, ["x0", "x1"], terms[0].group, values) == law


@pytest.mark.parametrize("static, kind", [(0.4, "tyre_liftoff"), (1e-4, "tyre_nonlinear")])
def test_a_tyre_at_rest_bears_its_load(static, kind):
    """It loses the road where it is less pressed than at rest by all of that; what softens from rest on is bent."""
    law = ("tyre_liftoff", "liftoff", "stiffness", {"stiffness": 2e3, "static": static * REACH})
    assert named(naming._tyre, law) == kind


@pytest.mark.parametrize("relaxation", [1e-6, 1e-4, 1e-3, 1e-2])
def test_damping_of_a_tyre_that_lags(relaxation):
    """
    Spring and damper in series take from a sine the work of a damper of k tau / (1 + (omega tau)^2), whatever the samples.

    Of 40 samples a period the filter's lag is off by (omega h)^2 / 12 = 0.2 % and half a step; a start costs a period of 50.
    """
    step, omega, stiffness = 1e-3, 2.0 * np.pi * 25.0, 1e5
    t = step * np.arange(2000)
    motion = Motion(1e-3 * np.sin(omega * t), 1e-3 * omega * np.cos(omega * t), t)
    lagging = term("tyre_damping", "maxwell_bushing", "stiffness", {"relaxation": relaxation})
    study = SimpleNamespace(model=None, places=[None], seen=[SimpleNamespace(motions=[motion])])
    e = SimpleNamespace(terms=[lagging], built=SimpleNamespace(names=["x0"]))
    unit, damping = sized.functions(study, e, lagging.group, REACH, SPEED)["damping"]
    want = stiffness * relaxation / (1.0 + (omega * relaxation) ** 2)
    half = omega * step / 2.0 * omega * relaxation  # half a step of delay, as a part of what is in phase
    found = damping({"x0_stiffness": stiffness, "x0_relaxation": relaxation})
    assert unit == "N*s/m" and abs(found / want - 1.0) < half + 0.03


@pytest.mark.parametrize("quick, stiffness", [(2e-4, 1000.0), (4e-3, 51000.0)])
def test_what_relaxes_within_a_sample_is_no_part_of_a_bushings_stiffness(quick, stiffness):
    """It is a damper, whose stiffness nothing tells."""
    bushings = [term("maxwell_bushing", "maxwell_bushing", "stiffness", {"relaxation": tau}) for tau in (0.1, quick)]
    motion = Motion(np.zeros(9), np.zeros(9), np.arange(9.0))
    study = SimpleNamespace(model=SimpleNamespace(sample_time=1e-3), places=[None], seen=[SimpleNamespace(motions=[motion])])
    e = SimpleNamespace(terms=bushings, built=SimpleNamespace(names=["x0", "x1"]))
    _, found = sized.functions(study, e, bushings[0].group, REACH, SPEED)["stiffness"]
    assert found({"x0_stiffness": 1e3, "x0_relaxation": 0.1, "x1_stiffness": 5e4, "x1_relaxation": quick}) == stiffness
