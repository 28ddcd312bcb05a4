# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""The generated filter against an independent one in float64, and its consistency over many runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import plant
import pytest
from scipy.stats import chi2

import penode_gen
from penode_sil.filtering.compiled import Compiled

HERE = Path(__file__).parent
DOUBLE, FLOAT = 1e-9, 1e-2  # of a standard deviation


def worst(model, dtype: type, seconds: float) -> tuple[float, float]:
    """Largest difference of state [standard deviations] and of covariance [of their products] from the reference."""
    samples = round(seconds / plant.H)
    own = plant.Plant(model)
    truth = plant.drive(own, model, samples, 1, seed=3)
    _, x, f = Compiled(model, dtype).filter().run(np.zeros((samples, 1)), truth.z[:, 0], estimates=False, covariance=True)
    reference, of_state, of_covariance = plant.Dense(own, model), 0.0, 0.0
    for k in range(samples):
        reference.step(truth.z[k, 0])
        deviation = np.sqrt(np.diag(reference.p))
        of_state = max(of_state, float(np.max(np.abs(x[k] - reference.x) / deviation)))
        off = np.abs(plant.covariance(f[k]) - reference.p) / np.outer(deviation, deviation)
        of_covariance = max(of_covariance, float(np.max(off)))
    return of_state, of_covariance


@pytest.mark.parametrize("name", ["layered", "folded"])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_filter_is_that_of_the_reference(name: str, dtype: type) -> None:
    """Over 3 s double is 4.6e-12 off, float 1.2e-3."""
    of_state, of_covariance = worst(penode_gen.load(HERE / f"{name}.toml"), dtype, 4.0)
    limit = DOUBLE if dtype is np.float64 else FLOAT
    assert of_state < limit and of_covariance < limit


@pytest.mark.long
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_filter_is_that_of_the_reference_for_ten_minutes(dtype: type) -> None:
    of_state, of_covariance = worst(penode_gen.load(HERE / "layered.toml"), dtype, 600.0)
    limit = DOUBLE if dtype is np.float64 else FLOAT
    assert of_state < limit and of_covariance < limit


def inside(values: np.ndarray, freedom: int) -> float:
    """Share of the samples in which the mean over the runs [samples, runs] is within its 95 % band."""
    runs = values.shape[1]
    low, high = chi2.ppf([0.025, 0.975], freedom * runs) / runs
    return float(np.mean((values.mean(axis=1) > low) & (values.mean(axis=1) < high)))


@pytest.mark.parametrize(("name", "seed"), [("measured", 1), ("measured_folded", 2)])
def test_filter_is_consistent_over_100_runs(name: str, seed: int, show: Callable[[str], None]) -> None:
    """NEES and NIS are inside of their 95 % bands in at least 90 % of the samples."""
    samples, runs = 1000, 100
    model = penode_gen.load(HERE / f"{name}.toml")
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
