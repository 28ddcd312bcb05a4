# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The final check: the written model is read back and simulated as a user would do it, and results that break a rule are withdrawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ...compared import REJECTED
from ..result import Diagnosis
from ..study import residual
from ..study.missing import missing_forces
from .case import Case, End
from .channels import Mix, with_mixes
from .figures import tabled, with_figures
from .rules import RULES


def checked(case: Case, end: End, mixes: Sequence[Mix] = ()) -> Diagnosis:
    """The answer of a search after all rules, with figures and pictures of the written model. `mixes`: exchanged or inverted channels that
    were corrected before. Raises UserError."""
    (case.output / REJECTED).unlink(missing_ok=True)  # of an answer before
    case.tell(0.87, "checking the extended model")
    table = tabled(case, end)
    for rule in RULES:
        if broken := rule.broken(case, end, table):
            case.log(f"{rule.name}: {broken}")
            before, end = end, rule.consequence(case, end, table, broken)
            table = table if end.extended is before.extended else tabled(case, end)
    case.tell(0.9, "showing what is wrong")
    answer, train, held = with_figures(case, end, table)
    missing = missing_forces(end.study) if answer.verdict == "unexplained" else ()
    shown = residual.Shown(tuple(train), tuple(held), table.surfaces, missing)
    return replace(with_mixes(case.nominal, mixes, answer), residual=shown.numbers(), shown=shown)
