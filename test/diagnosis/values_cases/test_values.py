# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Wrong values in a model file without tolerances: the fewest that explain the recordings are named, with their sizes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from campaign import forked

from values_cases import values_campaign as values


@pytest.mark.parametrize(("index", "names"), [(3, ["c", "c_t"]), (4, ["c"])])
def test_wrong_values_are_named_and_no_others(index: int, names: list[str], tmp_path: Path) -> None:
    """A common factor of all values is invisible, so a fit of all of them moves all; only those that have to move are named and written."""
    case, factors = values.draw(5, index)
    assert sorted(factors) == names
    paths = values.write(case, factors, tmp_path)
    found, _, why = values.diagnose("penode diagnose", tmp_path, paths, 300.0, forked)
    assert found, why
    right, words, errors = values.judged(case, factors, found)
    assert right, (words, errors)
    written = (tmp_path / "diagnosis" / "model_extended.toml").read_text().split("[parameters]")[1].split("[")[0]
    assert sorted(line.split(" =")[0] for line in written.splitlines() if " = " in line) == names
    assert found["verdict"] == "explained" and json.dumps(found["explanations"]).count("wrong_parameter") == len(names)


def test_a_common_factor_is_no_case() -> None:
    """A common factor of all values shows nothing."""
    case, factors = values.draw(5, 3)
    assert values.solvable(case, factors)
    assert not values.solvable(case, dict.fromkeys(case.bench.plant.true, 1.1))
