# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a filter meets: outliers, drop-outs, a wrong start, another set, badly scaled states."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import plant
import pytest

import penode_gen
from penode_sil.filtering.compiled import Compiled
from penode_sil.filtering.estimates import FLAGS, VERDICTS

HERE = Path(__file__).parent
QUARTER = HERE.parents[1] / "sil" / "filter" / "quarter.toml"
SECOND = round(1.0 / plant.H)


@pytest.fixture(scope="module")
def quarter():
    """The example and its plant."""
    model = penode_gen.load(QUARTER)
    own = plant.Plant(model)
    return model, own


def run(compiled: Compiled, z: np.ndarray):
    return compiled.filter().run(np.zeros((len(z), 1)), z, estimates=False, covariance=True)


def at_rest(own, model, samples: int, seed: int, offset: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0), then=None) -> plant.Truth:
    """A run that begins at rest, or `offset` from it; from the second second on of the plant `then`."""
    given, rng = model.filter, np.random.default_rng(seed)
    x, u = np.array(model.start) + np.array(offset), 0.0
    rows, measured = np.zeros((samples, 5)), np.zeros((samples, 2))
    for k in range(samples):
        own = then if then and k >= SECOND else own
        if k:
            now = given.inputs[0].decay * u + given.inputs[0].step * rng.standard_normal()
            x = own.step(x, np.float64(u), np.float64(now))[0] + [s.noise * rng.standard_normal() for s in given.states]
            u = now
        rows[k], measured[k] = [*x, u], own.sense(x, np.float64(u))[0] + [s.noise * rng.standard_normal() for s in given.sensors]
    return plant.Truth(rows, measured)


def test_wrong_start_is_forgotten_within_two_seconds(quarter, show: Callable[[str], None]) -> None:
    model, own = quarter
    truth = at_rest(own, model, 4 * SECOND, 1, (0.02, 0.02, 0.2, 0.2))
    _, x, f = run(Compiled(model), truth.z)
    deviation = np.sqrt(np.diagonal(plant.covariance(f), axis1=1, axis2=2))
    ratio = np.abs(x - truth.x) / deviation
    show(f"20 mm and 0.2 m/s off: at most {ratio[2 * SECOND :].max():.2f} standard deviations after 2 s")
    assert ratio[2 * SECOND :].max() < 3.0


def test_exchange_of_sets_keeps_state_and_covariance(quarter, show: Callable[[str], None]) -> None:
    """The plant's damper changes, and the filter gets its set: no error beyond three standard deviations afterwards."""
    model, own = quarter
    truth = at_rest(own, model, 3 * SECOND, 2, then=plant.Plant(model, "altered_friction"))
    own_filter = Compiled(model).filter()
    _, x, before = own_filter.run(np.zeros((SECOND, 1)), truth.z[:SECOND], covariance=True)
    assert own_filter.select("altered_friction") == 0
    found, x, f = own_filter.run(np.zeros((2 * SECOND, 1)), truth.z[SECOND:], covariance=True)
    assert found.status[0] == 0x40  # PEN_ADOPTED
    assert np.mean(found.status[1:] == 0) > 0.99  # else refused: a gate of 5, and a friction that is not linear
    deviation = np.sqrt(np.diagonal(plant.covariance(f), axis1=1, axis2=2))
    assert np.allclose(deviation[0], np.sqrt(np.diagonal(plant.covariance(before[-1]))), rtol=0.05)
    ratio = np.abs(x - truth.x[SECOND:]) / deviation
    show(f"after an exchange at most {ratio.max():.2f} standard deviations")
    assert ratio.max() < 3.0


