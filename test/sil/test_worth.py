# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""What a term matters beside what is free anyway, and priors with tails: by values by hand."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from penode_sil.diagnosis.evidence import prior
from penode_sil.diagnosis.evidence.colour import Colour
from penode_sil.diagnosis.evidence.observer import Record
from penode_sil.diagnosis.search.offsets import shifts
from penode_sil.diagnosis.search.worth import own, remaining
from penode_sil.diagnosis.study.fit import Free


def fit(columns, free):
    """A fit of one sensor with these columns [free, updates], whose innovations have the variance 4."""
    slopes = np.array(columns, float).T[:, None, :]
    return SimpleNamespace(free=tuple(free), slopes=slopes, variance=np.array([4.0]), used=np.ones(slopes.shape[:2], bool))


LAW = Free("law", 3.0, 0.5, sigma=1.0)
MODEL = SimpleNamespace(bodies=(SimpleNamespace(mass="m"),))


@pytest.mark.parametrize("turn", (0.0, 0.3, np.pi / 2))
def test_only_the_part_that_nothing_else_can_explain_counts(turn):
    """A column at an angle to the only other one: its sine is left."""
    others = [[1.0, 0.0, 0.0, 0.0], [np.cos(turn), np.sin(turn), 0.0, 0.0]]
    assert own(MODEL, fit(others, [Free("k", 1.0, 1.0), LAW]), ["law"]) == pytest.approx(np.sin(turn), abs=1e-12)


def test_masses_do_not_take_a_law_over():
    """All forces together with the masses are a scale that no sensor of motion shows: k and m together do just what the law does."""
    law, k = np.array([1.0, 2.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0, 0.0])
    free = [Free("m", 1.0, 1.0), Free("k", 1.0, 1.0), LAW]
    found = own(MODEL, fit([-(law + k), k, law], free), ["law"])
    assert found == pytest.approx(np.sqrt(2.0 / 6.0))  # but for k


def test_terms_that_cancel_each_other_are_none():
    """Two laws of one column and sizes that add up to nothing."""
    column = [1.0, -1.0, 2.0, 0.5]
    free = [LAW, Free("against", -3.0, 0.5, sigma=1.0)]
    assert own(MODEL, fit([column, column], free), ["law", "against"]) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("kind", (Free, prior.Stated))
@pytest.mark.parametrize("log", (False, True))
@pytest.mark.parametrize("value", (1.01, 1.3, 4.0))
def test_slope_of_a_prior_is_that_of_its_cost(kind, log, value):
    """Against central differences, whose error is h^2/6 of the third derivative, here below 1e-6 of a slope; and the parabola is nowhere
    below the cost (weights of Gauss)."""
    f = kind("p", value, 0.1, log=log, sigma=0.02, origin=1.0)
    h = 1e-5
    costs = [prior.cost(kind("p", float(f.at(x)), 0.1, log=log, sigma=0.02, origin=1.0)) for x in (-h, h)]
    assert prior.slopes([f])[0] == pytest.approx((costs[1] - costs[0]) / (2.0 * h), rel=1e-5)
    slope, curvature, x = prior.slopes([f])[0], prior.precisions([f])[0] ** 2, -0.3
    there = kind("p", float(f.at(x)), 0.1, log=log, sigma=0.02, origin=1.0)
    assert prior.cost(there) <= prior.cost(f) + slope * x + 0.5 * curvature * x**2 + 1e-9


def test_what_a_file_states_costs_no_more_than_a_cause():
    """Near the file as Gauss; eight deviations off 2.5 log(1 + 64/5), not 32; nothing without a prior."""
    near, far = (prior.Stated("p", 1.0 + n * 0.02, 0.1, sigma=0.02, origin=1.0) for n in (0.1, 8.0))
    assert prior.cost(near) == pytest.approx(0.005, rel=2e-3)
    assert prior.cost(far) == pytest.approx(2.5 * np.log(13.8))
    assert prior.cost(Free("p", 7.0, 0.1)) == 0.0
    assert prior.stated([near, far, Free("q", 9.0, 1.0, sigma=0.1)]) == prior.cost(near) + prior.cost(far)


