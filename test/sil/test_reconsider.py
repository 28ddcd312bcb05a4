# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""How the search revises early choices once later causes are known. Scores are made up; nothing is simulated."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis.catalogue.form import Form, Part
from penode_sil.diagnosis.evidence.gain import Level
from penode_sil.diagnosis.evidence.prior import Stated
from penode_sil.diagnosis.search import rounds
from penode_sil.diagnosis.search.innovate import Ended
from penode_sil.diagnosis.search.reconsider import needed, reconsidered
from penode_sil.diagnosis.search.rounds import MIN_FORM, Accepted, Grown, _is_sure, simplest
from penode_sil.diagnosis.search.terms import Term, Trial
from penode_sil.diagnosis.search.worth import MIN_GAIN, WORTH
from penode_sil.diagnosis.study.fit import Free

NAMES = {
    "friction": "coulomb_friction",
    "stribeck": "stribeck_friction",
    "asymmetric": "asymmetric_damper",
    "degressive": "degressive_damper",
    "constant": "constant_force",
    "cubic": "cubic_spring",
    "stop": "bump_stop",
    "square": "quadratic_damper",
    "both": "coulomb_friction",
}
VALUES = {"stribeck": 3, "degressive": 2, "stop": 2, "both": 2}


def trial(name: str, nats: float, whole: float = 0.0) -> Trial:
    """A trial with a total score of `nats` over all blocks, which takes the share `whole` of the misfit."""
    parts = (
        (Part("coulomb_friction", ("force", "N")), Part("constant_force", ("force", "N"), kind="constant_force")) if name == "both" else ()
    )
    form = Form(NAMES[name], "spring", "force", 0, parts)
    free = tuple(Free(f"{name}_{k}", 1.0, 1.0) for k in range(VALUES.get(name, 1)))
    return Trial(form, Term(form, (), free), SimpleNamespace(free=()), 0.0, None, None, whole=whole, blocks=np.full(4, nats / 4.0))


def accepted(number: int, t: Trial, trials: Sequence[Trial] = ()) -> Accepted:
    return filled(Accepted(t, number, (), (t, *trials)))


def filled(a: Accepted) -> Accepted:
    return replace(a, terms=tuple(Term(a.trial.form, (), ()) for _ in a.trial.form.kinds))


def kinds(forms: Sequence[Accepted]) -> tuple[str, ...]:
    return tuple(a.trial.form.kind for a in forms)


class Rounds:
    """Stub of `Rounds`: looks up scores and good trials by set of causes instead of simulating."""

    def __init__(
        self,
        scores: dict[tuple[str, ...], float],
        good: dict[tuple[str, ...], Sequence[Trial]],
        grow: Callable[[list[Accepted]], list[Accepted]] = lambda forms: forms,
    ):
        self.scores, self.beside_good, self.more, self.log = scores, good, grow, lambda text: None

    def beside(self, forms: Sequence[Accepted]) -> tuple[tuple[str, ...], np.ndarray, list[Accepted]]:
        return kinds(forms), np.full(4, self.scores[kinds(forms)] / 4.0), list(map(filled, forms))

    def good(self, bench: tuple[str, ...], scores: np.ndarray, forms: Sequence[Accepted]) -> tuple[Trial, ...]:
        return tuple(self.beside_good.get(bench, ()))

    def grow(self, forms: Sequence[Accepted] = ()) -> Grown:
        return grown(list(map(filled, self.more(list(forms)))), self.scores)


def grown(forms: Sequence[Accepted], scores: dict[tuple[str, ...], float], rest: Sequence[Trial] = (), left: float = 0.0) -> Grown:
    """An end of a search that `left` a share of all forces unmodelled. Good trials are left only where the last form is small, for the
    search goes on after a large one."""
    large = (*[True] * (len(forms) - 1), not rest)
    bench = SimpleNamespace(level=Level(left, 0.01), fit=forms[0].trial.fit if forms else None)
    return Grown(bench, np.full(4, scores[kinds(forms)] / 4.0), tuple(forms), large, tuple(rest))