@pytest.mark.parametrize("sensor", [0, 1])
def test_outliers_and_drop_outs_are_refused_and_flagged(quarter, sensor: int, show: Callable[[str], None]) -> None:
    """Outliers of 50 standard deviations of the innovation in 1 % of the samples, and one second without the sensor."""
    model, own = quarter
    samples, rng = 6 * SECOND, np.random.default_rng(3)
    truth = at_rest(own, model, samples, 4)
    compiled, z = Compiled(model), truth.z.copy()
    clean, x_clean, _ = run(compiled, z)
    out = rng.random(samples) < 0.01
    out[:10] = False
    z[out, sensor] += 50.0 * np.sqrt(clean.variance[:, sensor].max()) * rng.choice([-1.0, 1.0], out.sum())
    gap = slice(3 * SECOND, 4 * SECOND)
    z[gap, sensor] = np.nan
    found, x, f = run(compiled, z)
    wanted = np.where(np.isnan(z[:, sensor]), VERDICTS.index("missing"), np.where(out, VERDICTS.index("refused"), VERDICTS.index("used")))
    verdicts = found.verdict[:, sensor]
    seen = out & (wanted == VERDICTS.index("refused"))
    assert np.array_equal(verdicts[np.isnan(z[:, sensor])], wanted[np.isnan(z[:, sensor])])
    refused = float(np.mean(verdicts[seen] == VERDICTS.index("refused")))
    assert (found.status[np.isnan(z[:, sensor])] & FLAGS["missing"]).all()
    assert ((found.status & FLAGS["refused"] > 0) == (found.verdict == VERDICTS.index("refused")).any(axis=1)).all()
    assert np.array_equal(found.counts[sensor], np.bincount(verdicts, minlength=len(VERDICTS)))
    outside = np.ones(samples, bool)
    outside[gap] = False
    rms, rms_clean = (np.sqrt(np.mean((est - truth.x)[outside] ** 2, axis=0)) for est in (x, x_clean))
    worse, name = np.max(rms / rms_clean), model.filter.sensors[sensor].name
    show(f"{name}: {refused:.1%} of {seen.sum()} outliers refused, error at most {worse:.2f} times")
    assert refused > 0.99 and worse < 2.0
    assert (np.diagonal(f, axis1=1, axis2=2) > 0.0).all()


def joseph_fails(phi: np.ndarray, start: np.ndarray, q: np.ndarray, r: float, samples: int) -> int:
    """Samples in which a plain Joseph form in float has a covariance that is not positive; the sum is measured."""
    real, fails = np.float32, 0
    p, phi, h = np.diag(start**2).astype(real), phi.astype(real), np.ones(len(start), dtype=real)
    for k in range(samples):
        if k:
            p = phi @ p @ phi.T + np.diag(q).astype(real)
        gain = p @ h / (h @ p @ h + real(r))
        keep = np.eye(len(start), dtype=real) - np.outer(gain, h)
        p = keep @ p @ keep.T + real(r) * np.outer(gain, gain)
        fails += not np.linalg.eigvalsh((p.astype(float) + p.T) / 2).min() > 0.0
    return fails


def test_covariance_of_badly_scaled_states_stays_positive(show: Callable[[str], None]) -> None:
    samples = 2000
    model = penode_gen.load(HERE / "models" / "scaled.toml")
    compiled, rng = Compiled(model), np.random.default_rng(1)
    z = 50.0 + 1e-5 * rng.standard_normal((samples, 1))
    found, _, f = run(compiled, z)
    assert (np.diagonal(f, axis1=1, axis2=2) > 0.0).all() and np.isfinite(f).all()
    assert not (found.status & FLAGS["nonfinite"]).any()
    worst = max(np.linalg.cond(p) for p in plant.covariance(f[::20]))
    start = np.array([s.start for s in model.filter.states])
    phi = np.eye(4) + 0.01 * np.array([[-1.0, 1.0, 0.0, 0.0], [1.0, -2.0, 1.0, 0.0], [0.0, 1.0, -2.0, 1.0], [0.0, 0.0, 1.0, -1.0]])
    q = np.array([s.noise**2 for s in model.filter.states])
    fails = joseph_fails(phi, start, q, 1e-10, samples)
    show(f"condition up to {worst:.1e}: 0 of {samples} covariances not positive; Joseph's form in float: {fails}")
    assert worst > 1e12 and fails > 0
