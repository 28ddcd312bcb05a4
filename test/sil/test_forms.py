# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""One recording in sixty forms: all read with the same result, and what leaves a doubt is refused with what mends it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from recording_forms import COUNT, DOUBTFUL, FORMS, STEP, UNITS, Form, signals

from penode_sil.errors import UserError
from penode_sil.recordings import aliases, on_raster, read


def values(folder: Path, form: Form, options: tuple[str, ...] = ()) -> np.ndarray:
    """The channels [n, 4] in SI on the raster of the plain form."""
    path = folder / "r.csv"
    path.write_bytes(form.data)
    tables = read(path, [*UNITS, "time"], aliases((*form.options, *options), UNITS))
    return on_raster(tables, UNITS, STEP)[1]


def test_there_are_sixty():
    assert len(FORMS) >= 54 and len(FORMS) + len(DOUBTFUL) >= 60


@pytest.mark.parametrize("name", FORMS)
def test_form_is_read_as_the_plain_one(tmp_path, name):
    form = FORMS[name]
    plain, found = values(tmp_path, FORMS["plain"]), values(tmp_path, form)
    shift = COUNT - len(found)  # of two clocks only what both cover
    assert shift <= 1
    exact = np.column_stack(signals((np.arange(len(found)) + 0.5) * STEP)) if shift else plain
    assert found.shape == exact.shape
    assert np.max(np.abs(found - exact) / np.max(np.abs(plain), axis=0)) <= 2.0 * form.tolerance  # both are rounded


@pytest.mark.parametrize("name", DOUBTFUL)
def test_ambiguity_is_refused_with_the_remedy(tmp_path, name):
    form, reason, mended = DOUBTFUL[name]
    with pytest.raises(UserError) as caught:
        values(tmp_path, form)
    assert reason in str(caught.value) and all("; " in problem for problem in caught.value.problems)
    said = re.findall(r'--channel "([^"]*)"', str(caught.value))
    assert set(mended.options) <= set(said)
    assert np.max(np.abs(values(tmp_path, mended) - values(tmp_path, FORMS["plain"]))) <= 41.0 * 2e-8
