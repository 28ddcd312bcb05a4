# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Parameters without tolerances, all a little off, for a file gives two or three digits, and some far: only these are named. Data come from
an integrator of SciPy; a foot drives the mass, so motion shows ratios of the parameters only."""

from __future__ import annotations

import json

import numpy as np
import pytest
from footed import NOISE, STEP, model, moved, tones, write
from samples import sample

FINE = 8  # parts of a sample that are integrated as straight lines: what they cut off tones is 1.6e-5 of them, 0.1 % in whole samples


def record(path, m: float, k: float, d: float, seed: int, n: int = 5000):
    """A recording of a rig with these parameters [SI] whose foot moves in 16 tones."""
    rng = np.random.default_rng(seed)
    t = np.arange(FINE * n) * STEP / FINE
    foot = tones(t, rng)
    y = moved(t, foot, m, k, d)[::FINE] + rng.standard_normal((n, 2)) * NOISE
    return write(path, t[::FINE], foot[::FINE], y)


MASS, BOTH = ((22.6, 19920.0, 121.0), ["m"]), ((22.6, 19920.0, 160.0), ["d", "m"])


@pytest.mark.parametrize("true, off", sample((MASS, BOTH, ((20.1, 22800.0, 119.2), ["k"])), MASS))
def test_only_values_that_are_off_by_more_than_they_are_rounded_are_named(tmp_path, penode, true, off):
    """Of three ratios any two values are as good as any others: all three pairs are in the set."""
    (tmp_path / "rig.toml").write_text(model())
    train, held = (record(tmp_path / f"{name}.csv", *true, seed) for name, seed in (("train", 1), ("held", 2)))
    penode("diagnose", tmp_path / "rig.toml", "--data", train, "--holdout", held, "-o", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    assert {c["kind"] for c in found["causes"]} == {"wrong_parameter"} and found["verdict"] == "explained"
    sets = [sorted(c["where"] for c in s["causes"]) for s in found["explanations"]]
    assert off in sets and {len(s) for s in sets} == {len(off)} and len(sets) == (1 if len(off) == 1 else 3)
    for size, value in ((c["parameters"][c["where"]], true["mkd".index(c["where"])]) for c in found["causes"] if sets == [off]):
        (low, high) = size["ci95"]
        assert low < value < high and high - low < 0.02 * value  # as exact as the others are written
