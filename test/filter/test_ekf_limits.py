# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Limits of the state hold to the bit at every step, and estimates are no worse for them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import plant

import penode_gen
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.estimates import FLAGS

LAYERED = Path(__file__).parent / "models" / "layered.toml"


def limited(folder: Path, least: float, most: float):
    """layered.toml with bounds of both heights and a limit of the tyre's deflection [m]."""
    path = folder / "limited.toml"
    text = LAYERED.read_text().replace("../../../gen", str(LAYERED.parents[3] / "gen")).replace('"layered"', '"limited"')
    text = text.replace("z_b = { start = 1e-4, noise = 1e-5 }", f"z_b = {{ start = 1e-4, noise = 1e-5, min = {least}, max = {most} }}")
    path.write_text(text + f'\n[filter.limits]\ntyre = {{ value = "F_tyre", unit = "kN", min = {300.0 * least}, max = {300.0 * most} }}\n')
    return penode_gen.load(path)


def test_limits_hold_to_the_bit_and_cost_no_accuracy(tmp_path: Path, show: Callable[[str], None]) -> None:
    """Truth stays just within its limits. In float32 as the C sums, and in float64, every estimate does."""
    samples, runs, model = 1500, 12, penode_gen.load(LAYERED)
    truth = plant.drive(plant.Plant(model), model, samples, runs, seed=5)
    free, nees, active = Compiled(model), [], 0
    for run in range(runs):
        x, z = truth.x[:, run], truth.z[:, run]
        tyre = x[:, 1] - x[:, 4]
        bound = float(max(np.abs(tyre).max(), np.abs(x[:, 0]).max())) * (1.0 + 1e-6)
        held = limited(tmp_path, -bound, bound)
        found, own, f = Compiled(held).filter().run(np.zeros((samples, 1)), z, estimates=False, covariance=True)
        _, other, g = free.filter().run(np.zeros((samples, 1)), z, estimates=False, covariance=True)
        limit = np.float32(bound)
        assert (np.abs(own[:, 0]) <= limit).all() and (np.abs(own[:, 1] - own[:, 4]) <= limit).all()
        exact = own.astype(float)
        assert (np.abs(exact[:, 0]) <= float(limit)).all() and (np.abs(exact[:, 1] - exact[:, 4]) <= float(limit)).all()
        active += int((found.status & FLAGS["limited"] > 0).sum())
        squares = ((exact - x, f), (other - x, g))
        nees.append([np.einsum("ki,kij,kj->k", e, np.linalg.inv(plant.covariance(p)), e).mean() for e, p in squares])
    with_limits, without = np.mean(nees, axis=0)
    show(f"limits active in {active} of {samples * runs} samples; NEES {with_limits:.3f}, without limits {without:.3f}")
    assert active > 100 and with_limits <= 1.02 * without
