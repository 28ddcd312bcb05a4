# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Which of the two searches answers, by what is left unmodelled (the table of sil/README). Nothing is simulated."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from penode_sil.diagnosis import engine
from penode_sil.diagnosis.checks.case import End


@pytest.fixture
def answers(monkeypatch: pytest.MonkeyPatch):
    """The search that answers. Shares that are left unmodelled: by the nominal model (`free`), the best single cause (`single`), all causes
    that samples show (`beside`), all that innovations find (`level`). `says`: the verdicts of samples and of innovations."""

    def search(
        says: tuple[str, str] = ("explained", "explained"),
        free: float = 0.0,
        single: float = 0.0,
        beside: float = 0.0,
        level: float = 0.0,
        guessed: tuple[str, ...] = (),
        inputs: tuple[str, ...] = ("road",),
        supported: bool = True,
        doubt: str = "",
    ) -> tuple[str, bool]:
        def end(name: str, verdict: str) -> End:
            own: Any = (SimpleNamespace(verdict=verdict, by=name), None, None, None, ())
            return End(*own)

        ones, all_of_them = SimpleNamespace(fit="single", terms=()), SimpleNamespace(fit="beside", terms=())
        left = {"null": free, "single": single, "beside": beside}
        answer = SimpleNamespace(found=SimpleNamespace(bench=SimpleNamespace(level=SimpleNamespace(size=level))))
        same: dict[Any, Any] = {
            (engine, "broken_sensors"): lambda *of: [],
            (engine.verdict, "supports"): lambda model: supported,
            (engine.verdict, "searched"): lambda case, study: answer,
            (engine.verdict, "conclude"): lambda case, study, found, broken: end("innovations", says[1]),
            (engine, "guessed"): lambda model: guessed,
            (engine, "unmodelled"): lambda study, fit, log: left[fit],
            (engine.search, "first"): lambda study, log: (study, [ones]),
            (engine.search, "grow"): lambda study, beam, log, hopeless: (study, [all_of_them]),
            (engine, "resting"): lambda other, study, explanations, log: (study, explanations),
            (engine, "judge_explanations"): lambda case, study, *of: (study, SimpleNamespace(verdict=says[0], doubt=doubt, drift=0.0)),
            (engine, "by_noise"): lambda case, study, best, judged: end("samples", says[0]),
        }
        for (module, name), stub in same.items():
            monkeypatch.setattr(module, name, stub)
        null = type("Null", (str,), {"simulated": ()})("null")
        study: Any = SimpleNamespace(model=SimpleNamespace(inputs=inputs), null=null)
        case: Any = SimpleNamespace(train=(), log=print, tell=lambda *of: None)
        found: Any = engine._searched(case, study, study, [])
        return found.answer.by, found.other is not None

    return search


def test_samples_answer_where_they_leave_nothing_unmodelled(answers) -> None:
    assert answers() == ("samples", True)
    assert answers(single=0.1, level=0.001) == ("samples", True)


def test_innovations_answer_where_samples_show_no_motion_that_is_about_right(answers) -> None:
    assert answers(guessed=("d",)) == ("innovations", False)
    assert answers(inputs=(), free=0.03) == ("innovations", False)
    assert answers(inputs=()) == ("samples", True)


def test_innovations_answer_where_the_model_is_wrong_everywhere(answers) -> None:
    assert answers(single=0.03, level=0.03) == ("innovations", False)
    assert answers(single=0.03, level=0.2) == ("samples", True)
    assert answers(single=0.03, level=0.03, says=("explained", "unexplained")) == ("samples", True)
    assert answers(beside=0.03) == ("innovations", False)
    assert answers(beside=0.03, says=("explained", "unexplained")) == ("innovations", False)


def test_samples_answer_where_innovations_explain_nothing_and_little_is_left(answers) -> None:
    assert answers(beside=0.01) == ("innovations", False)
    assert answers(beside=0.01, says=("explained", "unexplained")) == ("samples", True)
    assert answers(says=("unexplained", "explained")) == ("innovations", False)
    assert answers(says=("unexplained", "unexplained")) == ("samples", False)
    assert answers(says=("unexplained", "explained"), doubt="another plant") == ("samples", False)


def test_samples_alone_answer_for_models_that_innovations_do_not_support(answers) -> None:
    assert answers(supported=False, single=0.1, beside=0.1, guessed=("d",)) == ("samples", False)
