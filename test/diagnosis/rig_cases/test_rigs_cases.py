# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Cases of laboratory rigs: made again to the byte, integrated as SciPy does, solved by the true law, scored as they should be."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rig_cases import cases, expert, judging, rigs_campaign
from rig_cases.rig import Rig
from rig_cases.signals import smooth
from rig_cases.solver import half_steps, rates, simulate

RIGHT = {"null": False, "verdicts": [], "tolerated": [["coulomb_friction", "*"]], "accepted": [[["input_dead_zone", "u"]]]}
BOTH = {**RIGHT, "tolerated": [], "accepted": [[["wrong_parameter", "k"], ["backlash", "belt|loss"]]]}
OUTSIDE = {**RIGHT, "accepted": [[["outside_taxonomy", "*"]]], "verdicts": ["unexplained", "partly_explained"]}
NULL = {**RIGHT, "null": True, "accepted": [], "tolerated": []}
INDEX = {"cart_motor": 2, "thermal": 10}


def answer(verdict, *causes):
    return {"verdict": verdict, "causes": [{"kind": c[0], "where": c[1], "small": len(c) > 2} for c in causes]}


def files(case, folder):
    case.write(folder)
    return {p.name: p.read_bytes() for p in folder.iterdir()}


@pytest.mark.parametrize("rig", INDEX)
def test_same_seed_same_bytes(rig, tmp_path):
    """Files and truth follow from seed and index; another turn makes others."""
    first, again, other = (cases.draw(7, i) for i in (INDEX[rig], INDEX[rig], INDEX[rig] + cases.TURN))
    written = files(first, tmp_path / "a")
    assert first.rig.name == other.rig.name == rig
    assert written == files(again, tmp_path / "b")
    assert json.dumps(first.truth()) == json.dumps(again.truth())
    assert all(written[name] != text for name, text in files(other, tmp_path / "c").items())


def test_a_turn_has_every_rig_and_nulls():
    drawn = [cases.which(3, i) for i in range(2 * cases.TURN)]
    assert [number for number, _, null, _ in drawn[: cases.TURN] if not null] == list(range(len(cases.RIGS)))
    assert [sum(null for *_, null, turn in drawn if turn == t) for t in (0, 1)] == [cases.NULLS, cases.NULLS]
    assert all(0 <= variant < cases.RIGS[number][1] for number, variant, _, _ in drawn)


def oscillator() -> tuple[Rig, np.ndarray]:
    """A mass on hardening springs without friction, whose right-hand side is smooth, and times of 4 s."""
    rig = cases.draw(1, 5).rig
    rig.true |= {"Fs": 0.0, "k3": 0.3 * rig.true["k"] / 0.02**2}
    return rig, np.arange(2001) * rig.sample


def test_the_integrator_agrees_with_scipy():
    """Runge-Kutta of order 4 errs by about (w h)^5 / 120 of the motion in each step h, w the fastest rate: the error of n steps."""
    rig, times = oscillator()
    force, p = 0.1 * rig.true["k"] * 0.02, rig.vector(rig.true)

    def pushed(t):
        return force * np.sin(2 * np.pi * 3.0 * t)

    drive = smooth(pushed)(half_steps(times, rig.steps), times)
    got, found = simulate(rig.plant, times, drive, p, np.zeros(2), rig.steps)
    solved = solve_ivp(lambda t, x: rates(rig.plant, x, [pushed(t)], p), (0, times[-1]), [0, 0], "DOP853", times, rtol=1e-12, atol=1e-15)
    motion = np.abs(got).max(axis=0)
    h = rig.sample / rig.steps
    stiffness = rig.true["k"] + 3 * rig.true["k3"] * motion[0] ** 2
    w = max(np.sqrt(stiffness / rig.true["m"]), 2 * np.pi * 3.0)
    per_step = (w * h) ** 5 / 120
    assert np.all(np.abs(got - solved.y.T).max(axis=0) < 10 * len(times) * rig.steps * per_step * motion + 1e-10 * motion)
    assert found[-1] == pytest.approx(rates(rig.plant, got[-1], [pushed(times[-1])], p), rel=1e-9)


