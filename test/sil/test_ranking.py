# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which of several forms a search by innovations takes, and whose answer stands: made-up trials, no simulation."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis import by_noise, propose, rounds
from penode_sil.diagnosis.catalogue import springs
from penode_sil.diagnosis.catalogue.form import Form, Motion, Part
from penode_sil.diagnosis.result import Cause, Value

BASE = np.zeros(4)
SLIDES, PUSHES = Part("coulomb_friction", ("force", "N")), Part("constant_force", ("force", "N"))
LOOSE, LATE = Part("loose_damper", ("damping", "N*s/m")), Part("maxwell_bushing", ("stiffness", "N/m"))


def trial(kind: str, blocks: float, *parts: Part, note: str = "", where: str = "spring", free: int = 1) -> SimpleNamespace:
    """A form that predicts each of four blocks better by so many nats."""
    form = Form(kind, where, "force", 0, parts, note)
    return SimpleNamespace(form=form, blocks=np.full(4, blocks), gain=4.0 * blocks, term=SimpleNamespace(free=[None] * free))


def test_a_form_has_to_predict_better_than_a_part_of_it():
    constant = trial("constant_force", 20.0, PUSHES)
    both = trial("coulomb_friction", 22.0, SLIDES, PUSHES, note="with a constant")
    assert rounds._is_enough(constant, both)  # 8 nats more, of 10 that a law has to gain
    assert not rounds._is_enough(constant, trial("coulomb_friction", 30.0, SLIDES, PUSHES, note="with a constant"))
    assert not rounds._is_enough(both, constant)
    assert not rounds._is_enough(trial("constant_force", 20.0, PUSHES, where="tyre"), trial("coulomb_friction", 1.0, SLIDES))


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
    assert rounds.simplest([stop, trial("cubic_spring", 97.0, LOOSE)], BASE, []) is stop


def test_what_is_a_part_of_a_form_is_tried_too():
    both, alone = (trial("coulomb_friction", 1.0, *parts).form for parts in ((SLIDES, PUSHES), (SLIDES,)))
    assert propose.is_part(alone, both) and not propose.is_part(both, alone) and not propose.is_part(alone, alone)


@pytest.mark.parametrize("low, high, unsized", [(-1e-5, 3e-4, True), (1e-5, 3e-4, False), (-3e-4, -1e-5, False), (np.nan, np.nan, True)])
def test_a_cause_whose_interval_holds_0_has_no_size(low, high, unsized):
    gap = Value(0.5 * (low + high), "m", (low, high))
    assert Cause("backlash", "spring", {"gap": gap}, 0.9).may_be_nothing is unsized
    assert not Cause("bump_stop", "spring", {"gap": gap, "stiffness": Value(1e4, "N/m", (9e3, 1.1e4))}, 0.9).may_be_nothing


def test_what_may_be_nothing_is_not_named_beside_other_causes():
    """Fitted sizes only: not the share of lost samples, which is counted, nor a parameter of the file; and not the only cause."""
    wide = (-1e-5, 3e-4)
    play, lost = (
        Cause("backlash", "spring", {"gap": Value(1e-4, "m", wide)}, 0.9),
        Cause("sensor_dropout", "x", {"share": Value(1e-4, "1", (0.0, 3e-4))}, 0.9),
    )
    own = Cause("wrong_parameter", "k", {"k": Value(1e-4, "N/m", wide)}, 0.9)
    study = SimpleNamespace(model=SimpleNamespace(parameters={"k": None}))
    best = SimpleNamespace(groups=(("backlash", "spring"), ("wrong_parameter", "k")))
    assert by_noise._with_a_size(study, best, (play, lost, own)) == ((lost, own), [play])
    assert by_noise._with_a_size(study, best, (play,)) == ((play,), [])


def test_a_stop_stays_away_from_the_middle():
    """Nearer than 0.15 of what the deflection reaches it is a spring with play, the same formula (naming)."""
    place = SimpleNamespace(role="force", name="spring", ends=("body", "wheel"))
    gaps = [p for f in springs.forms(None, 0, place, Motion((), 0.01, 0.1, 0.04, 0.4)) if f.kind == "bump_stop" for p in f.parts]
    assert gaps and all(p.shapes["gap"][0] / p.span >= 0.15 * 0.04 for p in gaps)
