# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Steps of the search for causes that no recording is needed for."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis import search
from penode_sil.diagnosis.build import Term
from penode_sil.diagnosis.exchange import sprung
from penode_sil.diagnosis.explaining import acting, heavy
from penode_sil.diagnosis.explanation import COST, NEW, Explanation, distinct, only_noise, spared
from penode_sil.diagnosis.fit import Fit, Free
from penode_sil.diagnosis.hypotheses import HALVES, Basis
from penode_sil.diagnosis.pursuit import PART, elsewhere, pursue, strongest, terms_of
from penode_sil.diagnosis.refining import called
from penode_sil.diagnosis.score import Candidate, Regression
from penode_sil.diagnosis.singles import rigid, sufficient
from penode_sil.diagnosis.textbook import halved, weak, whole

LAW = SimpleNamespace(law="linear_damper", shapes={})


def regression(main: list[float], companion: list[float], residual: list[float]) -> Regression:
    """A law of positive size and a companion of any, as columns; nothing else is free."""
    candidates = [Candidate("tyre_damping", "tyre", 1, False, LAW), Candidate("tyre_damping", "tyre", 0, True, LAW)]
    fit = SimpleNamespace(free=(), residual=np.array(residual), jacobian=np.zeros((len(residual), 0)))
    return Regression(fit, candidates, np.array([main, companion], dtype=np.float32), [])


@pytest.mark.parametrize(
    "residual, gains",
    [
        ([30.0, 10.0], (20.0, 10.0)),  # both, as they come
        ([10.0, 20.0], (PART * 10.0, 20.0)),  # the companion would do it alone, and more of it with less than nothing of the law
    ],
)
def test_a_law_stays_beside_its_companions(residual, gains):
    """A form that companions alone would take is still of the kind: without its law nothing would be left to be tried."""
    r = regression([1.0, 0.0], [1.0, 1.0], residual)
    assert [t.gain for t in terms_of(r, [0, 1])] == pytest.approx(gains, rel=0.3)
    assert pursue(r, [0, 1])[1] == [0, 1]


@pytest.mark.parametrize("kind, chosen", [("sensor_bias", [0, 1]), ("cubic_spring", [0])])
def test_a_bias_may_drift_in_any_slow_course(kind, chosen):
    """What a second law takes, 1600 beside 1000000, is of the form of the first; but a bias has none."""
    candidates = [Candidate(kind, "height", 0, False, LAW), Candidate(kind, "height", 0, True, LAW)]
    fit = SimpleNamespace(free=(), residual=np.array([1000.0, 40.0]), jacobian=np.zeros((2, 0)))
    assert pursue(Regression(fit, candidates, np.eye(2, dtype=np.float32), []), [0, 1])[1] == chosen


def test_companions_alone_are_no_cause():
    assert terms_of(regression([1.0, 0.0], [1.0, 1.0], [-10.0, -5.0]), [0, 1]) == []
    assert terms_of(regression([1.0, 0.0], [1.0, 1.0], [30.0, 10.0]), [1]) == []


def explanation(*kinds: str, gain: float = 0.0, formulas: float = 0.0) -> Explanation:
    terms = tuple(Term(Candidate(kind, "body", 0, False, "c"), 1.0) for kind in kinds)
    return Explanation(terms, None, None, None, gain, formulas)


def test_the_best_of_each_choice_comes_first():
    """An explanation that was found twice stands where its better form belongs, not where it was first seen."""
    found = [explanation("cubic_spring", gain=g) for g in (100.0, 900.0)] + [explanation("bump_stop", gain=500.0)]
    assert [e.gain for e in distinct(found)] == [900.0, 500.0]


def test_a_load_pays_for_looking_like_a_bias_only_once():
    """Beside a curve that gains much, where each number that only mends its form must gain 96."""
    load, bias = (explanation("stribeck_friction", kind, gain=137_000.0) for kind in ("constant_force", "sensor_bias"))
    assert bias.score - load.score == pytest.approx(COST)


def test_form_is_a_part_of_what_formulas_leave():
    """A load takes 150 000 and has no form to correct; a second cause that gains 1 000 beside it is worth nearly that."""
    alone, both = (
        explanation("constant_force", gain=150_000.0),
        explanation("constant_force", "tyre_liftoff", gain=151_000.0, formulas=150_000.0),
    )
    assert 900.0 < both.score - alone.score < 950.0  # 50 for the kind, 10 for its number, and thousandths of 1 000
    assert explanation("constant_force", "tyre_liftoff", gain=151_000.0).score < alone.score + 800.0


