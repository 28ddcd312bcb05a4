# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""A sample of the campaign's random curves that are made to keep promises; judged by rational arithmetic of its own."""

from __future__ import annotations

from pathlib import Path

import campaign_promises
import numpy as np
import pytest

from penode_gen.model import Promises
from penode_gen.reading.untrained import untrained
from penode_sil.training import curve, unfold


@pytest.mark.parametrize("given", campaign_promises.GIVEN, ids=range(4))
def test_random_curves_keep_their_promises(given: Promises) -> None:
    random = np.random.default_rng(3)
    before, after, refused = zip(*(campaign_promises.kept(given, random, [8, 8]) for _ in range(3)), strict=True)
    assert all(before) and not any(after) and not any(refused)


def test_trained_curves_keep_their_promises(tmp_path: Path) -> None:
    """Those of two trainings; one that promises nothing breaks them: the plants do."""
    found = list(campaign_promises.trained(2, 1, tmp_path))
    assert all(network is not None and not campaign_promises.breaks(given, network) for given, network in found)
    free = list(campaign_promises.trained(1, 1, tmp_path, promising=False))
    assert any(campaign_promises.breaks(given, network) for given, network in free)


@pytest.mark.parametrize("name", campaign_promises.FAULTS)
def test_faults_in_the_limits_are_found(name: str) -> None:
    assert campaign_promises.seen(name, 8) > 0


def test_independent_judge_finds_broken_promises() -> None:
    """Seeded faults: a falling piece, a slope above the limit, a force that drives."""
    network = untrained({"layers": [8, 8]}, 1, "net")
    knots = np.linspace(-1.0, 1.0, 9)

    def judged(values: np.ndarray, given: Promises) -> bool:
        return campaign_promises.breaks(given, unfold.unfold(curve.Curve(knots, values, 4), network, -1.0, 1.0))

    rising = np.round(64.0 * knots)
    assert not judged(rising, Promises(increasing=True, max_slope=64.0, dissipative=0.0, zero_at_zero=True))
    dent = rising + np.where(np.arange(9) == 6, 16.5, 0.0)
    assert (
        judged(dent, Promises(increasing=True)) and judged(dent, Promises(max_slope=100.0)) and not judged(dent, Promises(dissipative=0.0))
    )
    drives = np.where(np.arange(9) == 6, -0.25, rising)
    assert judged(drives, Promises(dissipative=0.125)) and not judged(drives, Promises(dissipative=0.25))
