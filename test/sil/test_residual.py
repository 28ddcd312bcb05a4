# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Where a simulation is wrong: spectra, coherence, whiteness and forces of signals for which they are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats
from test_diagnosis import MODEL, SAMPLES, STEP, C, D, drive, record, road

import penode_gen
from penode_sil.diagnosis.study import noise, residual, restoring, study
from penode_sil.diagnosis.study.driven import experiment
from penode_sil.recordings.measured import load

N, H = 40_000, 2e-3  # samples, interval [s]
LENGTH = 1000
SEGMENTS = (2 * N // LENGTH - 1) / residual.OVERLAP  # that count as independent


def test_density_of_white_noise_is_its_variance_over_the_band():
    rng = np.random.default_rng(1)
    f, power = residual.density(3.0 * rng.standard_normal(N), H, LENGTH)
    # 2 sigma^2 h; a mean over 77 segments and 500 bins, of which neighbours share two thirds: deviation below 1 %
    assert abs(np.mean(power[5:-5]) / (2.0 * 9.0 * H) - 1.0) < 0.04
    assert f[1] == pytest.approx(1.0 / (LENGTH * H)) and f[-1] == pytest.approx(0.5 / H)


def test_density_of_a_sine_integrates_to_its_power():
    t = np.arange(N) * H
    f, power = residual.density(2.0 * np.sin(2.0 * np.pi * 30.0 * t), H, LENGTH)
    near = (f > 25.0) & (f < 35.0)
    assert np.trapezoid(power[near], f[near]) == pytest.approx(2.0, rel=1e-3)  # A^2/2; the window's own leakage is 1e-4


def test_coherence_of_a_gain_in_noise():
    """y = 2 x + n: coherence 4 Sx / (4 Sx + Sn) at all frequencies."""
    rng = np.random.default_rng(2)
    x, n = rng.standard_normal((2, N))
    for size in (0.5, 2.0, 6.0):
        want = 4.0 / (4.0 + size**2)
        got, limit, chance = residual.coherence(2.0 * x + size * n, x[:, None], H, LENGTH)
        # bias (1 - want)^2/K; 500 values of deviation (1 - want) sqrt(2 want/K), a third of them independent: 4 of
        # those
        assert abs(np.mean(got[2:-2]) - want - (1.0 - want) ** 2 / SEGMENTS) < 4.0 * (1.0 - want) * np.sqrt(2.0 * want / SEGMENTS / 150.0)
        assert chance == pytest.approx(1.0 / SEGMENTS) and limit == pytest.approx(1.0 - 0.05 ** (1.0 / (SEGMENTS - 1.0)))


def test_coherence_with_several_inputs_counts_all_of_them():
    rng = np.random.default_rng(3)
    u = rng.standard_normal((N, 2))
    y = u[:, 0] - 3.0 * np.roll(u[:, 1], 2)
    assert np.min(residual.coherence(y, u, H, LENGTH)[0][2:-2]) > 0.99  # 2 samples of LENGTH are lost to the other segment
    one = residual.coherence(y, u[:, :1], H, LENGTH)[0]
    assert np.mean(one) == pytest.approx(0.1, abs=0.03)  # 1/(1 + 9), bias 0.8/K = 0.01, deviation of the mean 0.01


def test_coherence_of_independent_signals_exceeds_its_limit_by_chance_only():
    rng = np.random.default_rng(4)
    got, limit, _ = residual.coherence(rng.standard_normal(N), rng.standard_normal((N, 2)), H, LENGTH)
    # 5 % of 500 bins, a third of them independent: deviation below sqrt(0.05 * 0.95/167) = 1.7 %
    assert abs(np.mean(got > limit) - 0.05) < 0.06


def test_whiteness_of_noise_is_uniform_in_its_p_value():
    rng = np.random.default_rng(5)
    p = [residual.whiteness(rng.exponential(size=800))[0].p_value for _ in range(400)]
    assert stats.kstest(p, "uniform").pvalue > 1e-3  # of this seed, once and for all
    white, running = residual.whiteness(rng.exponential(size=800))
    assert white.level == pytest.approx(1.0, abs=4.0 / np.sqrt(800)) and running[-1] == pytest.approx(1.0)


def test_whiteness_is_the_distance_of_kolmogorov_and_smirnov():
    """Running sums of exponentials are ordered uniform numbers: SciPy's statistic of them."""
    ratio = np.random.default_rng(6).exponential(size=300)
    white, running = residual.whiteness(ratio)
    assert white.distance == pytest.approx(stats.kstest(running[:-1], "uniform").statistic, abs=1e-12)


def test_coloured_residual_is_not_white_by_its_own_spectrum():
    """A first-order lag with pole 0.5: the running share of its spectrum, integrated here, is at most 0.21 from a
    line."""
    rng = np.random.default_rng(7)
    m = 5000
    w = np.pi * (np.arange(m) + 0.5) / m
    shape = 1.0 / np.abs(1.0 - 0.5 * np.exp(-1j * w)) ** 2
    want = np.max(np.cumsum(shape) / np.sum(shape) - np.arange(1, m + 1) / m)
    white, _ = residual.whiteness(shape * rng.exponential(size=m))
    assert white.distance == pytest.approx(want, abs=1.6 / np.sqrt(m)) and white.distance > 5.0 * white.limit
    assert white.p_value < 1e-12 and white.level == pytest.approx(np.mean(shape), rel=0.1)


def test_bands_are_third_octaves_and_lose_no_power():
    edges = residual.third_octaves(1.0, 100.0)
    assert edges[1:] / edges[:-1] == pytest.approx(10.0**0.1)
    assert np.any(np.isclose(np.sqrt(edges[1:] * edges[:-1]), 10.0))  # 10 Hz is the middle of one
    f = np.linspace(0.5, 150.0, 400)
    power = 1.0 + 0.3 * np.sin(f)
    fine = np.linspace(edges[3], edges[9], 200_001)
    want = np.trapezoid(np.interp(fine, f, power), fine)
    assert np.sum(residual.band_rms(f, power, edges[3:10]) ** 2) == pytest.approx(want, rel=1e-6)


def test_stretches_find_a_burst():
    t = np.arange(N) * H
    r = np.where((t >= 20.0) & (t < 22.0), 3.0, 0.0)
    good = t < 60.0
    found = residual.stretches(t, good, r)
    assert len(found) == 30 and found[0][0] == 0.0  # 40 of 80 s, those after 60 s have no sample that counts
    assert {a: v[0] for a, _, v in found if v[0]} == {20.0: 3.0}


def test_averages_need_enough_samples():
    rows, columns = np.array([0] * 6 + [1] * 4), np.zeros(10, dtype=int)
    found = restoring.averages(np.arange(10.0), rows, columns, (2, 1))
    assert found[0, 0] == 2.5 and np.isnan(found[1, 0])


@pytest.fixture(scope="module")
def stiff(tmp_path_factory):
    """A vehicle with a spring that hardens, in the recording and not in the model; and its study."""
    folder = tmp_path_factory.mktemp("stiff")
    (folder / "car.toml").write_text(MODEL)
    model = penode_gen.load(folder / "car.toml")
    z = road(11)
    recording = record(folder / "a.csv", z, drive(z, lambda s, v: 3e8 * s**3), 12)
    return study.begin(model, [experiment(m, model) for m in load([recording], model)])


def test_forces_of_elements_are_their_laws(stiff):
    """C s + D v, parameters as the null fit has them, along the smoothed motion."""
    surface = restoring.surfaces(stiff, None, None)[0]
    known = {f.target: f.value for f in stiff.null.free}
    want = known["c"] * surface.s + known["d"] * surface.v
    # rates at samples are those of a line over a quarter of an interval: off by h/8 of the acceleration, which is below
    # 2 pi 20 Hz of the rate, so by 3 % of the damper's force
    assert residual.rms(surface.nominal - want) < 0.03 * D * residual.rms(surface.v)
    assert surface.count().sum() == len(surface.s) and surface.place == "spring"


def test_missing_force_is_the_one_that_was_hidden(stiff):
    """Measured minus nominal force against the cubic one, at the deflections where there are samples."""
    surface = restoring.surfaces(stiff, None, None)[0]
    hidden = 3e8 * surface.s**3
    assert residual.rms(hidden) > 0.1 * residual.rms(surface.nominal)  # it is no small one
    # nominal parameters within 1.5 tolerances of 1 % of true ones: up to 1.5 % of the force of spring and damper, times
    # the share that parameters can take of a cubic force at all; sensors of 0.02 m/s^2 on 400 kg add 8 N
    bound = 0.015 * (C * residual.rms(surface.s) + D * residual.rms(surface.v)) + 8.0
    assert residual.rms(surface.measured - surface.nominal - hidden) < bound
    numbers = restoring.surface_numbers(surface)
    worst = numbers["worst"]
    assert worst["missing"] * worst["deflection"] > 0.0 and abs(worst["missing"]) > residual.rms(hidden)


def test_messages_of_channels_have_place_and_size(stiff):
    e = stiff.experiments[0]
    before = residual.channels(e, stiff.model, stiff.null.simulated[0], None, residual.noise_floor(stiff, 0))
    found = residual.Shown(tuple(before), (), ()).numbers()
    assert [s["signal"] for s in found["signals"]] == ["a_body", "a_wheel", "deflection"] and not found["holdout"]
    for j, s in enumerate(found["signals"]):
        r = e.y[:, j] - stiff.null.simulated[0][:, j]
        assert s["before_rms"] == pytest.approx(np.sqrt(np.mean(r**2)), rel=1e-4)
        assert s["share_of_signal"] == pytest.approx(np.sqrt(np.mean(r**2)) / np.std(e.y[:, j]), rel=1e-4)
        assert s["whiteness"]["before"]["p_value"] < 1e-6 and "after" not in s["whiteness"]
        total = np.sqrt(np.mean([p["before"] ** 2 for p in s["time"]]))  # stretches are equal to a sample of 100
        assert total == pytest.approx(s["before_rms"], rel=0.01)
    assert len(e.time) > 0.99 * SAMPLES and pytest.approx(e.step) == STEP


def test_bad_samples_change_no_level():
    """White noise with a third of the samples masked: densities, tests and levels as without."""
    rng = np.random.default_rng(8)
    n, sigma = 6000, 0.3
    y = sigma * rng.standard_normal((n, 1))
    good = np.ones((n, 1), bool)
    good[2000:4000] = False
    time = np.arange(n) * H
    e = noise.prepare("", time, rng.standard_normal((n, 1)), np.where(good, y, 77.0), good, np.zeros(1), [None])

    class Model:
        sensors = (type("Sensor", (), {"name": "a", "unit": "m/s^2"}),)

    (c,) = residual.channels(e, Model, np.zeros((n, 1)), None, (e.frequencies, np.full((len(e.frequencies), 1), sigma**2)))
    assert np.mean(c.before.density) == pytest.approx(2.0 * H * sigma**2, rel=0.1)  # 4 of 2.4 %: 4000 samples, 0.4 of the band
    assert c.before.white.level == pytest.approx(1.0, abs=0.1) and c.noise == pytest.approx(sigma)
    assert residual.rms(c.before.values[c.good]) == pytest.approx(sigma, rel=4.0 / np.sqrt(2 * 4000))
