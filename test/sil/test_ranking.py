# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which of several forms the search takes: made-up trials, no simulation."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import penode_gen
from penode_sil.diagnosis import catalogue
from penode_sil.diagnosis.catalogue import friction, springs
from penode_sil.diagnosis.catalogue.form import Form, Motion, Part
from penode_sil.diagnosis.evidence.prior import Stated
from penode_sil.diagnosis.plant import plant
from penode_sil.diagnosis.result import Cause, Value
from penode_sil.diagnosis.search import innovate, naming, propose, rounds
from penode_sil.diagnosis.search.terms import Term, Trial

PLANT = """
[model]
name = "two"
sample_time = "2 ms"
[parameters]
m = { value = 20, unit = "kg" }
k = { value = 5000, unit = "N/m" }
d = { value = 300, unit = "N*s/m" }
q = { value = 300, unit = "N*s^2/m^2" }
f = { value = 3, unit = "N" }
edge = { value = 0.01, unit = "m/s" }
[inputs]
push = { unit = "N" }
[bodies]
body = { mass = "m", position = "z", velocity = "v_z" }
wheel = { mass = "m", position = "w", velocity = "v_w" }
[elements]
actuator = { between = ["body", "ground"], law = "expression", force = "-push" }
coil = { between = ["body", "wheel"], law = "linear_spring", stiffness = "k" }
strut = { between = ["wheel", "body"], LAW }
[outputs]
z = { value = "z", unit = "m" }
[sensors]
z = { value = "z", unit = "m", noise = 1e-4 }
"""
BASE = np.zeros(4)
SLIDES, PUSHES = Part("coulomb_friction", ("force", "N")), Part("constant_force", ("force", "N"))
LOOSE, LATE = Part("loose_damper", ("damping", "N*s/m")), Part("maxwell_bushing", ("stiffness", "N/m"))


def trial(kind: str, blocks: float, *parts: Part, note: str = "", where: str = "spring", free: int = 1) -> SimpleNamespace:
    """A form that predicts each of four blocks better by so many nats."""
    form = Form(kind, where, "force", 0, parts, note)
    fit = SimpleNamespace(free=())
    return SimpleNamespace(form=form, blocks=np.full(4, blocks), gain=4.0 * blocks, term=SimpleNamespace(free=[None] * free), fit=fit)


def test_a_form_has_to_predict_better_than_a_part_of_it():
    constant = trial("constant_force", 20.0, PUSHES)
    both = trial("coulomb_friction", 22.0, SLIDES, PUSHES, note="with a constant")
    assert rounds._is_enough(constant, both)  # 8 nats more, of 10 that a law has to gain
    assert not rounds._is_enough(constant, trial("coulomb_friction", 30.0, SLIDES, PUSHES, note="with a constant"))
    assert not rounds._is_enough(both, constant)
    assert not rounds._is_enough(trial("constant_force", 20.0, PUSHES, where="tyre"), trial("coulomb_friction", 1.0, SLIDES))


def test_a_stop_beside_a_spring_that_has_gone_is_a_play():
    """Both are one curve where the stiffness is free: the name is of the one that leaves the spring of the file where it is. A tenth of it
    is no reason, nor are 120 of 400 nats."""

    def both(stop: float, play: float, left: float) -> list[SimpleNamespace]:
        spring = Stated("k", left * 1000.0, 1.0, sigma=50.0, origin=1000.0)
        stopped, played = trial("bump_stop", stop, SLIDES, free=2), trial("backlash", play, LOOSE, free=2)
        return [SimpleNamespace(**{**vars(stopped), "fit": SimpleNamespace(free=(spring,))}), played]

    for stop, play, left, kinds in (
        (100.0, 97.0, 0.05, ["backlash"]),
        (100.0, 97.0, 0.9, ["bump_stop", "backlash"]),
        (100.0, 70.0, 0.05, ["bump_stop", "backlash"]),
    ):
        assert [t.form.kind for t in rounds.like_the_file(both(stop, play, left), BASE)] == kinds


def test_another_law_of_a_name_goes_before_a_new_name_that_is_hardly_better():
    bushing, play = trial("maxwell_bushing", 100.0, LATE), trial("backlash", 97.0, LOOSE, note="of a damper")
    named = [SimpleNamespace(form=Form("backlash", "spring", "force", 0, ()))]
    assert rounds.simplest([bushing, play], BASE, named) is play
    assert rounds.simplest([bushing, play], BASE, []) is bushing
    far = trial("backlash", 70.0, LOOSE, note="of a damper")  # 120 nats of 400 are more than a fifth
    assert rounds.simplest([bushing, far], BASE, named) is bushing