def test_a_formula_that_came_first_does_not_count():
    """A bushing takes as much alone as with a mass, which is a formula and was there first: the bushing needs no mass."""
    alone = explanation("maxwell_bushing", gain=370_534.0)
    both = explanation("hidden_resonance", "maxwell_bushing", gain=370_544.0, formulas=366_787.0)
    assert alone.score < both.score
    one, two = spared([alone, both])
    assert one.score > two.score == both.score


def test_a_second_mass_pays_as_a_form():
    """Two masses are a filter: though both are formulas, the second one must gain as much as what only mends a form."""
    one = explanation("hidden_resonance", gain=900_000.0)
    two = explanation("hidden_resonance", "hidden_resonance", gain=900_500.0, formulas=900_000.0)
    other = explanation("hidden_resonance", "wrong_parameter", gain=900_500.0, formulas=900_000.0)
    assert two.score < one.score < other.score


def test_a_fit_that_failed_begins_with_another_law():
    """Of laws that promise about the same, the best one of those that have not been tried."""
    laws = [SimpleNamespace(law=name, shapes={}) for name in ("loose_damper", "loose_damper", "maxwell_bushing")]
    candidates = [Candidate("maxwell_bushing", "spring", 1, False, law) for law in laws]
    fit = SimpleNamespace(free=(), residual=np.array([20.0, 10.0]), jacobian=np.zeros((2, 0)))
    r = Regression(fit, candidates, np.array([[1.0, 0.4], [1.0, 0.3], [1.0, 0.0]], dtype=np.float32), [])
    assert pursue(r, [0, 1, 2], terms=1)[1] == [0]
    assert elsewhere(r, ("maxwell_bushing", "spring"), [0]) == [2]
    assert elsewhere(r, ("maxwell_bushing", "spring"), [0, 2]) == []


@pytest.mark.parametrize("deviations, left", [((30.0, 1.0), ["m_b"]), ((30.0, 20.0), []), ((1.0, 2.0), ["c_t", "m_b"])])
def test_a_parameter_that_another_one_does_without_goes(deviations, left):
    """Two wrong parameters, so many deviations off their nominal values: 7.7 are worth a cause."""
    assert pytest.approx(7.7, abs=0.1) == (NEW + 10.0) ** 0.5
    names = ("m_b", "c_t")
    terms = tuple(Term(Candidate("wrong_parameter", name, 0, False, name), 0.0) for name in names)
    free = [SimpleNamespace(target=name, value=100.0 + d, unit=1.0) for name, d in zip(names, deviations, strict=True)]
    fit = SimpleNamespace(free=free, covariance=lambda: np.eye(2))
    model = SimpleNamespace(parameters={name: SimpleNamespace(value=100.0) for name in names})
    e = Explanation(terms, SimpleNamespace(names=names), None, fit, 0.0)
    assert [t.candidate.what for t in sufficient(SimpleNamespace(model=model), e)] == left


def test_the_strongest_other_kind_counts_what_is_taken():
    r = regression([1.0, 0.0], [1.0, 1.0], [30.0, 10.0])
    assert strongest(r, [("hidden_resonance", "body")]) == [0, 1] and strongest(r, [("tyre_damping", "tyre")]) == []


@pytest.mark.parametrize("play, half, gaps", [(2e4, 1e4, (0.004, 0.003)), (0.0, 1e4, None), (2e4, -8e4, None)])
def test_a_play_with_a_half_beside_it_has_two_halves(play, half, gaps):
    """A play of 3 mm to either side and a half as strong one of 2 mm: what it takes of the spring's travel; where there is no play, or
    none is left of it, the terms stay."""

    def shapes(gap):
        return {"gap": (gap, "m")}

    laws = [("backlash", play, shapes(0.003)), (HALVES[0], half, shapes(0.002))]
    group = Candidate("backlash", "spring", 1, False, None)
    terms = tuple(Term(replace(group, what=Basis("backlash", 0, law, ("k", "N/m"), gap, 1, ())), gain) for law, gain, gap in laws)
    spring = SimpleNamespace(law="linear_spring", name="spring", arguments={"stiffness": "c"})
    model = SimpleNamespace(elements=[spring], parameters={"c": SimpleNamespace(value=2e4)})
    study = SimpleNamespace(model=model, places=[SimpleNamespace(elements=[("spring", 1)])])
    found = halved(study, Explanation(terms, None, None, None, 0.0))
    assert found == list(terms) if gaps is None else [t.candidate.what.shapes["gap"][0] for t in found] == pytest.approx(gaps)