def test_a_first_choice_that_stood_in_for_two_is_exchanged():
    """Friction and an asymmetric damper look like a degressive one, until the asymmetry is known; then friction takes most of what is
    left."""
    first, second = accepted(0, trial("degressive", 600.0)), accepted(1, trial("asymmetric", 1300.0))
    scores = {
        ("degressive_damper", "asymmetric_damper"): 1300.0,
        ("asymmetric_damper",): 100.0,
        ("coulomb_friction", "asymmetric_damper"): 1700.0,
        ("coulomb_friction",): 600.0,
    }
    good = {
        ("asymmetric_damper",): [trial("friction", 1700.0), trial("degressive", 1300.0)],
        ("coulomb_friction",): [trial("asymmetric", 1700.0)],
    }
    rounds = Rounds(scores, good)
    end = reconsidered(rounds, grown([first, second], scores, [trial("friction", 1700.0, whole=0.8)]))
    assert kinds(end.accepted) == ("coulomb_friction", "asymmetric_damper")
    assert len({a.number for a in end.accepted} | {0}) == 3  # names of the first one are in the fit of the second


def test_what_the_others_do_as_well_is_left_out():
    first, second = accepted(0, trial("constant", 600.0)), accepted(1, trial("asymmetric", 1300.0))
    scores = {("constant_force", "asymmetric_damper"): 1300.0, ("asymmetric_damper",): 1295.0}  # 5 nats, of 10 that a cause has to gain
    assert kinds(reconsidered(Rounds(scores, {}), grown([first, second], scores, [trial("cubic", 1500.0, whole=0.8)])).accepted) == (
        "asymmetric_damper",
    )


def test_nothing_is_tried_again_where_nothing_is_in_doubt():
    first, second = accepted(0, trial("degressive", 600.0)), accepted(1, trial("asymmetric", 1300.0))
    scores = {("degressive_damper", "asymmetric_damper"): 1300.0}  # any other set would be a KeyError
    end = grown([first, second], scores, [trial("cubic", 1400.0, whole=0.3)])
    assert reconsidered(Rounds(scores, {}), end).accepted == end.accepted


def test_a_shape_chosen_before_the_others_were_known_goes_and_the_last_choice_with_it():
    """Truth: Coulomb friction and a cubic spring. Taken alone a Stribeck curve predicts better; beside that, a bump stop does."""
    first, second = accepted(0, trial("stribeck", 600.0), [trial("friction", 560.0)]), accepted(1, trial("stop", 1300.0))
    scores = {
        ("stribeck_friction", "bump_stop"): 1300.0,
        ("bump_stop",): 300.0,
        ("coulomb_friction",): 560.0,
        ("coulomb_friction", "bump_stop"): 1296.0,
        ("coulomb_friction", "cubic_spring"): 1500.0,
    }
    good = {
        ("bump_stop",): [trial("friction", 1296.0), trial("stribeck", 1300.0)],
        ("coulomb_friction",): [trial("cubic", 1500.0), trial("stop", 1400.0)],
    }
    end = reconsidered(Rounds(scores, good), grown([first, second], scores))
    assert kinds(end.accepted) == ("coulomb_friction", "cubic_spring")


@pytest.mark.parametrize(("left", "gain", "kept"), [(0.03, 31.0, False), (0.03, 29.0, True), (0.0, 31.0, True)])
def test_a_search_begins_with_other_curves_too_where_forces_remain(left, gain, kept):
    """A constant force predicts as well as an asymmetric spring, and leaves no room for it; beside the spring, a stop predicts the rest.
    Two laws more have to gain MIN_GAIN each, and as much as one end has to beyond another."""
    constant, spring, cubic = trial("constant", 600.0), trial("asymmetric", 595.0), trial("cubic", 480.0)  # below MIN_FORM of the gain: 500
    first = replace(constant, gain=500.0)
    scores = {("constant_force",): 600.0, ("asymmetric_damper", "bump_stop", "quadratic_damper"): 600.0 + gain}
    more = [accepted(1, trial("stop", 620.0)), accepted(2, trial("square", 640.0))]
    rounds = Rounds(scores, {}, grow=lambda forms: [*forms, *more])
    end = reconsidered(rounds, grown([accepted(0, first, [spring, cubic])], scores, left=left))
    assert kinds(end.accepted) == (("constant_force",) if kept else ("asymmetric_damper", "bump_stop", "quadratic_damper"))