def test_of_curves_that_predict_equally_well_the_one_with_fewer_values_is_named():
    stop, cube = trial("bump_stop", 100.0, LATE, free=2), trial("cubic_spring", 98.0, LOOSE)
    assert rounds.simplest([stop, cube], BASE, []) is cube  # 8 nats less, of 10 that a value has to gain
    assert rounds.simplest([stop, trial("cubic_spring", 95.0, LOOSE)], BASE, []) is stop


def test_a_form_that_takes_values_of_the_file_away_counts_these_too():
    """A spring and a damper in series beside a mass of twice its size predict better than a lag by a twentieth: four values for one."""
    values = [Stated(n, f * 10.0, 1.0, sigma=0.25, origin=10.0) for n, f in (("m", 2.0), ("d", 1.4))]

    def both(nats: float, *moved: Stated) -> list[SimpleNamespace]:
        fit = SimpleNamespace(free=moved, deviation=lambda target: 0.1)
        return [SimpleNamespace(**{**vars(trial("maxwell_bushing", nats, LATE, free=2)), "fit": fit}), trial("input_lag", 100.0, where="u")]

    for nats, moved, kind in ((105.0, values, "input_lag"), (105.0, [], "maxwell_bushing"), (130.0, values, "maxwell_bushing")):
        assert rounds.simplest(both(nats, *moved), BASE, []).form.kind == kind
    assert rounds._is_imitated(*reversed(both(105.0, *values)), BASE) and not rounds._is_imitated(*reversed(both(105.0)), BASE)


def test_a_passed_rival_with_more_values_is_as_likely_as_the_form_that_was_chosen():
    rival, chosen, worse = trial("maxwell_bushing", 105.0, LATE), trial("input_lag", 100.0, where="u"), trial("backlash", 50.0, LOOSE)
    found = {f.kind: p for f, p in naming._weighed([rival, chosen, worse], chosen)}
    assert found == {"maxwell_bushing": 0.5, "input_lag": 0.5, "backlash": 0.0}
    assert {f.kind: p for f, p in naming._weighed([rival, chosen], rival)} == {"maxwell_bushing": 1.0, "input_lag": 0.0}


def test_a_place_is_the_same_by_either_of_its_names():
    """Friction is named at the damper of a place, a spring at its spring: the model has both at one place, and neither hides the other."""
    there = (("stribeck_friction", "strut", 0), ("bump_stop", "coil", 0), ("k", "tyre", 1))
    peak, spring, far = (Form(kind, where, "force", index) for kind, where, index in there)
    taken = [Term(Form("coulomb_friction", "strut", "force", 0), (), ())]
    assert propose._taken(peak, taken) and not propose._taken(replace(peak, index=1), taken)
    small = Trial(peak, None, None, 0.0, None, None)
    assert not rounds._hidden(Trial(spring, None, None, 0.0, None, None, 1.0), small)
    assert rounds._hidden(Trial(far, None, None, 0.0, None, None, 1.0), small)
    assert not propose._taken(Form("input_gain", "push", "input_gain", 0), taken)


@pytest.mark.parametrize(
    "law, name",
    [
        ('law = "linear_damper", damping = "d"', "strut"),
        ('law = "coulomb_friction", force = "f", transition = "edge"', "strut"),
        ('law = "expression", force = "q*v*abs(v_strut)"', "strut"),
        ('law = "expression", force = "d*v_strut + k*s_strut"', "coil"),
        ('law = "linear_spring", stiffness = "k"', "coil"),
    ],
)
def test_friction_is_named_at_the_damper_of_its_place(tmp_path, law, name):
    """Where the force of an element depends on the rate and not on the deflection; at the first element where none does, or at the body."""
    (tmp_path / "model.toml").write_text(PLANT.replace("LAW", law))
    place, *free = plant.places(penode_gen.load(tmp_path / "model.toml"))
    assert (place.name, place.loss) == ("coil", name) and [p.loss for p in free] == ["body", "wheel"]