def test_the_true_law_solves_a_case():
    """A wrong conductance and a bias: the true law, fitted to the recordings, predicts the hold-out within the noise and finds both."""
    case = cases.make(1, INDEX["thermal"])
    studied, rig = case.studied, case.rig
    assert studied.gain >= cases.SEEN
    assert all(studied.expert[s.name] < 1.2 * s.noise for s in rig.sensors)
    wrong = next(iter(rig.wide))
    assert studied.fitted[wrong] == pytest.approx(rig.true[wrong], rel=0.05)
    assert studied.fitted["offset_T_carrier"] == pytest.approx(rig.sensors[1].bias, abs=0.2)


def test_an_expert_reads_a_recording_with_lost_rows_and_empty_cells():
    """The true values predict every recording of a null case but for noise; empty cells count nothing."""
    case = cases.draw(1, 11)
    rig = case.rig
    for r in case.recordings:
        off = expert.errors(rig, r, rig.true, r.plan.start, expert.drive(rig, r))
        assert all(np.std(off[s.name]) < 1.5 * s.noise for s in rig.sensors)
        assert all(np.all(off[name][cells] == 0) for name, cells in r.empty.items())


@pytest.mark.parametrize(
    ("truth", "given", "outcome"),
    [
        (RIGHT, answer("explained", ("input_dead_zone", "u")), judging.RIGHT),
        (RIGHT, answer("explained", ("input_dead_zone", "u"), ("backlash", "belt", "small")), judging.RIGHT),
        (RIGHT, answer("explained", ("input_dead_zone", "u"), ("coulomb_friction", "rail")), judging.SMALL),
        (RIGHT, answer("explained", ("input_dead_zone", "u"), ("wrong_parameter", "m")), judging.FALSE),
        (RIGHT, answer("explained", ("input_dead_zone", "v")), judging.FALSE),
        (RIGHT, answer("explained", ("coulomb_friction", "rail")), judging.MISSED),
        (RIGHT, answer("unexplained"), judging.MISSED),
        (RIGHT, None, judging.NONE),
        (BOTH, answer("explained", ("wrong_parameter", "k"), ("backlash", "belt, coupling")), judging.RIGHT),
        (BOTH, answer("explained", ("wrong_parameter", "k")), judging.PART),
        (OUTSIDE, answer("unexplained"), judging.RIGHT),
        (OUTSIDE, answer("explained", ("outside_taxonomy", "spring")), judging.RIGHT),
        (OUTSIDE, answer("partly_explained", ("cubic_spring", "spring")), judging.FALSE),
        (NULL, answer("no_discrepancy"), judging.RIGHT),
        (NULL, answer("not_identifiable"), judging.UNSURE),
        (NULL, answer("unexplained", ("outside_taxonomy", "")), judging.ALARM),
        (NULL, None, judging.NONE),
    ],
)
def test_outcomes(truth, given, outcome):
    assert judging.outcome(truth, given) == outcome


def test_the_totals_count_every_row():
    outcomes = [judging.RIGHT, judging.SMALL, judging.FALSE, judging.MISSED, judging.PART, judging.NONE]
    rows = [{"outcome": o, "null": False} for o in outcomes] + [{"outcome": o, "null": True} for o in (judging.RIGHT, judging.ALARM)]
    line = rigs_campaign.totals(rows)
    assert line.startswith("6 with something hidden: right 1, right with a small effect 1, false 1, missed 1, part missed 1, no answer 1;")
    assert line.endswith("2 nulls: right 1, unsure 0, false alarm 1, no answer 0")


def test_cables_are_tolerated_where_they_act():
    """The stiffness of a cable is there: between cart and ground, and at the pendulum's bearing."""
    for index, place in ((0, "bearing"), (2, "rail"), (3, "rail")):
        truth = cases.draw(1, index).truth()
        for kind in ("missing_spring", "asymmetric_spring", "cubic_spring"):
            assert judging.among((kind, place), truth["tolerated"])


def test_hold_out_beside_that_of_the_true_law():
    truth = {"units": {"x": "mm", "y": "K"}, "holdout": {"expert": {"x": 2.0, "y": 1.0}}}
    gain = {"x": {"after_rmse": 3e-3, "unit": "m"}, "y": {"after_rmse": 1.25, "unit": "K"}}
    assert judging.beside_expert(truth, {"gain": gain}) == 1.5
    assert judging.beside_expert(truth, None) is None