@pytest.mark.parametrize("factor, gain, kept", [(1.6, 99.0, True), (1.6, 101.0, False), (1.0, 99.0, False)])
def test_an_end_that_takes_a_mass_away_has_to_gain_as_much_as_a_curve_may_be_off(factor, gain, kept):
    """A bushing beside a mass 60 % off predicts better than a delay: two laws and the mass for one value, so it has to gain a fifth of
    what that one did, 500 nats. Where the mass stays, 20 nats are enough for two laws."""
    delay, other = trial("constant", 600.0), trial("asymmetric", 595.0)
    mass = Stated("m", factor * 10.0, 1.0, sigma=0.25, origin=10.0)
    other = replace(other, fit=SimpleNamespace(free=(mass,), deviation=lambda target: 0.1))
    scores = {("constant_force",): 600.0, ("asymmetric_damper", "cubic_spring"): 600.0 + gain}

    def grow(forms: list[Accepted]) -> list[Accepted]:
        return [*forms, accepted(1, trial("cubic", 620.0))]

    first = grown([accepted(0, replace(delay, gain=500.0), [other])], scores, left=0.03)
    end = reconsidered(Rounds(scores, {}, grow), first)
    assert kinds(end.accepted) == (("constant_force",) if kept else ("asymmetric_damper", "cubic_spring"))


def test_no_simpler_form_that_predicts_much_worse_and_no_end_that_is_worse():
    first, second = accepted(0, trial("stribeck", 600.0), [trial("friction", 560.0)]), accepted(1, trial("stop", 1300.0))
    scores = {
        ("stribeck_friction", "bump_stop"): 1300.0,
        ("bump_stop",): 300.0,
        ("coulomb_friction",): 560.0,
        ("coulomb_friction", "bump_stop"): 900.0,
    }
    worse = Rounds(
        scores, {("bump_stop",): [trial("friction", 1000.0)]}
    )  # 300 of the 1000 nats that Stribeck gains, of 200 that a form may lose
    assert kinds(reconsidered(worse, grown([first, second], scores)).accepted) == ("stribeck_friction", "bump_stop")
    promised = Rounds(scores, {("bump_stop",): [trial("friction", 1310.0)], ("coulomb_friction",): []})  # fitted again, it ends at 900
    assert kinds(reconsidered(promised, grown([first, second], scores)).accepted) == ("stribeck_friction", "bump_stop")


def test_what_is_needed_is_judged_beside_what_was_exchanged():
    """The last form is worth 405 nats beside the friction, 5 of which show against the score of the set before."""
    first, second = accepted(0, trial("stribeck", 600.0), [trial("friction", 560.0)]), accepted(1, trial("cubic", 1300.0))
    scores = {
        ("stribeck_friction", "cubic_spring"): 1300.0,
        ("cubic_spring",): 300.0,
        ("coulomb_friction",): 1295.0,
        ("coulomb_friction", "cubic_spring"): 1700.0,
    }
    rounds = Rounds(scores, {("cubic_spring",): [trial("friction", 1700.0)], ("coulomb_friction",): [trial("cubic", 1700.0)]})
    assert kinds(reconsidered(rounds, grown([first, second], scores)).accepted) == ("coulomb_friction", "cubic_spring")


def test_rivals_of_a_form_that_stays_are_those_beside_all_others():
    first, second = accepted(0, trial("stribeck", 600.0), [trial("friction", 560.0)]), accepted(1, trial("stop", 1300.0))
    scores = {("stribeck_friction", "bump_stop"): 1300.0, ("bump_stop",): 300.0}
    good = (trial("stribeck", 1300.0), trial("degressive", 1250.0))
    end = reconsidered(Rounds(scores, {("bump_stop",): good}), grown([first, second], scores))
    assert kinds(end.accepted) == ("stribeck_friction", "bump_stop") and end.accepted[0].trials == good


@pytest.mark.parametrize("share, kept", [(0.9, True), (1.1, False)])
def test_what_makes_up_for_a_curve_is_no_reason_for_a_simpler_one(share, kept):
    """A bump stop that gains less than MIN_FORM of what a peak of friction does at its place. Beside it, and only there, friction without a
    peak predicts better."""
    first = accepted(0, replace(trial("stribeck", 600.0, whole=0.9), gain=600.0), [trial("friction", 450.0)])
    second = accepted(1, replace(trial("stop", 700.0), gain=share * MIN_FORM * 600.0))
    scores = {("stribeck_friction", "bump_stop"): 700.0, ("bump_stop",): 0.0, (): 0.0, ("coulomb_friction", "bump_stop"): 750.0}
    scores |= {("coulomb_friction",): 450.0}
    good = {(): [trial("stribeck", 600.0), trial("friction", 450.0)], ("bump_stop",): [trial("friction", 750.0), trial("stribeck", 700.0)]}
    end = reconsidered(Rounds(scores, good), grown([first, second], scores))
    assert kinds(end.accepted)[0] == ("stribeck_friction" if kept else "coulomb_friction")