@pytest.mark.parametrize(
    ("note", "rise", "presliding", "kind"),
    [
        (friction.LUGRE, 0.05, 1e-5, "stribeck_friction"),
        (friction.LUGRE, 0.03, 1e-5, "coulomb_friction"),
        (friction.LUGRE, 0.03, 5e-5, "bouc_wen"),
        ("with bristles", 0.05, 5e-5, "stribeck_friction"),
        ("with bristles", 0.03, 1e-5, "coulomb_friction"),
        ("of Dahl", 0.0, 5e-5, "bouc_wen"),
        ("of Dahl", 0.0, 3e-5, "coulomb_friction"),
    ],
)
def test_a_friction_is_called_by_what_its_fit_has(note, rise, presliding, kind):
    """Along a motion of 1 mm rms: a peak below 4 % is none, and a presliding below 4 % of the motion is the contact of a friction."""
    shapes = {"presliding": (presliding, "m"), "rise": (rise, "1"), "stribeck": (0.01, "m/s")}
    laws = [(10.0, Part("a law", ("force", "N"), shapes)), (10.0 * rise, Part("a peak", ("rise", "N")))]
    guess = "bouc_wen" if note == "of Dahl" else "stribeck_friction"
    form = Form(guess, "damper", "force", 0, tuple(part for _, part in laws), note)
    assert catalogue.fitted(form, laws, Motion((), 1e-3, 0.1, 2e-3, 0.2)).kind == kind


def test_what_a_law_includes_is_a_part_of_it():
    parts = Part("dahl", ("force", "N")), Part("lugre", ("force", "N"), includes="dahl")
    slides, lugre = (Form("coulomb_friction", "damper", "force", 0, (p,)) for p in parts)
    assert propose.is_part(slides, lugre)
    assert not propose.is_part(lugre, slides) and not propose.is_part(lugre, lugre)


def test_what_is_a_part_of_a_form_is_tried_too():
    both, alone = (trial("coulomb_friction", 1.0, *parts).form for parts in ((SLIDES, PUSHES), (SLIDES,)))
    assert propose.is_part(alone, both) and not propose.is_part(both, alone) and not propose.is_part(alone, alone)


@pytest.mark.parametrize("low, high, unsized", [(-1e-5, 3e-4, True), (1e-5, 3e-4, False), (-3e-4, -1e-5, False), (np.nan, np.nan, True)])
def test_a_cause_whose_interval_holds_0_has_no_size(low, high, unsized):
    gap = Value(0.5 * (low + high), "m", (low, high))
    assert Cause("backlash", "spring", {"gap": gap}, 0.9).may_be_nothing is unsized
    assert not Cause("bump_stop", "spring", {"gap": gap, "stiffness": Value(1e4, "N/m", (9e3, 1.1e4))}, 0.9).may_be_nothing


def test_a_stop_stays_away_from_the_middle():
    """Nearer than 0.15 of what the deflection reaches it is a spring with play, the same formula (naming)."""
    place = SimpleNamespace(role="force", name="spring", ends=("body", "wheel"))
    gaps = [p for f in springs.forms(None, 0, place, Motion((), 0.01, 0.1, 0.04, 0.4)) if f.kind == "bump_stop" for p in f.parts]
    assert gaps and all(p.shapes["gap"][0] / p.span >= 0.15 * 0.04 for p in gaps)


def test_of_several_small_forms_at_a_place_none_is_its_curve():
    """A shaft with waves is a cube, a stop and two stiffnesses at once; a form that gains a tenth of another only makes up for it."""

    def found(kind: str, gain: float, where: str = "shaft", index: int = 0) -> SimpleNamespace:
        return SimpleNamespace(trial=SimpleNamespace(form=Form(kind, where, "force", index), gain=gain))

    sides, stop = found("asymmetric_spring", 200.0), found("bump_stop", 380.0)
    assert innovate._shares(sides, stop) and innovate._shares(stop, sides)
    assert not innovate._shares(sides, sides) and not innovate._shares(sides, found("coulomb_friction", 600.0, "bearing", 1))
    assert not innovate._shares(stop, found("cubic_spring", 38.0))


@pytest.mark.parametrize("transition, kind", [(0.01, "stribeck_friction"), (0.02, "")])
def test_a_peak_narrower_than_its_transition_is_none(transition, kind):
    """It only makes the transition steeper, and Coulomb friction has that with fewer values."""
    shapes = {"transition": (transition, "m/s"), "rise": (2.0, "1"), "stribeck": (0.015, "m/s")}
    part = Part("a law that falls", ("force", "N"), shapes)
    form = Form("stribeck_friction", "damper", "force", 0, (part,), "that falls from its breakaway")
    assert catalogue.fitted(form, [(10.0, part)], Motion((), 1e-3, 0.1, 2e-3, 0.2)).kind == kind
