# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forms before they are accepted: which limits of a sensor its samples allow, and which forms are fitted."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis.catalogue.form import Form
from penode_sil.diagnosis.evidence.screening import Score
from penode_sil.diagnosis.search import clipping, propose


def test_no_limit_that_samples_are_beyond():
    """A sensor that cuts off at 1, with noise of 0.01: 0.2 % of its samples may be far out, the others are within three deviations."""
    y = np.clip(3.0 * np.sin(0.01 * np.arange(5000)), -1.0, 1.0)
    y[::1000] = 40.0
    bench = SimpleNamespace(records=(SimpleNamespace(y=y[:, None]),), noise=np.array([0.01]))
    assert clipping.least(bench, 0) == pytest.approx(0.97)


def test_forms_of_one_fault_take_one_place():
    """Late and lagging sensors promise the same; with a place for each they would crowd out the delay of the input behind them."""
    sensors = [Form("sensor_delay", f"y{j}", how, j, note=how) for j in range(propose.TRIED - 1) for how in ("late", "lag")]
    forms = [*sensors, Form("input_delay", "u", "input_delay", 0), Form("input_gain", "u", "input_gain", 0)]
    chosen = propose._chosen([(Score(100.0 - i, np.ones(1)), f) for i, f in enumerate(forms)])
    assert [f for _, f in chosen] == forms[:-1]