@pytest.mark.parametrize("companion, spare", [(True, [1]), (False, [0, 1])])
def test_the_law_that_makes_a_cause_is_not_spared(companion, spare):
    """Two laws that are worth nothing: if one may only help the other, that stays, for a helper alone is no cause."""
    first = Candidate("maxwell_bushing", "spring", 1, False, Basis("maxwell_bushing", 0, "maxwell_bushing", ("k", "N/m"), {}, 1, ()))
    second = replace(first, companion=companion, what=replace(first.what, companion=companion))
    free = tuple(SimpleNamespace(target=f"x{k}_k", value=1.0, unit=1.0) for k in range(2))
    fit = SimpleNamespace(free=free, covariance=lambda: np.eye(2))
    e = Explanation((Term(first, 1.0), Term(second, 1.0)), SimpleNamespace(names=("x0", "x1")), None, fit, 100.0)
    assert [e.terms.index(t) for t in weak(e)] == spare


def test_a_play_of_zero_has_no_effect():
    """Else its gap is none, and no fit can make it wider."""
    what = Basis("backlash", 0, "backlash", ("k", "N/m"), {"gap": (0.003, "m")}, 1, ())
    spring = SimpleNamespace(law="linear_spring", name="spring", arguments={"stiffness": "c"})
    model = SimpleNamespace(elements=[spring], parameters={"c": SimpleNamespace(value=2e4)})
    study = SimpleNamespace(model=model, places=[SimpleNamespace(elements=[("spring", 1)])])
    assert whole(study, Term(Candidate("backlash", "spring", 1, False, what), 0.0)) is None


def test_a_law_that_mends_a_form_leaves_the_name():
    """What the curve of the tyre is called now does not count, also if a law fell out of it; a curve elsewhere keeps its own name."""
    known = explanation("tyre_nonlinear", "tyre_nonlinear", "sensor_bias")
    for kinds in (
        ("tyre_liftoff", "tyre_liftoff", "sensor_bias"),
        ("tyre_nonlinear", "tyre_liftoff", "tyre_liftoff", "sensor_bias"),
        ("tyre_liftoff", "sensor_bias"),
    ):
        e = called(explanation(*kinds), known)
        assert e.groups == known.groups and [t.gain for t in e.terms] == [1.0] * len(kinds)
    assert called(explanation("coulomb_friction"), known).groups == (("coulomb_friction", "body"),)


def test_what_mends_a_form_may_take_away():
    """A residual that asks for less than nothing of a law has a use for it only where its sign does not count."""
    series = (np.ones(2),)
    law = Basis("bouc_wen", 0, "bouc_wen", ("force", "N"), {}, 1, series)
    fit = SimpleNamespace(free=(), residual=np.array([-30.0, 10.0]), jacobian=np.zeros((2, 0)))
    r = Regression(fit, [Candidate("bouc_wen", "spring", 1, False, law)], np.array([[1.0, 0.0]], dtype=np.float32), [])
    assert pursue(r, [0]) == (0.0, []) and pursue(r.unsigned(), [0])[1] == [0]
    (term,) = terms_of(r.unsigned(), [0])
    assert term.gain == pytest.approx(-30.0, rel=1e-4) and term.candidate.what.sign == 0 and r.candidates[0].sign == 1


@pytest.mark.parametrize("chi2, so", [(10_400.0, True), (10_500.0, False)])
def test_noise_alone_has_a_chi2_of_its_own(chi2, so):
    """10 000 samples: 10 000 +- 141."""
    study = SimpleNamespace(null=SimpleNamespace(residual=np.zeros(10_000)), experiments=[SimpleNamespace(good=np.ones(10_000, bool))])
    assert only_noise(study, SimpleNamespace(chi2=chi2)) == so


@pytest.mark.parametrize("steps, so", [(60_000, False), (180_000, True)])
def test_long_recordings_in_small_steps_are_searched_narrowly(steps, so):
    """With 20 values: 1.2 million steps, and three times that."""
    problem = SimpleNamespace(steps=steps)
    assert heavy(SimpleNamespace(problem=problem, fit=SimpleNamespace(free=[None] * 20))) == so


@pytest.mark.parametrize("value, masses", [(460.0, 3), (380.0, 0)])
def test_a_mass_that_is_too_small_may_have_one_on_a_spring(value, masses):
    """Tried below, in and above the range of most of them, each with what the body has too little; a body that is lighter has none."""
    tried = [("absorber", 0, f, zeta) for f in (1.0, 8.0, 16.0, 30.0, 40.0) for zeta in (0.03, 0.1, 0.3)]
    r = SimpleNamespace(candidates=[Candidate("hidden_resonance", "body", 1, False, what) for what in tried])
    model = SimpleNamespace(bodies=[SimpleNamespace(name="body", mass="m_b")], parameters={"m_b": SimpleNamespace(value=400.0)})
    fitted = SimpleNamespace(fit=SimpleNamespace(value={"m_b": value}.__getitem__))
    ways = sprung(SimpleNamespace(model=model), fitted, r, ("wrong_parameter", "m_b"))
    assert [(t.candidate.what[2:], t.gain) for way in ways for t in way] == [((f, 0.1), 60.0) for f in (8.0, 16.0, 30.0)][:masses]
    assert sprung(SimpleNamespace(model=model), fitted, r, ("sensor_scale", "a_body")) == []


