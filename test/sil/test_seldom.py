# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What happens seldom: held-out blocks are in pieces, so that the fit of the others has some of it."""

from __future__ import annotations

import numpy as np
from test_innovations import answered, swing

from penode_sil.diagnosis.evidence.blocks import BLOCKS, PIECES, Blocks

GAP, STIFFNESS = 1.6, 0.6  # rad, N*m/rad of the stop


def test_each_block_has_a_piece_of_every_part_of_a_recording() -> None:
    """Any fifth of the updates has as many of every block, but for those at the start, which are in none."""
    number = Blocks.of([4000]).number
    for part in np.array_split(number, PIECES)[1:]:
        assert np.bincount(part).tolist() == [4000 // PIECES // BLOCKS] * BLOCKS
    assert [Blocks.of([250, 700, 50]).number[begin] for begin in (0, 250, 950)] == [-1, -1, -1]


def test_a_stop_that_is_hit_near_the_end_alone_is_named(tmp_path) -> None:
    """In contiguous quarters, the last would have nearly all contacts: a play with twice the stiffness predicted more of them."""

    def torque(phi: float, omega: float) -> float:
        return 0.02 * phi * abs(phi) + STIFFNESS * float(np.sign(phi)) * max(abs(phi) - GAP, 0.0)

    model, experiments = swing(tmp_path, torque)
    contacts = [np.mean(np.abs(part) > GAP) for part in np.array_split(experiments[0].y[:, 0], BLOCKS)]
    assert contacts[3] > 10.0 * max(contacts[:3])
    (stop,) = (c for c in answered(model, experiments).causes if c.kind != "cubic_spring")
    assert stop.kind == "bump_stop"
    gap, stiffness = stop.parameters["gap"], stop.parameters["stiffness"]
    assert abs(gap.value - GAP) < 0.05 and abs(stiffness.value - STIFFNESS) < 0.1