@dataclass(frozen=True)
class Bench:
    """Stub of a bench whose fits gain what is written here, one after the other."""

    level: Level
    fit: SimpleNamespace
    gains: list[float]

    def problem(self) -> SimpleNamespace:
        costs = itertools.accumulate(self.gains, initial=self.fit.cost)
        next(costs)
        return SimpleNamespace(solve=lambda free, by, iterations: SimpleNamespace(free=free, by=by, cost=next(costs)))


@pytest.mark.parametrize("gains", ([0.5], [400.0, 30.0, 0.5]))
def test_a_form_is_judged_at_the_likeliest_level_and_fit_without_it(monkeypatch, gains):
    """The form before has let the level fall: blocks look for larger ones from there. A fit that has not converged goes on."""
    less, asked = Level(0.01, 1.0), []
    monkeypatch.setattr(rounds, "fit_level", lambda bench, problem, fit, level: (less, fit))

    def wider(bench, problem, fit, level, sizes):
        asked.append((level, sizes))
        return level, fit, np.ones(4)

    start = SimpleNamespace(free=(), by=None, cost=-1000.0)
    found, scores = rounds._based(Bench(Level(0.3, 1.0), start, gains), SimpleNamespace(fit_level=wider))
    assert (found.level, found.fit.cost, asked) == (less, -1000.0 + sum(gains), [(less, rounds.levels(less))])
    assert scores.tolist() == [1.0] * 4


@pytest.mark.parametrize(
    "level, least, most, sure",
    [
        (0.2 * WORTH, 1.1 * MIN_GAIN, 0.0, True),
        (0.2 * WORTH, 0.9 * MIN_GAIN, 0.0, False),
        (0.2 * WORTH, 1.1 * MIN_GAIN, 1000.0, False),
        (0.5 * WORTH, 1.1 * MIN_GAIN, 0.0, False),
    ],
)
def test_a_small_form_that_every_block_demands_is_no_end(level, least, most, sure):
    """Where little is unmodelled, unless one that gained the `most` may leave that much by its curve."""
    best = replace(trial("cubic", 0.0), gain=100.0, blocks=np.array([least, 50.0, 50.0, 50.0]))
    found = [accepted(0, replace(trial("stop", 0.0), gain=most))]
    assert _is_sure(SimpleNamespace(level=Level(level, 1.0)), best, np.zeros(4), found) is sure


def test_a_constant_beside_a_friction_is_left_for_a_law_that_pulls_to_one_side():
    both = accepted(0, trial("both", 1190.0), [trial("stribeck", 930.0)])
    scores = {("coulomb_friction",): 1190.0, ("stribeck_friction", "cubic_spring"): 1270.0}
    scores |= {("cubic_spring",): 100.0, ("cubic_spring", "degressive_damper"): 100.0}
    rounds = Rounds(scores, {}, lambda forms: [*forms, accepted(1, trial("cubic", 1270.0))])
    assert kinds(reconsidered(rounds, grown([both], scores)).accepted) == ("stribeck_friction", "cubic_spring")
    scores["stribeck_friction", "cubic_spring", "degressive_damper"] = 1205.0  # 15 nats, of 20 that one more law has to gain
    more = Rounds(scores, {}, lambda forms: [*forms, accepted(1, trial("cubic", 1200.0)), accepted(2, trial("degressive", 1205.0))])
    assert kinds(reconsidered(more, grown([both], scores)).accepted) == ("coulomb_friction",)
    scores["stribeck_friction", "cubic_spring"] = 1195.0
    assert kinds(reconsidered(rounds, grown([both], scores)).accepted) == ("coulomb_friction",)  # with its constant: 5 nats are not enough


def gained(kind: str, where: str, index: int, gain: float) -> Accepted:
    form = Form(kind, where, "force", index)
    return Accepted(Trial(form, Term(form, (), ()), None, gain, None, None), index, (), ())