@pytest.mark.parametrize(
    "frequency, damping, tolerance, masses",
    [(190.0, 0.1, 0.01, ["m_b"]), (190.0, 0.1, 0.0, []), (30.0, 0.1, 0.01, []), (4.3, 12.5, 0.01, ["m_b"]), (4.3, 1.0, 0.01, [])],
)
def test_a_mass_that_moves_with_its_body_is_a_part_of_it(frequency, damping, tolerance, masses):
    """Not one on a spring or a damper that gives way where hidden masses are, nor where the body's own mass is exact."""
    model = SimpleNamespace(bodies=[SimpleNamespace(name="body", mass="m_b")], parameters={"m_b": SimpleNamespace(tolerance=tolerance)})
    hidden = Term(Candidate("hidden_resonance", "body", 1, False, ("absorber", 0, frequency, damping)), 300.0)
    assert [t.candidate.what for t in rigid(SimpleNamespace(model=model), [hidden])] == masses
    assert rigid(SimpleNamespace(model=model), [hidden, hidden]) == []


def law(kind: str, gain: float, companion: bool = False) -> Term:
    return Term(Candidate(kind, "spring", 1, companion, Basis(kind, 0, "", ("k", ""), {}, 1, (), companion)), gain)


@pytest.mark.parametrize(
    "gains, left",
    [
        ((1.0, 1.0, 0.0), (0, 1)),  # a law of another kind that ended without force is no cause
        ((1.0, 0.0, 2.0), (0, 2)),
        ((0.0, 1.0, 0.0), (0, 1)),  # a companion is none without the law that it goes with
        ((0.0, 0.0, 2.0), (2,)),
    ],
)
def test_what_has_no_force_goes(gains, left):
    terms = [law("backlash", gains[0]), law("backlash", gains[1], companion=True), law("bump_stop", gains[2])]
    wrong = Term(Candidate("wrong_parameter", "c", 0, False, "c"), 0.0)
    assert acting([*terms, wrong]) == [*(terms[k] for k in left), wrong]


@pytest.mark.parametrize("hopeless, causes", [(True, 2), (False, 3)])
def test_a_hopeless_search_ends_after_its_round(monkeypatch, hopeless, causes):
    """Each round adds a cause; causes are exchanged only where the search went on to its end. Nothing is simulated."""

    def made(n: int) -> SimpleNamespace:
        fit = SimpleNamespace(chi2=0.0)
        return SimpleNamespace(
            groups=tuple(("bump_stop", str(i)) for i in range(n)), terms=[], gain=100.0 * n, score=100.0 * n, fit=fit, formulas=0.0
        )

    exchanged = []
    same = {
        "owned": lambda study, e, log: e,
        "plain": lambda study, e, parameters, log: e,
        "settled": lambda study, e: e,
        "with_noise_of": lambda study, fit: study,
        "spared": list,
        "level": list,
        "unloaded": lambda e: e.groups,
        "ranked": lambda study, best, rest, log: [best, *rest],
        "heavy": lambda e: False,
        "further": lambda study, e, r: [[0]],
        "terms_of": lambda r, chosen: [len(r.groups)],
        "filtered": lambda study, e, r: None,
        "_refined": lambda study, e, parameters, log: (study, e, e),
        "explain": lambda study, terms, start, formulas: made(terms[-1] + 1),
        "exchanged": lambda study, e, parameters, log: exchanged.append(e) or [],
    }
    for name, stub in same.items():
        monkeypatch.setattr(search, name, stub)
    study = SimpleNamespace(null=SimpleNamespace(free=()))
    found = search.grow(study, [made(1)], lambda text: None, hopeless=lambda study, e: hopeless)[1]
    assert len(found[0].groups) == causes and bool(exchanged) != hopeless


def test_a_time_constant_that_nothing_shows_leaves_a_size_as_sure_as_it_is():
    """A loss of 0.5 +- 0.01 and a time along which it changes by 1e-8 a factor of e: it is off by 1e20 at most, not by exp(5e7)."""
    free = (Free("loss", 0.5, 0.01), Free("cooling", 1e8, 1.0, log=True))
    fit = Fit(None, free, 0.0, 0.0, np.zeros(2), np.diag([1.0, 1e-9]), ())
    along = np.array([0.01, 1e-8])
    assert np.sqrt(along @ fit.covariance() @ along) == pytest.approx(0.01, rel=1e-6)
