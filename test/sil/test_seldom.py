# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What happens seldom: held-out blocks are in pieces, so that the fit of the others has some of it."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
from test_innovations import answered, swing

from penode_sil.diagnosis.evidence.bench import UPDATES
from penode_sil.diagnosis.evidence.blocks import BLOCKS, PIECES, Blocks
from penode_sil.diagnosis.evidence.observer import Record

GAP, STIFFNESS = 1.6, 0.6  # rad, N*m/rad of the stop


def test_each_block_has_a_piece_of_every_part_of_a_recording() -> None:
    """Any fifth of the updates has as many of every block, but for those at the start, which are in none."""
    number = Blocks.of([4000]).number
    for part in np.array_split(number, PIECES)[1:]:
        assert np.bincount(part).tolist() == [4000 // PIECES // BLOCKS] * BLOCKS
    assert [Blocks.of([250, 700, 50]).number[begin] for begin in (0, 250, 950)] == [-1, -1, -1]


def test_no_block_has_what_only_noise_of_an_input_moves(tmp_path) -> None:
    """A vehicle at rest before and after 1.2 s of sine on a road whose noise is stated; one of its sensors is not recorded. Means over a
    period of the motion make the rest that much shorter, and half of them at an end may be large; without stated noise, every update is in
    a block."""
    step, noise = 2e-3, 3e-5
    t = step * np.arange(3000)
    z = np.where(np.abs(t - 3.0) < 0.6, 0.01 * np.sin(2 * np.pi * 1.5 * t), 0.0)
    rng = np.random.default_rng(2)
    road, travel = z + noise * rng.standard_normal(3000), z + 5.0 + 1e-5 * rng.standard_normal(3000)
    record = Record("bump", step, road[:, None], np.column_stack([travel, np.full(3000, np.nan)]))

    def bench(road: float) -> SimpleNamespace:
        return SimpleNamespace(
            base=SimpleNamespace(inputs=[SimpleNamespace(noise=road)]), noise=np.array([1e-5, 1e-5]), records=[record], update=3
        )

    moving = Blocks.moving(bench(noise)).number
    at_all = 3 * step * np.arange(1000)
    at = at_all[moving >= 0]
    assert np.mean(np.abs(at - 3.0) < 0.6 + UPDATES / 2 * 3 * step + 1e-9) > 0.97
    assert set(moving[(at_all > 2.4) & (at_all < 3.6)]) == set(range(BLOCKS))
    assert np.ptp(np.bincount(moving[moving >= 0])) <= 0.3 * np.mean(np.bincount(moving[moving >= 0]))
    assert (Blocks.moving(bench(0.0)).number == Blocks.of([1000]).number).all()


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