@pytest.mark.parametrize("share, named", [(0.9, False), (1.1, True)])
def test_a_form_that_makes_up_for_the_curve_of_another_at_its_place_has_no_name(share, named):
    """Where it gains less than MIN_FORM of what that does; at another place it has one. One that is not large has none, and counts for
    nothing."""
    forms = [gained("degressive_damper", "damper", 0, 1000.0), gained("cubic_spring", "spring", 0, share * MIN_FORM * 1000.0)]
    forms += [gained("coulomb_friction", "rail", 1, 0.1 * MIN_FORM * 1000.0), gained("bump_stop", "rail", 1, 500.0)]
    end = Grown(None, summed(forms), tuple(forms), (True, True, True, False), ())
    assert needed(Summed(summed), end) == [True, named, True, False]


def summed(forms: Sequence[Accepted]) -> np.ndarray:
    """Scores of forms that gain the same in any company."""
    return np.full(4, sum(a.trial.gain for a in forms) / 4.0)


@dataclass
class Summed:
    """Stands for Rounds where scores are a function of the accepted forms."""

    scores: Callable[[Sequence[Accepted]], np.ndarray]

    def score_without(self, grown: Grown, gone: Sequence[Accepted]) -> float:
        return float(np.sum(self.scores([a for a in grown.accepted if a not in gone])))

    def log(self, text: str) -> None:
        pass


def test_a_form_that_later_ones_have_made_superfluous_has_no_name():
    """It gained most when it was accepted, and gains 100 of 1000 beside the one that was accepted last; of two that stand for each other,
    one keeps its name."""
    first, last = gained("maxwell_bushing", "spring", 0, 3000.0), gained("stribeck_friction", "damper", 0, 4000.0)
    twin = gained("bouc_wen", "damper", 0, 2000.0)

    def scores(forms: Sequence[Accepted]) -> np.ndarray:
        return np.full(4, (1000.0 * (last in forms or twin in forms) + 100.0 * (first in forms)) / 4.0)

    end = Grown(None, scores([first, last]), (first, last), (True, True), ())
    assert needed(Summed(scores), end) == [False, True]
    end = Grown(None, scores([twin, last]), (twin, last), (True, True), ())
    assert sorted(needed(Summed(scores), end)) == [False, True]


def friction(kind: str, laws: Sequence[str], nats: float, level: float) -> Trial:
    form = Form(kind, "rail", "force", 0, tuple(Part(law, ("force", "N")) for law in laws))
    free = tuple(Free(f"{kind}_{law}", 1.0, 1.0) for law in laws)
    return Trial(form, Term(form, (), free), SimpleNamespace(free=()), nats, Level(level, 1.0), None, blocks=np.full(4, nats / 4.0))


NESTED, OTHER = ("coulomb_friction", "peak"), ("bouc_wen", "peak")


@pytest.mark.parametrize(
    "level, laws, enough",
    [
        (0.0, NESTED, MIN_FORM**2 * 1000.0),
        (0.25 * WORTH, NESTED, 0.5 * MIN_FORM * 1000.0),
        (0.5 * WORTH, NESTED, MIN_FORM * 1000.0),
        (0.0, OTHER, MIN_FORM * 1000.0),
    ],
)
def test_more_laws_have_to_gain_less_where_little_is_unmodelled(level, laws, enough):
    """Of forms of one curve, one that has all laws of a simpler one and more, against one of other laws: beside one of 1000 nats."""
    for more, kind in ((0.9 * enough, "coulomb_friction"), (1.1 * enough, "stribeck_friction")):
        trials = [friction("stribeck_friction", laws, 1000.0 + more, level), friction("coulomb_friction", NESTED[:1], 1000.0, level)]
        assert simplest(trials, np.zeros(4), ()).form.kind == kind


@pytest.mark.parametrize(
    ("large", "names", "kept"),
    [
        ((True, True, False), (True, True, False), ()),  # what is small has no name, and nothing makes up for it
        ((True, True, False), (False, True, False), ("coulomb_friction", "cubic_spring")),
        ((True, False, False), (False, False, False), ("coulomb_friction", "cubic_spring")),
        ((True, True, True), (False, True, False), ("coulomb_friction",)),
    ],
)
def test_a_search_resumes_without_large_forms_that_make_up_for_others(large, names, kept):
    forms = tuple(accepted(k, trial(name, 100.0)) for k, name in enumerate(("square", "friction", "cubic")))
    ended = Ended(Grown(None, np.zeros(4), forms, large, ()), list(names), None, 0.0)
    assert kinds(ended.without_what_makes_up()) == kept
    assert len(ended.of_names) == sum(names)
