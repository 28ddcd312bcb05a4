# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The table of promises: complete, consistent with the tests and with the last figures."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "prove"))
import promises


def test_every_row_names_tests_that_exist_and_every_public_function_has_a_row():
    assert not promises.problems()


def test_page_is_as_generated():
    assert promises.PAGE.read_text() == promises.page(), "make prove-promises writes it again"


def test_what_is_missing_is_found(monkeypatch):
    row = ["`pen_exp`", "", "test_pen_math.c: test_nothing; prove-nothing", "{nothing/runs}"]
    monkeypatch.setattr(promises, "parts", lambda: [{"title": "", "rows": [row]}])
    found = "\n".join(promises.problems())
    assert "no test_nothing in test_pen_math.c" in found and "no target prove-nothing" in found and "no figure" in found
    assert "no row for pen_tanh" in found and "no row for pen_port_load" in found and "no row for nqvm_step" in found
    assert "no row for pen_exp" not in found


DATA = {
    "gate": {"a": {"runs": 2}, "b": {"runs": 3}, "faults": ["x", "y"]},
    "rows": [{"core": "m3", "n": [7, 8]}, {"core": "m4, f", "n": [1, 2]}],
}


@pytest.mark.parametrize(
    "text, found",
    [
        ("{gate/a/runs} runs", "2 runs"),
        ("{gate/*/runs}, {gate/*/*}", "5, 5"),
        ("{gate/faults} faults", "2 faults"),
        ("{rows/core=m4, f/n/1}", "2"),
        ("{rows/0/n/0}", "7"),
        ("{gate/c/runs}", "?"),
        ("{gate/a/runs}; campaign: {gate campaign/runs}", "2"),
    ],
)
def test_figures_are_put_in(text, found):
    assert promises.cell(text, DATA) == found