def bench(y, colour, level=0.001, driven=0.0):
    """A bench of one sensor with a signal y [n], noise 0.1, updated every 4 samples, whose free run is off by `nu`; `driven`: variance that
    noise of inputs has in the sensor at its end."""

    def problem(nu):
        predictor = SimpleNamespace(predict=lambda free, shifts, by: (SimpleNamespace(nu=[nu[None, :, None]]),))
        return SimpleNamespace(predictor=predictor)

    run = SimpleNamespace(free=(), by=None)
    record, noise = Record("r", 1e-3, np.zeros((len(y), 0)), y[:, None]), np.array([0.1])
    gains = SimpleNamespace(driven=lambda samples: np.full(1, driven if samples == len(y) else np.nan))
    made = SimpleNamespace(level=SimpleNamespace(size=level), colour=colour, noise=noise, update=4, records=(record,))
    return lambda nu: (SimpleNamespace(**vars(made), problem=lambda: problem(nu), gains=lambda: gains), run)


SIGNAL = 3.0 * np.sqrt(2.0) * np.sin(0.01 * np.pi * np.arange(20_000))  # rms 3


@pytest.mark.parametrize("colour, stated, remains", [(None, 0.1, 0.0486), (0.5, 0.1, 0.0333), (0.5, 0.2, 0.0), (None, 0.2, 0.0)])
def test_what_remains_is_what_a_free_run_misses_beyond_noise(colour, stated, remains):
    """5000 means of noise (0.05), and a slow miss of 0.05 of the signal, 0.15, which an observer would follow. Noise is known to a fifth,
    and its power to three deviations, 6 %: 1.5 times of it in all. Of 0.025, 0.0213 is beyond white noise of 0.0025, 0.0486 of the signal.
    Coloured noise may be all that is stated: 0.01 is beyond the power of 0.1, 0.0333 of the signal, and nothing beyond that of 0.2. What
    samples show half of is coloured."""
    nu = 0.05 * np.random.default_rng(1).standard_normal(5000) + 0.15 * np.sqrt(2.0) * np.sin(0.004 * np.pi * np.arange(5000))
    taps = Colour(np.full((1, 1), colour), np.array([1e-3])) if colour else None
    assert remaining(*bench(SIGNAL, taps)(nu), np.array([stated])) == pytest.approx(remains, rel=0.03)


@pytest.mark.parametrize("driven, remains", [(0.01, 0.0264), (0.0225, 0.0)])
def test_what_noise_of_inputs_does_to_a_free_run_does_not_remain(driven, remains):
    """The same miss of a power of 0.025 in all. Beyond 1.5 times of 0.0125 there is 0.00625: 0.0264 of the signal. Where noise of the
    inputs does as much as the miss, there is nothing."""
    nu = 0.05 * np.random.default_rng(1).standard_normal(5000) + 0.15 * np.sqrt(2.0) * np.sin(0.004 * np.pi * np.arange(5000))
    assert remaining(*bench(SIGNAL, None, driven=driven)(nu), np.array([0.1])) == pytest.approx(remains, rel=0.03)


def test_only_noise_remains_of_a_sound_model():
    """Whatever the level of the bench."""
    nu = 0.05 * np.random.default_rng(2).standard_normal(5000)
    assert remaining(*bench(SIGNAL, None)(nu), np.array([0.1])) == 0.0


def test_curves_that_cancel_each_other_shift_a_mean_both():
    """Two springs that move the mean by 3 and by -2 units of their values, of 0.5 and 1.5 units: 4.5, twice that behind a filter that
    leaves half of a mean; shapes (log) and parameters do not count."""
    free = [Free("a", 0.5, 1.0), Free("b", 0.75, 0.5), Free("gap", 2.0, 1.0, log=True, origin=1.0), Free("k", 7.0, 1.0)]
    slopes = np.tile([3.0, -2.0, 5.0, 11.0], (6, 1, 1)) + np.linspace(-1.0, 1.0, 6)[:, None, None]
    run = SimpleNamespace(free=tuple(free), slopes=slopes, used=np.ones((6, 1), bool))
    terms = [SimpleNamespace(free=free[:1]), SimpleNamespace(free=free[1:3])]
    assert shifts(SimpleNamespace(colour=None), run, terms) == pytest.approx([4.5])
    half = Colour(np.full((1, 1), 0.5), np.array([1.0]))
    assert shifts(SimpleNamespace(colour=half), run, terms) == pytest.approx([9.0])
