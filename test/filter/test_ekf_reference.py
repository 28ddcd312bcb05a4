# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The generated filter against an independent one in float64, and its consistency over many runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import independent
import numpy as np
import plant
import pytest
from scipy.stats import chi2

import penode_gen
from penode_sil.filtering.compiled import Compiled

HERE = Path(__file__).parent
DOUBLE, FLOAT = 1e-9, independent.FLOAT  # of a standard deviation


def test_reference_is_the_filter_of_numpy(tmp_path: Path) -> None:
    """independent.c against plant.Dense, with missing measurements; both in double."""
    model = penode_gen.load(HERE / "models" / "layered.toml")
    fast, slow = independent.Reference(model, tmp_path, seed=3), plant.Dense(plant.Plant(model), model)
    _, z = fast.drive(300)
    z[50], z[60, 1] = np.nan, np.nan
    x, p = fast.run(z)
    for k, row in enumerate(z):
        slow.step(row)
        deviation = np.sqrt(np.diag(slow.p))
        assert np.max(np.abs(x[k] - slow.x) / deviation) < DOUBLE
        assert np.max(np.abs(p[k] - slow.p) / np.outer(deviation, deviation)) < DOUBLE


@pytest.mark.parametrize("name", ["layered", "folded"])
def test_filter_is_that_of_the_reference(name: str, tmp_path: Path, show: Callable[[str], None]) -> None:
    """Over 30 s, at every sample, in double and in float. An hour, with kinks within the rounding of a float: make campaign-filter."""
    model = penode_gen.load(HERE / "models" / f"{name}.toml")
    double, single = (independent.difference(model, dtype, 30_000, tmp_path) for dtype in (np.float64, np.float32))
    show(f"{name}: {double.state:.1e} off, in float {single.state:.1e}; after kinks {single.at_kinks:.1e}, {single.share:.1%}")
    assert max(double.state, double.covariance, double.at_kinks) < DOUBLE
    assert max(single.state, single.covariance, single.at_kinks) < FLOAT


@pytest.mark.long
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_filter_is_that_of_the_reference_for_ten_minutes(dtype: type, tmp_path: Path) -> None:
    """At every sample; in float it is 0.035 off within a minute, where a kink lies within the rounding of a float: not solved."""
    found = independent.difference(penode_gen.load(HERE / "models" / "layered.toml"), dtype, 600_000, tmp_path)
    assert max(found.state, found.covariance, found.at_kinks) < (DOUBLE if dtype is np.float64 else FLOAT)


def inside(values: np.ndarray, freedom: int) -> float:
    """Share of the samples in which the mean over the runs [samples, runs] is within its 95 % band."""
    runs = values.shape[1]
    low, high = chi2.ppf([0.025, 0.975], freedom * runs) / runs
    return float(np.mean((values.mean(axis=1) > low) & (values.mean(axis=1) < high)))


@pytest.mark.parametrize(("name", "seed"), [("measured", 1), ("measured_folded", 2)])
def test_filter_is_consistent_over_100_runs(name: str, seed: int, show: Callable[[str], None]) -> None:
    """NEES and NIS are inside of their 95 % bands in at least 90 % of the samples."""
    samples, runs = 1000, 100
    model = penode_gen.load(HERE / "models" / f"{name}.toml")
    truth = plant.drive(plant.Plant(model), model, samples, runs, seed, road=False)
    compiled, nees, nis = Compiled(model), np.zeros((samples, runs)), np.zeros((samples, runs))
    for run in range(runs):
        found, x, f = compiled.filter().run(np.zeros((samples, 1)), truth.z[:, run], estimates=False, covariance=True)
        error = x - truth.x[:, run, :4]
        nees[:, run] = np.einsum("ki,kij,kj->k", error, np.linalg.inv(plant.covariance(f)), error)
        nis[:, run] = found.ratio.sum(axis=1)
        assert not found.status.any()
    shares = inside(nees, 4), inside(nis, 2)
    show(f"{name}: NEES {nees.mean():.3f} of 4, inside in {shares[0]:.1%}; NIS {nis.mean():.3f} of 2, inside in {shares[1]:.1%}")
    assert min(shares) >= 0.9
