# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Forces that are not piecewise linear: trained, or refused with the reason, and never trained with a wrong force."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).with_name("smooth")))
import many

WRONG = 2.0  # [%] of a force's span


@pytest.mark.parametrize(("kind", "number"), [("alone", 12), ("beside", 3), ("tank", 4)])
def test_a_smooth_force_is_found(kind: str, number: int, tmp_path: Path) -> None:
    """Alone 12: a damper that drove at its outermost knot; tank 4: a network of the absolute temperature, the capacity 10 % unknown."""
    row = many.train(kind, number, tmp_path, 15.0)
    assert row.get("converged"), row
    assert max(row["errors"].values()) < WRONG, row


@pytest.mark.long
def test_forty_trainings(tmp_path: Path) -> None:
    """40 trained or refused with the reason, none trained with a force error above 2 %; 95 % bands hold 90 to 98 % of springs and of
    dampers."""
    rows = [many.train(kind, number, tmp_path) for kind, count in many.COUNTS.items() for number in range(1, count + 1)]
    assert len(rows) == 40
    good = [r for r in rows if r.get("converged")]
    assert all(max(r["errors"].values()) < WRONG for r in good), many.summary(rows)
    assert len(good) >= 38, [r for r in rows if not r.get("converged")]
    for name in ("spring_net", "damper_net"):
        held = float(np.mean([r["covered"][name] for r in good if name in r["covered"]]))
        assert 90.0 <= held <= 98.0, (name, held)
