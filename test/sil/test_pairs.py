# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Pairs of causes of which neither predicts anything alone, and levels of the unmodelled force. All scores are made up."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from penode_sil.diagnosis.catalogue.form import Form
from penode_sil.diagnosis.evidence.gain import Level
from penode_sil.diagnosis.search import rounds
from penode_sil.diagnosis.search.rounds import Rounds
from penode_sil.diagnosis.search.terms import Term, Trial
from penode_sil.diagnosis.search.worth import WORTH
from penode_sil.diagnosis.study.fit import Free


def trial(kind: str, nats: float) -> Trial:
    form = Form(kind, "drive", "force", 0, ())
    return Trial(
        form,
        Term(form, (), (Free(kind, 1.0, 1.0),)),
        SimpleNamespace(free=()),
        1.0,
        None,
        None,
        share=1.0,
        taken=1.0,
        blocks=np.full(4, nats / 4.0),
    )


def bench(*kinds: str, level: float = 0.0) -> Any:
    return SimpleNamespace(kinds=kinds, level=Level(level, 1.0))


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch):
    """Kinds that a search accepts with a level of the unmodelled force, where friction beside a lag gains so many nats."""

    def search(level: float, together: float) -> list[str]:
        lag, friction = trial("input_lag", -40.0), trial("coulomb_friction", together)
        start = bench(level=level)

        def good(self: Rounds, at: Any, scores: Any, forms: Any) -> tuple[Trial, ...]:
            return (friction,) if at.kinds == ("input_lag",) else ()

        def beside(self: Rounds, forms: Any) -> Any:
            return bench(*(a.trial.form.kind for a in forms), level=level), np.zeros(4), list(forms)

        monkeypatch.setattr(Rounds, "good", good)
        monkeypatch.setattr(Rounds, "beside", beside)
        monkeypatch.setattr(rounds, "propose", lambda at, terms, log, stiffer: [lag])
        monkeypatch.setattr(rounds, "scored", lambda at, blocks, t: t)
        monkeypatch.setattr(rounds, "adopt", lambda at, t, number: (bench(*at.kinds, t.form.kind, level=level), [t.term]))
        monkeypatch.setattr(rounds, "_based", lambda at, blocks: (at, np.full(4, -10.0)))
        start.problem = lambda wide: None
        monkeypatch.setattr(Rounds, "beside", lambda self, forms: beside(self, forms) if forms else (start, np.zeros(4), []))
        return [a.trial.form.kind for a in Rounds(start, None, lambda text: None).grow().accepted]

    return search


def test_a_pair_is_found_where_neither_of_it_predicts_anything_alone(found) -> None:
    assert found(0.3, 60.0) == ["input_lag", "coulomb_friction"]


def test_two_causes_have_to_gain_twice_as_much_as_one(found) -> None:
    assert found(0.3, 15.0) == []


def test_pairs_are_not_looked_for_where_little_is_unmodelled(found) -> None:
    assert found(0.5 * WORTH, 60.0) == []


@pytest.mark.parametrize(("level", "tried"), [(0.0, [3e-4, 1e-3, 3e-3]), (0.03, [0.09, 0.3, 0.9]), (0.3, [0.9])])
def test_no_level_is_more_than_all_forces(level: float, tried: list[float]) -> None:
    assert np.allclose(rounds.levels(Level(level, 1.0)), tried)
