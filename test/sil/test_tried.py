# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Rounds of a search: what was tried beside the same forms is not tried again, and forms that are left out are not found."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis.search import rounds
from penode_sil.diagnosis.search.rounds import Rounds


def form(kind):
    return SimpleNamespace(kind=kind, where="spring", how="force", index=0, series=None)


def accepted(number, form):
    return SimpleNamespace(number=number, trial=SimpleNamespace(form=form), terms=())


@pytest.fixture
def asked(monkeypatch):
    """How stiff the observer of each search for forms was."""
    calls = []

    def propose(bench, terms, log, stiffer):
        calls.append(stiffer)
        return [SimpleNamespace(form=form(kind), gain=20.0, share=0.2, taken=0.5, whole=0.5, run=0.0) for kind in ("cubic", "bushing")]

    monkeypatch.setattr(rounds, "propose", propose)
    monkeypatch.setattr(rounds, "scored", lambda bench, blocks, t: t)
    return calls


def test_trials_beside_the_same_forms_are_kept(asked):
    search = Rounds(SimpleNamespace(), SimpleNamespace(), lambda text: None)
    first, other = form("friction"), form("friction")
    bench = SimpleNamespace(records=[])
    scores = np.array([100.0, 200.0])
    found = search.trials(bench, scores, [accepted(0, first)])
    assert search.trials(bench, scores + 1.0, [accepted(0, first)]) is found and len(asked) == 1
    for again in (search, replace(search, stiffer=3.0), replace(search, without=frozenset({("cubic", "spring")}))):
        again.trials(bench, scores, [accepted(0, first)])
    assert asked == [1.0, 3.0, 1.0]
    search.trials(bench, scores, [accepted(1, first)])  # its parameters have other names
    search.trials(bench, scores, [accepted(0, other)])
    search.trials(bench, scores + 2.0, [accepted(0, first)])  # a bench that got elsewhere
    assert len(asked) == 6


def test_forms_that_are_left_out_are_not_found(asked):
    search = Rounds(SimpleNamespace(), SimpleNamespace(), lambda text: None, without=frozenset({("bushing", "spring")}))
    found = search.trials(SimpleNamespace(records=[]), np.zeros(4), [])
    assert [[t.form.kind for t in some] for some in (found.first, found.scored)] == [["cubic"]] * 2
